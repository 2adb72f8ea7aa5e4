"""The exact map: for every rectified pixel, where in the source image it comes from, in float64.

The lens models are computed here rather than by OpenCV, whose maps are float32. They agree with
cv2.initUndistortRectifyMap and cv2.fisheye.initUndistortRectifyMap to the precision of those, except that a skew in K,
which OpenCV leaves out, takes part.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import cv2
import numpy as np

from hdl.calibration.checks import half_rotation
from hdl.calibration.rig import SIDES, Camera, Rig
from hdl.errors import InputError

# No core addresses coordinates further out; a lens polynomial beyond its poles and a view along the image plane do.
FARTHEST = 1 << 20  # px
DEGENERATE = 10  # a rectified view magnified or reduced further is one that went wrong
_CHUNK = 1 << 15  # pixels at a time: the intermediate arrays then stay in the cache


@dataclass(frozen=True, eq=False)
class View:
    """One rectified camera.

    Members
    -------
    side : str
        "left" or "right".
    camera : Camera
        The source camera.
    R : (3, 3) float64
        Rectifying rotation, from the source camera to the rectified one.
    P : (3, 4) float64
        Projection of the rectified camera, px.
    width, height : int
        Size of the rectified image and of the source image, px.
    lens : bool
        Whether the map contains the lens. Without it, it is the homography of Eq. 2.
    geometry : (str, array)
        For messages: the role of the field that R follows from, and its value.
    fault : callable
        For messages: Rig.fault of the rig that the view is of.
    """

    side: str
    camera: Camera
    R: np.ndarray
    P: np.ndarray
    width: int
    height: int
    lens: bool
    geometry: tuple[str, np.ndarray | None] = field(default=("R", None), repr=False)
    fault: Callable[..., InputError] = field(default=partial(InputError, None), repr=False)

    @cached_property
    def ray(self) -> np.ndarray:
        """(3, 3) float64: takes a rectified pixel (xr, yr, 1) to its ray in the source camera's axes.

        (P R)^-1 and not R^T P^-1, as in OpenCV: the two differ where a file rounds R.
        """
        return np.linalg.inv(self.P[:, :3] @ self.R)

    @property
    def homography(self) -> np.ndarray:
        """(3, 3) float64: C = K R^T P^-1, which takes (xr, yr, 1) to (x, y, z) with u = x/z, v = y/z (Eq. 1-3)."""
        return self.camera.K @ self.ray

    def project(self, xr, yr) -> tuple[np.ndarray, np.ndarray]:
        """Source coordinates (u, v), px, float64, of rectified pixels; xr and yr of any shapes that broadcast."""
        matrix = self.ray if self.lens else self.homography
        x, y, z = (row[0] * xr + (row[1] * yr + row[2]) for row in matrix)
        x /= z
        y /= z
        if not self.lens:
            return x, y
        x, y = (_equidistant if self.camera.model == "equidistant" else _polynomial)(x, y, self.camera.D)
        (fx, skew, cx), (_, fy, cy), _ = self.camera.K
        u = x * fx
        if skew:
            u += skew * y
        u += cx
        v = y * fy
        v += cy
        return u, v

    def map(self) -> tuple[np.ndarray, np.ndarray]:
        """Source coordinates (u, v), px, read-only float64 arrays of shape (height, width). Computed once.

        Raises InputError if no pixel of the rectified image comes from inside the source image, or if one comes from
        farther out than any core can address.
        """
        return self._map

    @cached_property
    def _map(self):
        u, v = (np.empty((self.height, self.width)) for _ in range(2))
        xr = np.arange(self.width, dtype=np.float64)
        step = max(1, _CHUNK // self.width)

        def fill(top):
            rows = slice(top, min(top + step, self.height))
            yr = np.arange(rows.start, rows.stop, dtype=np.float64)[:, None]
            with np.errstate(all="ignore"):  # what overflows is refused below
                part_u, part_v = self.project(xr, yr)
            u[rows], v[rows] = part_u, part_v
            inside = (part_u >= 0) & (part_u <= self.width - 1) & (part_v >= 0) & (part_v <= self.height - 1)
            return inside.any(), max(np.abs(part_u, out=part_u).max(), np.abs(part_v, out=part_v).max())

        with ThreadPoolExecutor() as pool:
            parts = list(pool.map(fill, range(0, self.height, step)))
        if not all(farthest <= FARTHEST for _, farthest in parts):
            raise self._refusal(f"the map of the {self.side} camera leads to infinity")
        if not any(inside for inside, _ in parts):
            raise self._refusal(f"no pixel of the rectified {self.side} image comes from inside the source image")
        u.setflags(write=False)
        v.setflags(write=False)
        return u, v

    def _refusal(self, problem):
        if not self.lens:
            return self.fault(*self.geometry, problem)
        replace(self, lens=False).map()  # raises if the lens is not to blame
        return self.fault(f"D{1 + SIDES.index(self.side)}", self.camera.D, problem)

    def nearest(self) -> float:
        """The least z of (x, y, z) over the rectified frame; z is affine in xr and yr, so a corner has it."""
        xr, yr = np.meshgrid([0, self.width - 1], [0, self.height - 1])
        return (self.ray[2, 0] * xr + self.ray[2, 1] * yr + self.ray[2, 2]).min()


def rectify(rig: Rig, *, alpha: float = 0.0, lens: bool) -> dict[str, View]:
    """The rectified views of ``rig``, by side.

    The rectification is the file's own where there is one. Otherwise it is cv2.stereoRectify's with
    CALIB_ZERO_DISPARITY and ``alpha`` (0: no pixel without a source, 1: no source pixel lost), computed with the lens
    even if the map is without it: cores with and without lens then share R and P. Equidistant cameras take no part in
    ``alpha``; see :func:`_rectify_equidistant`.

    Raises
    ------
    InputError
        If ``alpha`` lies outside 0 to 1, or if the rectified frame reaches behind a camera (z <= 0).
    """
    if not 0 <= alpha <= 1:
        raise InputError("--alpha", None, alpha, "a number from 0 to 1 is needed")
    if rig.rectification:
        rectification = rig.rectification
        geometry = [(role, rectification[side][0]) for role, side in zip(("R1", "R2"), SIDES)]
    else:
        equidistant = "equidistant" in (rig.left.model, rig.right.model)
        rectification = _rectify_equidistant(rig) if equidistant else _rectify_polynomial(rig, alpha)
        geometry = [_larger_turn(rig)] * 2
    views = {
        side: View(side, rig.camera(side), *rectification[side], rig.width, rig.height, lens, origin, rig.fault)
        for side, origin in zip(SIDES, geometry)
    }
    for view in views.values():
        if not view.nearest() > 0:
            problem = f"the rectified frame reaches behind the {view.side} camera (z = {view.nearest():.3g})"
            raise rig.fault(*view.geometry, problem)
    return views


def _rectify_polynomial(rig, alpha):
    D1, D2 = (camera.D if camera.D.size else None for camera in (rig.left, rig.right))
    R1, R2, P1, P2 = _stereo_rectify(rig, D1, D2, alpha)
    if _degenerate(rig, P1, P2):
        if _degenerate(rig, *_stereo_rectify(rig, None, None, alpha)[2:]):
            culprit = _larger_turn(rig)
        elif _degenerate(rig, *_stereo_rectify(rig, None, D2, alpha)[2:]):
            culprit = "D2", D2
        else:
            culprit = "D1", D1
        magnification = P1[0, 0] / _source_focal_length(rig)
        problem = f"with alpha {alpha:g} cv2.stereoRectify magnifies {magnification:.3g} times; another alpha may help"
        raise rig.fault(*culprit, problem)
    return {"left": (R1, P1), "right": (R2, P2)}


def _degenerate(rig, P1, P2):
    magnification = P1[0, 0] / _source_focal_length(rig)
    centres = np.abs([P1[:2, 2], P2[:2, 2]]).max()
    return not (1 / DEGENERATE < magnification < DEGENERATE and centres <= DEGENERATE * max(rig.width, rig.height))


def _rectify_equidistant(rig):
    """Rotations as cv2.stereoRectify; the focal length is the mean of the source's, the centre that of the image.

    cv2.fisheye.stereoRectify derives a focal length from the image corners, which tends to 0 on lenses near
    180 degrees.
    """
    R1, R2, _, _ = _stereo_rectify(rig, None, None, 0)
    f = _source_focal_length(rig)
    P1 = np.array([[f, 0, (rig.width - 1) / 2, 0], [0, f, (rig.height - 1) / 2, 0], [0, 0, 1, 0]])
    P2 = P1.copy()
    P2[0, 3] = f * (R2 @ rig.T)[0]
    return {"left": (R1, P1), "right": (R2, P2)}


def _source_focal_length(rig):
    return np.mean([camera.K[i, i] for camera in (rig.left, rig.right) for i in (0, 1)])


def _stereo_rectify(rig, D1, D2, alpha):
    """R1, R2, P1, P2."""
    size, T = (rig.width, rig.height), rig.T.reshape(3, 1)
    try:
        return cv2.stereoRectify(
            rig.left.K, D1, rig.right.K, D2, size, rig.R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha
        )[:4]
    except cv2.error as error:
        raise rig.fault(*_larger_turn(rig), f"cv2.stereoRectify refuses the rig: {error.err}") from None


def _larger_turn(rig):
    """Role and value of R or T, whichever turns the cameras further: the one to look at when a rectification fails."""
    angle = np.linalg.norm(cv2.Rodrigues(rig.R)[0]) / 2
    x, y, z = half_rotation(rig.R) @ rig.T
    return ("T", rig.T) if np.arctan2(np.hypot(y, z), -x) > angle else ("R", rig.R)


def _polynomial(x, y, D):
    """OpenCV's lens model on the normalised plane; x, y and D as in cv2.initUndistortRectifyMap.

    Source: OpenCV, calib3d, "Detailed Description"; the tilted sensor is that of Louhichi et al. 2007.
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = np.pad(D, (0, 14 - D.size))
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    radial = r2 * k3
    radial += k2
    radial *= r2
    radial += k1
    radial *= r2
    radial += 1
    if k4 or k5 or k6:
        radial /= 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    x = x * radial
    y = y * radial
    if p1 or p2:
        xy *= 2
        x += p1 * xy + p2 * (r2 + 2 * xx)
        y += p2 * xy + p1 * (r2 + 2 * yy)
    if s1 or s2 or s3 or s4:
        x += r2 * (s1 + s2 * r2)
        y += r2 * (s3 + s4 * r2)
    if tau_x or tau_y:
        tilt = _tilt(tau_x, tau_y)
        x, y, z = (row[0] * x + row[1] * y + row[2] for row in tilt)
        x /= z
        y /= z
    return x, y


def _tilt(tau_x, tau_y):
    """(3, 3): the projection onto an image sensor that is tilted by tau_x about x, then tau_y about y (rad)."""
    (sx, sy), (cx, cy) = np.sin([tau_x, tau_y]), np.cos([tau_x, tau_y])
    turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    return np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]]) @ turn


def _equidistant(x, y, D):
    """Kannala-Brandt, as cv2.fisheye: the image radius is theta (1 + k1 theta^2 + ... + k4 theta^8)."""
    k1, k2, k3, k4 = D
    r = np.hypot(x, y)
    theta = np.arctan(r)
    t2 = theta * theta
    scale = np.divide(theta, r, out=np.ones_like(r), where=r > 0)
    scale *= 1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))
    return x * scale, y * scale
