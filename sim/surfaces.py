"""Boxes and balls: where rays meet them, and the coordinates to paint them in."""

from dataclasses import dataclass

import numpy as np


def dot(a, b):
    """Scalar products along the last axis of arrays (..., 3)."""
    return np.einsum("...i,...i->...", a, b)


@dataclass
class Patch:
    """Points on one surface, in the terms a skin needs; arrays of one length n.

    Members
    -------
    face : int
        Box: 0..5 for -x, +x, -y, +y, -z, +z. Ball: 0.
    s, t : surface coordinates, t downwards on upright faces
    ws, wt : width of the footprint that a pixel of the left camera has there, along s and t
    """

    face: np.ndarray
    s: np.ndarray
    t: np.ndarray
    ws: np.ndarray
    wt: np.ndarray

    def select(self, chosen):
        return Patch(*(getattr(self, name)[chosen] for name in ("face", "s", "t", "ws", "wt")))


class Box:
    """A box, seen from outside, or from ``inside``.

    Parameters
    ----------
    centre, half : (3,)
        Position and half extents.
    skin
        Called with a Patch, returns the surface's reflectance.
    yaw, pitch : float
        Rotation about y and then about the box's own x axis, radians.
    """

    def __init__(self, centre, half, skin, *, yaw=0.0, pitch=0.0, inside=False):
        self.centre, self.half = np.asarray(centre, float), np.asarray(half, float)
        self.skin, self.inside = skin, inside
        about_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
        about_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
        self.axes = about_y @ about_x
        self.radius = np.linalg.norm(self.half)

    def span(self, origin, rays):
        """Distances at which rays enter and leave; without a hit the first is not below the second."""
        start = (origin - self.centre) @ self.axes
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / (rays @ self.axes)
            middle, reach = -start * inverse, self.half * np.abs(inverse)
        enter, leave = middle - reach, middle + reach
        return (
            np.maximum(np.maximum(enter[:, 0], enter[:, 1]), enter[:, 2]),
            np.minimum(np.minimum(leave[:, 0], leave[:, 1]), leave[:, 2]),
        )

    def hit(self, origin, rays):
        """Distance to the surface, inf without a hit."""
        enter, leave = self.span(origin, rays)
        if self.inside:
            return leave
        return np.where((enter < leave) & (enter > 0), enter, np.inf)

    def face(self, points):
        local = (points - self.centre) @ self.axes / self.half
        axis = np.argmax(np.abs(local), axis=1)
        return 2 * axis + (local[np.arange(len(local)), axis] > 0)

    def normal(self, points):
        face = self.face(points)
        sign = np.where(face % 2, 1.0, -1.0) * (-1 if self.inside else 1)
        return self.axes.T[face // 2] * sign[:, None]

    def patch(self, points, eye, pixel):
        """Surface coordinates; ``pixel`` is the angle of a pixel for a camera at ``eye``."""
        face = self.face(points)
        local, seen = (points - self.centre) @ self.axes, (points - eye) @ self.axes
        rows = np.arange(len(points))
        normal, across, down = (np.array(k)[face // 2] for k in ([0, 1, 2], [2, 0, 0], [1, 2, 1]))
        width = pixel * np.sqrt(dot(seen, seen))
        depth = np.maximum(np.abs(seen[rows, normal]), 1e-9)
        ws, wt = (width * np.hypot(1, seen[rows, k] / depth) for k in (across, down))
        return Patch(face, local[rows, across], local[rows, down], ws, wt)


class Ball:
    """A ball; s is the longitude and t the latitude of its surface, in radians, about an axis leaning by ``lean``."""

    def __init__(self, centre, radius, skin, *, lean=0.0):
        self.centre, self.radius, self.skin = np.asarray(centre, float), radius, skin
        self.axes = np.array([[np.cos(lean), -np.sin(lean), 0], [np.sin(lean), np.cos(lean), 0], [0, 0, 1]])

    def span(self, origin, rays):
        """As for a box."""
        to_centre = self.centre - origin
        along = dot(rays, to_centre)
        chord = self.radius**2 - dot(to_centre, to_centre) + along**2
        half = np.sqrt(np.maximum(chord, 0))
        return along - half, along + half

    def hit(self, origin, rays):
        enter, leave = self.span(origin, rays)
        return np.where((enter < leave) & (enter > 0), enter, np.inf)

    def face(self, points):
        return np.zeros(len(points), np.int64)

    def normal(self, points):
        return (points - self.centre) / self.radius

    def patch(self, points, eye, pixel):
        local = (points - self.centre) @ self.axes / self.radius
        seen = points - eye
        distance = np.sqrt(dot(seen, seen))
        facing = np.maximum(-dot(seen, self.normal(points)) / distance, 0.05)
        wt = pixel * distance / self.radius / facing
        ring = np.maximum(np.hypot(local[:, 0], local[:, 2]), 1e-3)
        longitude, latitude = np.arctan2(local[:, 0], -local[:, 2]), np.arcsin(np.clip(local[:, 1], -1, 1))
        return Patch(self.face(points), longitude, latitude, wt / ring, wt)
