"""The rectification of a rig: which rotations and which common projection turn two cameras into a row-aligned pair."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from hdl.calibration.checks import half_rotation
from hdl.calibration.rig import SIDES, Rig
from hdl.errors import InputError
from hdl.geometry.coordinates import inside_image
from hdl.geometry.row_minimisation import minimise_rows
from hdl.geometry.view import View
from hdl.lens import LENS_MODELS

__all__ = ["RectificationOptions", "View", "rectify"]

DEGENERATE = 10  # a rectified view magnified or reduced further is one that went wrong


@dataclass(frozen=True)
class RectificationOptions:
    """What the user chooses of the rectification, each by its command-line name; None: not chosen.

    Parameters
    ----------
    alpha : float
        As cv2.stereoRectify's: 0 shows no pixel without a source, 1 loses no source pixel. It is a choice of the focal
        length, which cameras with a lens that cv2.stereoRectify does not know do not have; 0 where nothing else
        chooses it.
    focal : float
        Focal length of both rectified views, px.
    fov : float
        In place of ``focal``: horizontal field of view of the rectified frame, outer edge to outer edge, degrees.
    center : (x, y)
        Principal point of both rectified views, px, inside the frame.
    minimise : "rows"
        Choose what is left free so that the line buffers are smallest; see `hdl.geometry.row_minimisation`.
    max_fov_loss : float
        For ``minimise``: the share of the field of view that it may give up, 0 to 0.5.

    Raises
    ------
    InputError
        For a value outside its range, and where two of alpha, focal and fov are given.
    """

    alpha: float | None = None
    focal: float | None = None
    center: tuple[float, float] | None = None
    fov: float | None = None
    minimise: str | None = None
    max_fov_loss: float = 0.05

    def __post_init__(self):
        for name, fits, needed in (
            ("alpha", lambda x: 0 <= x <= 1, "a number from 0 to 1"),
            ("focal", lambda x: 0 < x < math.inf, "a positive number of pixels"),
            ("fov", lambda x: 0 < x < 180, "an angle between 0 and 180 degrees"),
            ("max_fov_loss", lambda x: 0 <= x <= 0.5, "a share from 0 to 0.5"),
        ):
            value = getattr(self, name)
            if value is not None and not fits(value):
                raise InputError(_option(name), None, value, f"{needed} is needed")
        if self.minimise not in (None, "rows"):
            raise InputError("--minimise", None, self.minimise, "rows is what can be minimised")
        first, *others = [name for name in ("alpha", "focal", "fov") if getattr(self, name) is not None] or [None]
        if others:
            problem = f"{_option(first)} chooses the focal length already; keep one of them"
            raise InputError(_option(others[0]), None, getattr(self, others[0]), problem)

    @property
    def given(self) -> list[str]:
        """The choices that were made, as the command line spells them. With one, a file's own rectification is out."""
        names = ("alpha", "focal", "center", "fov", "minimise")
        return [_option(name) for name in names if getattr(self, name) is not None]


def rectify(rig: Rig, options: RectificationOptions = RectificationOptions(), *, lens: bool) -> dict[str, View]:
    """The rectified views of ``rig``, by side.

    The rectification is the file's own where there is one and ``options`` choose nothing. Otherwise it is
    cv2.stereoRectify's with CALIB_ZERO_DISPARITY, computed with the lens even if the map is without it: cores with and
    without lens then share R and P. Cameras with a lens that cv2.stereoRectify does not know, fisheyes for the most
    part, keep the source's focal length next to the optical axis and have their principal point in the middle of the
    frame, unless options say otherwise. ``minimise`` alone, on a file with a rectification, starts
    from that, and its result depends on ``lens``.

    Raises
    ------
    InputError
        If an option does not fit the rig, if the rectified frame reaches behind a camera (z <= 0), or if the file's
        own rectification is wanted and cannot be right.
    """
    own = options.given in ([], ["--minimise"])
    if own and rig.rectification_fault:
        instead = "--focal or --fov" if _is_fisheye(rig) else "--alpha 0, --focal or --fov"
        raise InputError(None, None, None, f"{rig.rectification_fault}; {instead} do without it")
    if rig.rectification and own:
        rectification = rig.rectification
        geometry = [(role, rectification[side][0]) for role, side in zip(("R1", "R2"), SIDES)]
    else:
        rectification = _computed(rig, options)
        geometry = [_larger_turn(rig)] * 2
    views = {
        side: View(
            side, rig.camera(side), *rectification[side], rig.width, rig.height, lens,
            origin=_origin(rig, options), entry=rig.origins[side], unit=rig.unit, geometry=culprit, fault=rig.fault,
        )
        for side, culprit in zip(SIDES, geometry)
    }  # fmt: skip
    for view in views.values():
        if not view.nearest() > 0:
            problem = f"the rectified frame reaches behind the {view.side} camera (z = {view.nearest():.3g})"
            raise rig.fault(*view.geometry, problem)
    if options.minimise:
        focal = options.focal is None and options.fov is None
        fewest = minimise_rows(views, options.max_fov_loss, center=options.center is None, focal=focal)
        return {side: replace(view, before=views[side]) for side, view in fewest.items()}
    return views


def _origin(rig, options):
    if rig.rectification and not options.given:
        return "the file's own"
    return f"computed, {', '.join(options.given) or 'default'}"


def _option(name):
    return "--" + name.replace("_", "-")


def _is_fisheye(rig):
    return any(LENS_MODELS[camera.model].is_fisheye for camera in (rig.left, rig.right))


def _computed(rig, options):
    """{side: (R, P)} by cv2.stereoRectify and ``options``."""
    alpha = options.alpha or 0.0
    chosen = options.center or options.focal or options.fov
    if not _is_fisheye(rig):
        R1, R2, P1, P2 = _polynomial(rig, alpha, check=not chosen)
    elif options.alpha is None:
        R1, R2, P1, P2 = _without_alpha(rig)
    else:
        model = next(camera.model for camera in (rig.left, rig.right) if LENS_MODELS[camera.model].is_fisheye)
        raise InputError("--alpha", None, alpha, f"a lens of model {model} has none; choose --focal or --fov")
    if rig.rectification:
        R1 = R2 @ rig.R  # of such a rig R has the errors that rounding left in R1 and R2 of the file
    if not chosen:
        return {"left": (R1, P1), "right": (R2, P2)}
    center = options.center or (P1[0, 2], P1[1, 2])
    for name, c, extent in zip("xy", center, (rig.width, rig.height)):
        if not 0 <= c <= extent - 1:
            problem = f"the principal point lies outside the {rig.width}x{rig.height} frame"
            raise InputError("--center", name, c, problem if options.center else problem + "; give one")
    if options.focal or options.fov:
        f = options.focal or _focal_of_fov(options.fov, center[0], rig.width)
        if not max(rig.width, rig.height) / 20 <= f <= max(rig.width, rig.height) * 100:
            name, value = ("--focal", f) if options.focal else ("--fov", options.fov)
            raise InputError(name, None, value, f"a focal length of {f:.4g} px suits no {rig.width}x{rig.height} frame")
    elif _is_fisheye(rig):
        f = P1[0, 0]
    else:
        f = _focal_of_alpha(rig, (R1, R2), center, alpha)
    return _pair(rig, (R1, R2), f, center)


def _pair(rig, rotations, f, center):
    """{side: (R, P)} for a common focal length and principal point."""
    P1 = np.array([[f, 0, center[0], 0], [0, f, center[1], 0], [0, 0, 1, 0]], dtype=np.float64)
    P2 = P1.copy()
    P2[0, 3] = f * (rotations[1] @ rig.T)[0]
    return {"left": (rotations[0], P1), "right": (rotations[1], P2)}


def _without_alpha(rig):
    """R1, R2, P1, P2: cv2.stereoRectify's rotations, the source's mean focal length, the middle of the image.

    cv2.fisheye.stereoRectify derives a focal length from the image corners, which tends to 0 on lenses near
    180 degrees.
    """
    R1, R2, _, _ = _stereo_rectify(rig, None, None, 0)
    pair = _pair(rig, (R1, R2), _source_focal_length(rig), ((rig.width - 1) / 2, (rig.height - 1) / 2))
    return R1, R2, pair["left"][1], pair["right"][1]


def _polynomial(rig, alpha, check):
    """R1, R2, P1, P2 of cv2.stereoRectify; ``check``: refuse a magnification that cannot be meant."""
    D1, D2 = (camera.D if camera.D.size else None for camera in (rig.left, rig.right))
    R1, R2, P1, P2 = _stereo_rectify(rig, D1, D2, alpha)
    if check and _degenerate(rig, P1, P2):
        if _degenerate(rig, *_stereo_rectify(rig, None, None, alpha)[2:]):
            culprit = _larger_turn(rig)
        elif _degenerate(rig, *_stereo_rectify(rig, None, D2, alpha)[2:]):
            culprit = "D2", D2
        else:
            culprit = "D1", D1
        magnification = P1[0, 0] / _source_focal_length(rig)
        problem = f"with alpha {alpha:g} cv2.stereoRectify magnifies {magnification:.3g} times; another alpha may help"
        raise rig.fault(*culprit, problem)
    return R1, R2, P1, P2


def _degenerate(rig, P1, P2):
    magnification = P1[0, 0] / _source_focal_length(rig)
    centres = np.abs([P1[:2, 2], P2[:2, 2]]).max()
    return not (1 / DEGENERATE < magnification < DEGENERATE and centres <= DEGENERATE * max(rig.width, rig.height))


def _focal_of_fov(fov, cx, width):
    """The focal length, px, at which atan(left/f) + atan(right/f) = fov for the frame's edges left and right of cx."""
    product = (cx + 0.5) * (width - 0.5 - cx)
    half = width / 2 / math.tan(math.radians(fov))
    return half + math.sqrt(half * half + product)


def _focal_of_alpha(rig, rotations, center, alpha):
    """What alpha means for a principal point that is not cv2.stereoRectify's.

    With 0 the least focal length whose frame has a source at every pixel of its border, with 1 the greatest whose frame
    has one at none, linearly between them.
    """

    def border(f):
        pair = _pair(rig, rotations, f, center)
        return np.concatenate([
            _border_inside(View(side, rig.camera(side), *pair[side], rig.width, rig.height, lens=True))
            for side in SIDES
        ])  # fmt: skip

    f = _source_focal_length(rig)
    tried = f * np.geomspace(DEGENERATE, 1 / DEGENERATE, 300)
    whole = _last(tried, lambda f: border(f).all())
    if whole is None:
        problem = "no focal length shows pixels with a source only; give one with --focal"
        raise InputError("--center", None, f"{center[0]:g},{center[1]:g}", problem)
    outer = _last(tried, lambda f: border(f).any()) if alpha else whole
    return whole * (1 - alpha) + outer * alpha


def _last(tried, holds):
    """Down the sequence ``tried``, the least value to which ``holds`` still holds; None if it never does."""
    if not holds(tried[0]):
        return None
    fails = next((i for i, value in enumerate(tried) if not holds(value)), None)
    if fails is None:
        return tried[-1]
    good, bad = tried[fails - 1], tried[fails]
    for _ in range(40):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def _border_inside(view):
    """For the pixels of the frame's border: whether they have a source inside the source image."""
    x, y = np.arange(view.width, dtype=np.float64), np.arange(view.height, dtype=np.float64)
    right, bottom = np.full_like(y, x[-1]), np.full_like(x, y[-1])
    xr, yr = np.concatenate([x, x, 0 * y, right]), np.concatenate([0 * x, bottom, y, y])
    with np.errstate(all="ignore"):
        u, v = view.project(xr, yr)
    front = view.ray[2] @ [xr, yr, np.ones_like(xr)] > 0
    return front & inside_image(u, v, *view.source_size)


def _source_focal_length(rig):
    """The mean of both cameras' and both axes' next to the optical axis, px of the rectified image's size."""
    return np.mean([camera.pinhole[i, i] for camera in _common_size(rig) for i in (0, 1)])


def _common_size(rig):
    """Both cameras, their images resampled to the rectified size: corner to corner, so that they show what they did."""
    size = np.array([rig.width, rig.height])
    return [
        replace(camera, K=np.diag([*((size - 1) / np.subtract(camera.size, 1)), 1]) @ camera.K)
        for camera in (rig.left, rig.right)
    ]


def _stereo_rectify(rig, D1, D2, alpha):
    """R1, R2, P1, P2.

    cv2.stereoRectify knows one image size, the rectified images' and both cameras'. R1 and R2 follow from R and T
    alone; P from where the images' borders come to lie, which is the same for images resampled to that size.
    """
    size, T = (rig.width, rig.height), rig.T.reshape(3, 1)
    K1, K2 = (camera.K for camera in _common_size(rig))
    try:
        return cv2.stereoRectify(K1, D1, K2, D2, size, rig.R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha)[:4]
    except cv2.error as error:
        raise rig.fault(*_larger_turn(rig), f"cv2.stereoRectify refuses the rig: {error.err}") from None


def _larger_turn(rig):
    """Role and value of R or T, whichever turns the cameras further: the one to look at when a rectification fails."""
    angle = np.linalg.norm(cv2.Rodrigues(rig.R)[0]) / 2
    x, y, z = half_rotation(rig.R) @ rig.T
    return ("T", rig.T) if np.arctan2(np.hypot(y, z), -x) > angle else ("R", rig.R)
