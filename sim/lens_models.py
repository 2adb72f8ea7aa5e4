"""The lens models that OpenCV's Python package does not have, as their papers draw them: points and rays in space.

Nothing here comes from `hdl.lens`, which has formulas on the normalised plane.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.polynomial import Polynomial


@dataclass(frozen=True)
class LensModel:
    """
    Members
    -------
    project : callable
        D and points (n, 3) to (n, 2): their positions on the image plane, to which K is still to be applied; NaN
        where the model has none.
    rays : callable
        D and positions (n, 2) on the image plane to the rays (n, 3) that lead there, of any length; NaN where none
        does.
    magnification : callable
        D to the radius on the image plane per angle of the ray, next to the optical axis.
    """

    project: Callable
    rays: Callable
    magnification: Callable


def _sphere(points):
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _along_z(amount):
    return np.array([0.0, 0.0, amount])


def _seen_from(points, shift):
    """Perspective image of points by a pinhole that stands ``shift`` behind the origin."""
    depth = points[:, 2:] + shift
    return np.where(depth > 0, points[:, :2] / np.where(depth > 0, depth, 1), np.nan)


def _onto_sphere(plane, shift):
    """Back again: the points of the unit sphere that such a pinhole sees at ``plane``; NaN where it sees none."""
    direction = np.column_stack([plane, np.ones(len(plane))])
    square, along = (direction**2).sum(axis=1), shift
    with np.errstate(invalid="ignore"):
        length = (along + np.sqrt(along**2 + square * (1 - shift**2))) / square
    return length[:, None] * direction - _along_z(shift)


def _double_sphere(D, points):
    """Usenko et al. 2018: from one unit sphere onto another one, xi behind it, and from there through a pinhole."""
    xi, alpha = D
    first = _sphere(points)
    second = _sphere(first + _along_z(xi))
    if alpha == 1:
        return np.where(second[:, 2:] > 0, second[:, :2], np.nan)  # the pinhole is infinitely far away
    behind = alpha / (1 - alpha)
    seen = second[:, 2:] > -min(behind, 1 / behind if behind else np.inf)
    return np.where(seen, _seen_from(second, behind), np.nan) / (1 - alpha)


def _double_sphere_rays(D, plane):
    xi, alpha = D
    if alpha == 1:
        with np.errstate(invalid="ignore"):
            second = np.column_stack([plane, np.sqrt(1 - (plane**2).sum(axis=1))])
    else:
        second = _onto_sphere(plane * (1 - alpha), alpha / (1 - alpha))
    # The point of the first sphere that is seen along `second` from xi behind its centre.
    with np.errstate(invalid="ignore"):
        length = xi * second[:, 2] + np.sqrt(1 - xi**2 * (1 - second[:, 2] ** 2))
    return length[:, None] * second - _along_z(xi)


def _extended_unified(D, points):
    """Khomutenko et al. 2016: onto the ellipsoid beta (x^2 + y^2) + z^2 = 1, then a mixture of pinhole and
    orthographic projection."""
    alpha, beta = D
    surface = points / np.sqrt(beta * (points[:, :2] ** 2).sum(axis=1) + points[:, 2] ** 2)[:, None]
    depth = alpha + (1 - alpha) * surface[:, 2:]
    return np.where(depth > 0, surface[:, :2] / np.where(depth > 0, depth, 1), np.nan)


def _extended_unified_rays(D, plane):
    """The point of the ellipsoid is d (x, y) and z with d = alpha + (1 - alpha) z: a quadratic equation in z."""
    alpha, beta = D
    q = beta * (plane**2).sum(axis=1)
    a, b, c = 1 + q * (1 - alpha) ** 2, q * alpha * (1 - alpha), q * alpha**2 - 1
    with np.errstate(invalid="ignore"):
        z = (-b + np.sqrt(b * b - a * c)) / a
    return np.column_stack([(alpha + (1 - alpha) * z)[:, None] * plane, z])


def _unified(D, points):
    """Mei and Rives 2007: the unit sphere, a pinhole xi behind its centre, and cv2's radial and tangential terms."""
    plane = _seen_from(_sphere(points), D[0])
    known = ~np.isnan(plane[:, 0])
    if known.any():
        space = np.column_stack([plane[known], np.ones(known.sum())])[:, None]
        distorted, _ = cv2.projectPoints(space, np.zeros(3), np.zeros(3), np.eye(3), np.resize([*D[1:], 0], 4))
        plane[known] = distorted.reshape(-1, 2)
    return plane


def _unified_rays(D, plane):
    """Of positions without the radial and tangential terms."""
    return _onto_sphere(plane, D[0])


def _field_of_view(D, points):
    """Devernay and Faugeras 2001: w is the field of view that an ideal lens of this kind has between radii of 1/2."""
    (w,) = D
    across = np.linalg.norm(points[:, :2], axis=1)
    if w == 0:
        radius = across / points[:, 2]
    else:
        radius = np.arctan2(across * 2 * np.tan(w / 2), points[:, 2]) / w
    return points[:, :2] * (radius / np.where(across > 0, across, 1))[:, None]


def _field_of_view_rays(D, plane):
    (w,) = D
    if w == 0:
        return np.column_stack([plane, np.ones(len(plane))])
    radius = np.linalg.norm(plane, axis=1)
    angle = np.where(radius * w < np.pi, radius * w, np.nan)
    across = np.sin(angle) / (2 * np.tan(w / 2))
    return np.column_stack([plane * (across / np.where(radius > 0, radius, 1))[:, None], np.cos(angle)])


def polar_rays(radius_of_angle, plane):
    """Rays whose angle from the optical axis is sent to a radius on ``plane`` by a polynomial, up to the polynomial's
    first maximum or 180 degrees; NaN beyond it."""
    slope = radius_of_angle.deriv()
    turns = [root.real for root in slope.roots() if abs(root.imag) < 1e-9 and 0 < root.real < np.pi]
    angles = np.linspace(0, min(turns, default=np.pi), 1024)
    radius = np.hypot(plane[:, 0], plane[:, 1])
    theta = np.interp(radius, radius_of_angle(angles), angles, right=np.nan)
    for _ in range(3):
        theta = theta - (radius_of_angle(theta) - radius) / slope(theta)
    direction = plane / np.where(radius > 0, radius, 1)[:, None]
    return np.column_stack([np.sin(theta)[:, None] * direction, np.cos(theta)])


def _of_angle(D):
    """Radius, on the plane that K scales, by the angle from the optical axis. OCamCalib counts it from the image plane,
    backwards."""
    in_pixels = Polynomial(D[3:])(Polynomial([-np.pi / 2, 1]))
    return in_pixels / in_pixels.deriv()(0)


def _affine(D):
    c, d, e = D[:3]
    return np.array([[c, d], [e, 1]])


def _scaramuzza(D, points):
    """OCamCalib's world2cam."""
    across = np.linalg.norm(points[:, :2], axis=1)
    radius = _of_angle(D)(np.arctan2(across, points[:, 2]))
    return points[:, :2] * np.where(across > 0, radius / np.where(across > 0, across, 1), 0)[:, None] @ _affine(D).T


def _scaramuzza_rays(D, plane):
    return polar_rays(_of_angle(D), np.linalg.solve(_affine(D), plane.T).T)


LENS_MODELS = {
    "double_sphere": LensModel(_double_sphere, _double_sphere_rays, lambda D: 1 / (1 + D[0])),
    "eucm": LensModel(_extended_unified, _extended_unified_rays, lambda D: 1.0),
    "mei": LensModel(_unified, _unified_rays, lambda D: 1 / (1 + D[0])),
    "fov": LensModel(_field_of_view, _field_of_view_rays, lambda D: np.tan(D[0] / 2) / (D[0] / 2) if D[0] else 1.0),
    "scaramuzza": LensModel(_scaramuzza, _scaramuzza_rays, lambda D: 1.0),
}


def pinhole_matrix(camera):
    """(3, 3): K of the camera without its lens, which shows the same next to the optical axis."""
    K = np.array(camera.K, np.float64)
    if camera.model in LENS_MODELS:
        K[:2, :2] *= LENS_MODELS[camera.model].magnification(np.asarray(camera.D, np.float64))
    return K
