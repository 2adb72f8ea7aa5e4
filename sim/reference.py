"""Float64 reference for coordinates, independent of ``hdl``.

The lens comes from OpenCV (projectPoints) or, where it has none, from `sim.lens_models`; the equations come from the
paper as printed, with its misprints corrected.
A ``camera`` is anything with ``model``, ``K`` and ``D``; a ``view`` anything with ``camera``, ``R``, ``P``, ``width``,
``height`` and ``lens``, such as ``hdl.geometry.rectification.View``.
"""

import cv2
import numpy as np

from sim.lens_models import LENS_MODELS, pinhole_matrix


def project(camera, points, lens):
    """Image positions of points in space.

    Parameters
    ----------
    camera
        ``model`` "equidistant" is OpenCV's fisheye model, those of `sim.lens_models` are theirs, any other name is
        OpenCV's standard one; ``K`` may have skew.
    points : (..., 3)
        In the camera's frame, any unit.
    lens : bool
        False leaves ``D`` out: the plain pinhole that shows the same next to the optical axis, which has the camera's
        ``K`` but for the models that magnify there.

    Returns
    -------
    (..., 2) float64
        px, pixel centres at integers; NaN for points that are not in front of the camera (z <= 0).
    """
    points = np.asarray(points, np.float64)
    flat = points.reshape(-1, 3)
    front = flat[:, 2] > 0
    plane = np.full((len(flat), 2), np.nan)
    if front.any():
        plane[front] = _distorted(camera, flat[front], lens)
    # OpenCV's standard model ignores the skew of K, so the lens is asked for with K = I and K is applied here.
    K = np.asarray(camera.K, np.float64) if lens else pinhole_matrix(camera)
    pixels = plane @ K[:2, :2].T + K[:2, 2]
    return pixels.reshape(points.shape[:-1] + (2,))


def source_positions(view, x, y):
    """Source position of rectified positions: the ray R^T P^-1 [x y 1], seen through the camera.

    Parameters
    ----------
    x, y : arrays of one shape, or scalars
        Rectified px, fractions allowed.

    Returns
    -------
    u, v : float64 arrays of that shape
        Source px; NaN for rays that do not enter the camera from its front.
    """
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    rays = np.linalg.solve(np.asarray(view.P)[:, :3] @ view.R, np.stack([x, y, np.ones_like(x)]).reshape(3, -1))
    pixels = project(view.camera, rays.T, view.lens)
    return pixels[:, 0].reshape(x.shape), pixels[:, 1].reshape(x.shape)


def coordinate_map(view):
    """:func:`source_positions` of every rectified pixel: u, v, each (height, width) float64, px."""
    return source_positions(view, *_raster(view.width, view.height))


def projective(C, width, height):
    """Eq. 3 with its division: source coordinates of every rectified pixel, lens left out.

    Parameters
    ----------
    C : (3, 3)
        Eq. 2, ``A R_rect^T A_rect^-1``.

    Returns
    -------
    u, v : (height, width) float64, px
    """
    x, y, z = _homogeneous(C, width, height)
    return x / z, y / z


def proposed(C, width, height):
    """Eq. 6: the same with z taken as 1. u, v: (height, width) float64, px."""
    x, y, _ = _homogeneous(C, width, height)
    return x, y


def _homogeneous(C, width, height):
    x, y = _raster(width, height)
    return tuple(row[0] * x + row[1] * y + row[2] for row in np.asarray(C, np.float64))


def _raster(width, height):
    return np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))


def _distorted(camera, points, lens):
    if not lens:
        return points[:, :2] / points[:, 2:]
    coefficients = np.asarray(camera.D, np.float64).reshape(-1)
    if camera.model in LENS_MODELS:
        return LENS_MODELS[camera.model].project(coefficients, points)
    fisheye = camera.model == "equidistant"
    accepted = (4,) if fisheye else (4, 5, 8, 12, 14)
    count = next(n for n in accepted if n >= coefficients.size)
    coefficients = np.pad(coefficients, (0, count - coefficients.size))
    function = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    projected, _ = function(points[:, None], np.zeros(3), np.zeros(3), np.eye(3), coefficients)
    return projected.reshape(-1, 2)
