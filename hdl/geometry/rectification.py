"""The rectification of a rig: which rotations and which common projection turn two cameras into a row-aligned pair, or
into a column-aligned one where one stands above the other."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import cv2
import numpy as np

from hdl.calibration import stance
from hdl.calibration.rig import SIDES, Camera, Rig
from hdl.errors import InputError
from hdl.geometry.choices import RectificationOptions
from hdl.geometry.coordinates import inside_image
from hdl.geometry.row_minimisation import minimise_rows
from hdl.geometry.view import View
from hdl.lens import LENS_MODELS

__all__ = ["LEAST_FILLED", "MAGNIFIED", "RectificationOptions", "View", "helpful", "magnification", "rectify"]

# R and P by side; and R1, R2, P1, P2.
Rectification: TypeAlias = dict[str, tuple[np.ndarray, np.ndarray]]
Matrices: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

MAGNIFIED = 2.0  # a rectified view magnified further is seldom meant
DEGENERATE = 10  # one magnified or reduced further is one that went wrong
ALPHAS = 0, 1, 0.75, 0.5, 0.25  # that are tried, the most usual first
LEAST_FILLED = 0.5  # share of the frame; rectified frames as people choose them are filled by more than two thirds


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
    if options.keep_the_files and rig.rectification_fault:
        raise InputError(None, None, None, f"{rig.rectification_fault}{_instead(rig)}")
    if rig.rectification and options.keep_the_files:
        rectification = rig.rectification
        geometry = [(role, rectification[side][0]) for role, side in zip(("R1", "R2"), SIDES)]
        reason = ""
    else:
        rectification = _computed(rig, options)
        turn = stance.largest_turn(rig)
        geometry = [(turn.role, turn.value)] * 2
        reason = f", as {turn.cause}" if turn.angle >= stance.UNUSUAL else ""
        P1, P2 = (rectification[side][1] for side in SIDES)
        if not _chosen(options) and _degenerate(rig, P1, P2):
            raise _degenerate_fault(rig, options.alpha or 0.0, P1)
    views = _views(rig, rectification, lens, origin=_origin(rig, options), unit=rig.unit, fault=rig.fault)
    views = {side: replace(view, geometry=culprit) for (side, view), culprit in zip(views.items(), geometry)}
    for view in views.values():
        if not view.nearest() > 0:
            problem = f"the rectified frame reaches behind the {view.side} camera{reason}"
            raise rig.fault(*view.geometry, problem + _instead(rig))
    if options.minimise:
        focal = options.focal is None and options.fov is None
        fewest = minimise_rows(views, options.allowed_loss, center=options.center is None, focal=focal)
        return {side: replace(view, before=views[side]) for side, view in fewest.items()}
    return views


def magnification(rig: Rig, view: View) -> float:
    """How many times larger ``view`` shows things than the images of ``rig`` do, resampled to the rectified size."""
    return view.P[1, 1] / _source_focal_length(rig)


def helpful(rig: Rig) -> list[RectificationOptions]:
    """Choices that rectify ``rig`` anew to a frame with a source, at about the scale of the images: each tried."""
    f = _source_focal_length(rig)
    by_alpha = [] if _is_fisheye(rig) else [RectificationOptions(alpha=alpha) for alpha in ALPHAS]
    by_view = [RectificationOptions(fov=math.floor(2 * math.degrees(math.atan(rig.width / 2 / f))))]
    axes = np.array([R[:2, 2] / R[2, 2] for R in _stereo_rectify(rig, None, None, 0)[:2]])
    extent = np.array([rig.width, rig.height]) - 1
    center = np.clip(np.round(extent / 2 - f * axes.mean(axis=0)), 0, extent)  # the images' middles in the frame's
    by_view.append(RectificationOptions(focal=round(f), center=tuple(center)))
    found = (next((options for options in group if _works(rig, options)), None) for group in (by_alpha, by_view))
    return [options for options in found if options]


def _works(rig: Rig, options: RectificationOptions) -> bool:
    try:
        rectification = _computed(rig, options)
    except InputError:
        return False
    P1, P2 = (rectification[side][1] for side in SIDES)
    if _degenerate(rig, P1, P2, MAGNIFIED):
        return False
    views = _views(rig, rectification, lens=True)
    return all(view.nearest() > 0 and _filled(view) > LEAST_FILLED for view in views.values())


def _filled(view: View, cells: int = 40) -> float:
    """About the share of the frame that has a source."""
    x, y = (np.linspace(0, extent - 1, cells) for extent in (view.width, view.height))
    with np.errstate(all="ignore"):
        return inside_image(*view.project(x, y[:, None]), *view.source_size).mean()


def _views(rig: Rig, rectification: Rectification, lens: bool, **details: Any) -> dict[str, View]:
    (_, P1), (_, P2) = rectification.values()
    aligned = stance.ALIGNED[stance.along(P2[:, 3] - P1[:, 3])]
    return {
        side: View(
            side, rig.camera(side), R, P, rig.width, rig.height, lens,
            aligned=aligned, entry=rig.origins[side], **details,
        )
        for side, (R, P) in rectification.items()
    }  # fmt: skip


def _instead(rig: Rig) -> str:
    found = [options.spelled for options in helpful(rig)]
    return f"; {' or '.join(found)} would do" if found else ""


def _origin(rig: Rig, options: RectificationOptions) -> str:
    if rig.rectification and not options.given:
        return "the file's own"
    return f"computed, {', '.join(options.given) or 'default'}"


def _chosen(options: RectificationOptions) -> object:
    """Whether the user decides on P: it is then not cv2.stereoRectify's."""
    return options.center or options.focal or options.fov


def _is_fisheye(rig: Rig) -> bool:
    return any(LENS_MODELS[camera.model].is_fisheye for camera in (rig.left, rig.right))


def _computed(rig: Rig, options: RectificationOptions) -> Rectification:
    """{side: (R, P)} by cv2.stereoRectify and ``options``."""
    alpha = options.alpha or 0.0
    if not _is_fisheye(rig):
        D1, D2 = _coefficients(rig)
        R1, R2, P1, P2 = _stereo_rectify(rig, D1, D2, alpha)
    elif options.alpha is None:
        R1, R2, P1, P2 = _without_alpha(rig)
    else:
        model = next(camera.model for camera in (rig.left, rig.right) if LENS_MODELS[camera.model].is_fisheye)
        raise InputError("--alpha", None, alpha, f"a lens of model {model} has none; choose --focal or --fov")
    if rig.rectification:
        R1 = R2 @ rig.R  # of such a rig R has the errors that rounding left in R1 and R2 of the file
    if not _chosen(options):
        return {"left": (R1, P1), "right": (R2, P2)}
    center = options.center or (P1[0, 2], P1[1, 2])
    nearest = np.clip(np.round(center), 0, [rig.width - 1, rig.height - 1])
    for name, c, extent in zip("xy", center, (rig.width, rig.height)):
        if not 0 <= c <= extent - 1:
            problem = (
                f"the principal point lies outside the {rig.width}x{rig.height} frame; --center "
                f"{nearest[0]:g},{nearest[1]:g} is the nearest inside"
            )
            raise InputError("--center", name, c, problem)
    wanted = options.focal or options.fov and _focal_of_fov(options.fov, center[0], rig.width)
    if wanted:
        f = wanted
        if not max(rig.width, rig.height) / 20 <= f <= max(rig.width, rig.height) * 100:
            name, value = ("--focal", f) if options.focal else ("--fov", options.fov)
            raise InputError(name, None, value, f"a focal length of {f:.4g} px suits no {rig.width}x{rig.height} frame")
    elif _is_fisheye(rig):
        f = P1[0, 0]
    else:
        f = _focal_of_alpha(rig, (R1, R2), center, alpha)
    return _pair(rig, (R1, R2), f, center)


def _pair(rig: Rig, rotations: tuple[np.ndarray, np.ndarray], f: float, center: tuple[float, float]) -> Rectification:
    """{side: (R, P)} for a common focal length and principal point."""
    P1 = np.array([[f, 0, center[0], 0], [0, f, center[1], 0], [0, 0, 1, 0]], dtype=np.float64)
    P2, T = P1.copy(), rotations[1] @ rig.T
    axis = stance.along(T)
    P2[axis, 3] = f * T[axis]
    return {"left": (rotations[0], P1), "right": (rotations[1], P2)}


def _without_alpha(rig: Rig) -> Matrices:
    """R1, R2, P1, P2: cv2.stereoRectify's rotations, the source's mean focal length, the middle of the image.

    cv2.fisheye.stereoRectify derives a focal length from the image corners, which tends to 0 on lenses near
    180 degrees.
    """
    R1, R2, _, _ = _stereo_rectify(rig, None, None, 0)
    pair = _pair(rig, (R1, R2), _source_focal_length(rig), ((rig.width - 1) / 2, (rig.height - 1) / 2))
    return R1, R2, pair["left"][1], pair["right"][1]


def _coefficients(rig: Rig) -> list[np.ndarray | None]:
    return [camera.D if camera.D.size else None for camera in (rig.left, rig.right)]


def _degenerate_fault(rig: Rig, alpha: float, P1: np.ndarray) -> InputError:
    """What is to be said of a rectification by cv2.stereoRectify with a magnification that cannot be meant."""
    D1, D2 = _coefficients(rig)
    culprit, reason, turn = ("D1", D1), "", stance.largest_turn(rig)
    if _degenerate(rig, *_stereo_rectify(rig, None, None, alpha)[2:], MAGNIFIED):
        culprit = turn.role, turn.value
        if turn.angle >= stance.UNUSUAL:
            reason = f", as {turn.cause}"
    elif _degenerate(rig, *_stereo_rectify(rig, None, D2, alpha)[2:]):
        culprit = "D2", D2
    times = P1[0, 0] / _source_focal_length(rig)
    found = f"magnifies {times:.3g} times" if times > 0 else "finds no view"
    problem = f"with alpha {alpha:g} cv2.stereoRectify {found}{reason}"
    return rig.fault(*culprit, problem + _instead(rig))


def _degenerate(rig: Rig, P1: np.ndarray, P2: np.ndarray, most: float = DEGENERATE) -> bool:
    """Whether the pair is magnified or reduced more than ``most`` times, or looks far past the images."""
    times = P1[0, 0] / _source_focal_length(rig)
    centres = np.abs([P1[:2, 2], P2[:2, 2]]).max()
    return not (1 / most < times < most and centres <= DEGENERATE * max(rig.width, rig.height))


def _focal_of_fov(fov: float, cx: float, width: int) -> float:
    """The focal length, px, at which atan(left/f) + atan(right/f) = fov for the frame's edges left and right of cx."""
    product = (cx + 0.5) * (width - 0.5 - cx)
    half = width / 2 / math.tan(math.radians(fov))
    return half + math.sqrt(half * half + product)


def _focal_of_alpha(
    rig: Rig, rotations: tuple[np.ndarray, np.ndarray], center: tuple[float, float], alpha: float
) -> float:
    """What alpha means for a principal point that is not cv2.stereoRectify's.

    With 0 the least focal length whose frame has a source at every pixel of its border, with 1 the greatest whose frame
    has one at none, linearly between them.
    """

    def border(f: float) -> np.ndarray:
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
    outer = alpha and _last(tried, lambda f: border(f).any()) or whole
    return whole * (1 - alpha) + outer * alpha


def _last(tried: np.ndarray, holds: Callable[[float], np.bool]) -> float | None:
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


def _border_inside(view: View) -> np.ndarray:
    """For the pixels of the frame's border: whether they have a source inside the source image."""
    x, y = np.arange(view.width, dtype=np.float64), np.arange(view.height, dtype=np.float64)
    right, bottom = np.full_like(y, x[-1]), np.full_like(x, y[-1])
    xr, yr = np.concatenate([x, x, 0 * y, right]), np.concatenate([0 * x, bottom, y, y])
    with np.errstate(all="ignore"):
        u, v = view.project(xr, yr)
    front = view.ray[2] @ [xr, yr, np.ones_like(xr)] > 0
    return front & inside_image(u, v, *view.source_size)


def _source_focal_length(rig: Rig) -> float:
    """The mean of both cameras' and both axes' next to the optical axis, px of the rectified image's size."""
    return np.mean([camera.pinhole[i, i] for camera in _common_size(rig) for i in (0, 1)])


def _common_size(rig: Rig) -> list[Camera]:
    """Both cameras, their images resampled to the rectified size: corner to corner, so that they show what they did."""
    size = np.array([rig.width, rig.height])
    return [
        replace(camera, K=np.diag([*((size - 1) / np.subtract(camera.size, 1)), 1]) @ camera.K)
        for camera in (rig.left, rig.right)
    ]


def _stereo_rectify(rig: Rig, D1: Any, D2: Any, alpha: float) -> Matrices:
    """R1, R2, P1, P2.

    cv2.stereoRectify knows one image size, the rectified images' and both cameras'. R1 and R2 follow from R and T
    alone; P from where the images' borders come to lie, which is the same for images resampled to that size.
    """
    size, T = (rig.width, rig.height), rig.T.reshape(3, 1)
    K1, K2 = (camera.K for camera in _common_size(rig))
    try:
        return cv2.stereoRectify(K1, D1, K2, D2, size, rig.R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha)[:4]
    except cv2.error as error:
        turn = stance.largest_turn(rig)
        raise rig.fault(turn.role, turn.value, f"cv2.stereoRectify refuses the rig: {error.err}") from None
