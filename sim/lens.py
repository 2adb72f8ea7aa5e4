"""Viewing rays of source pixels: the lens models inverted.

``sim.reference.project`` asks OpenCV for the forward direction, one point after another, which is too slow for whole
images; so the standard model is written out a second time, with its derivatives. The tests hold the two together.
"""

import numpy as np
from numpy.polynomial import Polynomial

from sim.lens_models import LENS_MODELS, pinhole_matrix, polar_rays

_CHUNK = 1 << 14  # points at a time, so that the temporaries stay in the cache
_STEPS = 4  # from the principal point out to a pixel, when no start is known
_CELLS = 80  # of the grid that starts the pixels of an image, along its longer side


def unproject(camera, points, lens, start=None):
    """Unit viewing rays of image positions.

    Parameters
    ----------
    camera, lens
        As for :func:`sim.reference.project`.
    points : (..., 2)
        px; may lie outside the image.
    start : (..., 3) or None
        Rays of positions near by, from which the search starts.

    Returns
    -------
    (..., 3) float64
        In the camera's frame. NaN where no ray leads to the position, because the lens model folds back before it
        gets there. The positions of the others agree to 1e-9 px. Rays of a fisheye may point backwards.
    """
    points = np.asarray(points, np.float64)
    K = np.asarray(camera.K, np.float64) if lens else pinhole_matrix(camera)
    coefficients = np.asarray(camera.D, np.float64).reshape(-1)
    plane = np.linalg.solve(K[:2, :2], (points.reshape(-1, 2) - K[:2, 2]).T).T
    if lens and camera.model == "equidistant":
        rays = _equidistant_rays(coefficients, plane)
    elif lens and camera.model in LENS_MODELS:
        if camera.model == "mei":
            sphere = LENS_MODELS["mei"].project  # without coefficients but xi
            known = None if start is None else sphere(coefficients[:1], np.reshape(start, (-1, 3)))
            plane = _undistorted(coefficients[1:], plane, known)
        rays = LENS_MODELS[camera.model].rays(coefficients, plane)
    else:
        if lens:
            known = None if start is None else (start[..., :2] / start[..., 2:]).reshape(-1, 2)
            plane = _undistorted(coefficients, plane, known)
        rays = np.column_stack([plane, np.ones(len(plane))])
    rays /= np.sqrt(np.einsum("ij,ij->i", rays, rays))[:, None]
    return rays.reshape(points.shape[:-1] + (3,))


def pixel_rays(camera, width, height, lens):
    """:func:`unproject` of every pixel of an image: (height, width, 3)."""
    cell = max(width, height) / _CELLS
    columns, rows = (np.linspace(0, n - 1, max(2, int(np.ceil(n / cell)))) for n in (width, height))
    coarse = unproject(camera, np.stack(np.meshgrid(columns, rows), axis=-1), lens)
    x, y = np.arange(width), np.arange(height)
    start = None
    if not np.isnan(coarse).any():
        start = _resampled(_resampled(coarse, rows, y, axis=0), columns, x, axis=1)
    return unproject(camera, np.stack(np.meshgrid(x, y), axis=-1), lens, start)


def _resampled(values, nodes, x, axis):
    """Linear interpolation at x of values at evenly spaced nodes."""
    position = (x - nodes[0]) / (nodes[1] - nodes[0])
    first = np.minimum(position.astype(int), len(nodes) - 2)
    weight = np.expand_dims(position - first, tuple(k for k in range(values.ndim) if k != axis))
    return values.take(first, axis) * (1 - weight) + values.take(first + 1, axis) * weight


def _undistorted(coefficients, target, start):
    k = np.pad(coefficients, (0, 14 - coefficients.size))
    target = _untilted(k[12], k[13], target)
    result = np.empty_like(target)
    for first in range(0, len(target), _CHUNK):
        part = slice(first, first + _CHUNK)
        if start is not None:
            result[part] = _newton(k, target[part], start[part])
            continue
        # Newton's method from the solution for a point further in keeps to the branch that holds the centre.
        plane = target[part] / _STEPS
        for step in range(1, _STEPS + 1):
            plane = _newton(k, target[part] * (step / _STEPS), plane)
        result[part] = plane
    return result


def _newton(k, target, start):
    """Solve _distort(x) = target; NaN where the Jacobian stops being positive on the way: the branch has ended."""
    solution = np.full_like(target, np.nan)
    x, y = start.T.copy()
    u, v = target.T
    active = np.arange(len(target))
    for _ in range(50):
        value_x, value_y, xx, xy, yx, yy = _distort(k, x, y)
        determinant = xx * yy - xy * yx
        with np.errstate(divide="ignore", invalid="ignore"):
            value_x, value_y = (value_x - u) / determinant, (value_y - v) / determinant
        dx, dy = yy * value_x - xy * value_y, xx * value_y - yx * value_x
        x, y = x - dx, y - dy
        alive = determinant > 1e-9
        done = alive & (dx * dx + dy * dy < 1e-24)
        solution[active[done], 0], solution[active[done], 1] = x[done], y[done]
        keep = alive & ~done
        if not keep.any():
            break
        if not keep.all():
            active, x, y, u, v = active[keep], x[keep], y[keep], u[keep], v[keep]
    return solution


def _distort(k, x, y):
    """OpenCV's standard model without tilt, and its derivatives: x', y', dx'/dx, dx'/dy, dy'/dx, dy'/dy."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = k[:12]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2 * k2 + 3 * k3 * r2)
    if k4 or k5 or k6:
        denominator = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        slope = (slope - radial / denominator * (k4 + r2 * (2 * k5 + 3 * k6 * r2))) / denominator
        radial = radial / denominator
    tangential = 2 * (p1 * y + p2 * x)
    diagonal = radial + tangential
    cross = 2 * (slope * x * y + p1 * x + p2 * y)
    xx = diagonal + 2 * x * (slope * x + 2 * p2)
    yy = diagonal + 2 * y * (slope * y + 2 * p1)
    xy, yx = cross, cross
    distorted_x = x * diagonal + p2 * r2
    distorted_y = y * diagonal + p1 * r2
    if s1 or s2 or s3 or s4:
        distorted_x, distorted_y = distorted_x + r2 * (s1 + s2 * r2), distorted_y + r2 * (s3 + s4 * r2)
        bend_x, bend_y = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
        xx, xy, yx, yy = xx + x * bend_x, xy + y * bend_x, yx + x * bend_y, yy + y * bend_y
    return distorted_x, distorted_y, xx, xy, yx, yy


def _untilted(tau_x, tau_y, plane):
    """Undo the tilt of the sensor, the last stage of OpenCV's model (a homography)."""
    if not (tau_x or tau_y):
        return plane
    about_x = np.array([[1, 0, 0], [0, np.cos(tau_x), np.sin(tau_x)], [0, -np.sin(tau_x), np.cos(tau_x)]])
    about_y = np.array([[np.cos(tau_y), 0, -np.sin(tau_y)], [0, 1, 0], [np.sin(tau_y), 0, np.cos(tau_y)]])
    rotation = about_y @ about_x
    onto_plane = np.array([[rotation[2, 2], 0, -rotation[0, 2]], [0, rotation[2, 2], -rotation[1, 2]], [0, 0, 1]])
    flat = np.linalg.solve(onto_plane @ rotation, np.column_stack([plane, np.ones(len(plane))]).T)
    return (flat[:2] / flat[2]).T


def _equidistant_rays(coefficients, plane):
    """Rays for r = theta (1 + k1 theta^2 + k2 theta^4 + ...)."""
    terms = np.zeros(2 * coefficients.size + 2)
    terms[1], terms[3::2] = 1, coefficients
    return polar_rays(Polynomial(terms), plane)
