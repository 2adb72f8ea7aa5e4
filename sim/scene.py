"""Stereo pairs of a known scene, as any rig would photograph them.

The scene stands in the left camera's frame and is sized by the baseline and the field of view, so that every rig sees
the same room with similar disparities. Nothing here uses ``hdl``; the lenses are those of OpenCV.
"""

import numpy as np

from sim.lens import pixel_rays, unproject
from sim.lens_models import pinhole_matrix
from sim.reference import project
from sim.room import Room

_CHUNK = 1 << 14  # rays at a time, so that the temporaries stay in the cache
_DISPARITY = 0.055  # of the back wall, as a share of the image width
_WIDEST = 0.85  # tangent of the half field of view that the composition fills at most; fisheyes see past it
_TURN = (0.20, -0.15)  # of the room about y and x, as a share of the field of view: nothing is seen exactly head on
_SUBPIXELS = (np.arange(3) - 1) / 3


def render(rig, lens, bits=8, channels=1, seed=0):
    """Unrectified pair of the test scene.

    Parameters
    ----------
    rig
        Anything with ``width``, ``height``, ``left``, ``right`` (cameras as for :func:`sim.reference.project`), ``R``
        and ``T``, such as ``hdl.calibration.Rig``.
    lens : bool
        False photographs through pinholes with the same ``K``.
    bits : int
        8 to 16; full scale is 2^bits - 1.
    channels : int
        1 or 3 (blue, green, red).
    seed : int
        Varies the textures.

    Returns
    -------
    {"left": image, "right": image}
        (height, width) or (height, width, 3), uint8 for 8 bits, else uint16. Black where the lens model has no ray.
    """
    if not 8 <= bits <= 16:
        raise ValueError(f"bits = {bits}: must be 8 to 16")
    if channels not in (1, 3):
        raise ValueError(f"channels = {channels}: must be 1 or 3")
    stage = _Stage(rig, lens, channels, seed)
    return {side: _quantised(stage.photograph(side), bits) for side in ("left", "right")}


def visible_points(rig, lens, n, seed=0):
    """Points of the scene that both cameras see, and where.

    Returns
    -------
    X : (n, 3) float64
        In the left camera's frame, in the rig's unit.
    {"left": (n, 2), "right": (n, 2)} float64
        Their exact source positions, px, all inside the images.

    Raises
    ------
    ValueError
        When the two cameras hardly see anything in common.
    """
    stage = _Stage(rig, lens, 1, seed)
    rng = np.random.default_rng(seed)
    found, total = [], 0
    for _ in range(20):
        points = stage.sample(rng, 2 * n + 16)
        found.append(points)
        total += len(points)
        if total >= n:
            break
    else:
        raise ValueError(f"{rig.source}: the cameras hardly see anything in common")
    X = np.concatenate(found)[:n]
    return X, {side: stage.position(side, X) for side in ("left", "right")}


class _Stage:
    """The room, placed in front of a rig."""

    def __init__(self, rig, lens, channels, seed):
        self.rig, self.lens = rig, lens
        self.cameras = {"left": rig.left, "right": rig.right}
        R, T = np.asarray(rig.R, np.float64), np.asarray(rig.T, np.float64).reshape(3)
        tx, ty = self._field(rig.left)
        self.scale = np.linalg.norm(T) / (2 * tx * _DISPARITY)
        turn, tilt = _TURN[0] * tx, _TURN[1] * ty
        about_y = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
        self.to_room = about_x @ about_y
        # Camera frame -> room frame, and the optical centre in the room.
        self.rotation = {"left": self.to_room, "right": self.to_room @ R.T}
        self.centre = {"left": np.zeros(3), "right": -self.to_room @ R.T @ T / self.scale}
        self.pose = {"left": (np.eye(3), np.zeros(3)), "right": (R, T)}
        focal = np.sqrt(abs(np.linalg.det(pinhole_matrix(rig.left)[:2, :2])))
        self.room = Room(tx, ty, 1 / focal, channels, seed)

    def _field(self, camera):
        w, h = self.rig.width - 1, self.rig.height - 1
        rays = unproject(camera, [[0, h / 2], [w, h / 2], [w / 2, 0], [w / 2, h]], self.lens)
        reach = np.tan(np.minimum(np.arccos(rays[:, 2]), np.arctan(_WIDEST)))
        reach = np.where(np.isnan(reach), _WIDEST, reach)
        return reach[:2].min(), reach[2:].min()

    def photograph(self, side):
        rig, camera, room, centre = self.rig, self.cameras[side], self.room, self.centre[side]
        rays = pixel_rays(camera, rig.width, rig.height, self.lens)
        turned = (rays @ self.rotation[side].T).reshape(-1, 3)
        image = np.zeros((len(turned), room.channels))
        label = np.full(len(turned), -1)
        for part in _chunks(len(turned)):
            lit = part[~np.isnan(turned[part, 0])]
            distance, index = room.trace(centre, turned[lit])
            points = centre + distance[:, None] * turned[lit]
            image[lit] = room.shade(points, index)
            label[lit] = room.label(points, index)
        outline = np.flatnonzero(_outline(label.reshape(rig.height, rig.width)))
        for part in _chunks(len(outline), _SUBPIXELS.size**2):
            image[outline[part]] = self._supersampled(side, outline[part], rays.reshape(-1, 3))
        return image.reshape(rig.height, rig.width, room.channels)

    def _supersampled(self, side, pixels, rays):
        offsets = np.stack(np.meshgrid(_SUBPIXELS, _SUBPIXELS), axis=-1).reshape(-1, 1, 2)
        positions = np.stack([pixels % self.rig.width, pixels // self.rig.width], axis=-1) + offsets
        start = np.broadcast_to(rays[pixels], positions.shape[:2] + (3,))
        found = unproject(self.cameras[side], positions, self.lens, start)
        turned = np.where(np.isnan(found), start, found).reshape(-1, 3) @ self.rotation[side].T
        distance, index = self.room.trace(self.centre[side], turned)
        colours = self.room.shade(self.centre[side] + distance[:, None] * turned, index)
        return colours.reshape(len(offsets), len(pixels), -1).mean(axis=0)

    def sample(self, rng, count):
        rig = self.rig
        pixels = rng.uniform([0, 0], [rig.width - 1, rig.height - 1], (count, 2))
        rays = unproject(rig.left, pixels, self.lens) @ self.rotation["left"].T
        rays = rays[~np.isnan(rays[:, 0])]
        distance, index = self.room.trace(self.centre["left"], rays)
        points = distance[:, None] * rays
        sight = points - self.centre["right"]
        range_ = np.linalg.norm(sight, axis=1)
        first, _ = self.room.trace(self.centre["right"], sight / range_[:, None])
        X = points[np.abs(first - range_) < 1e-9] @ self.to_room * self.scale
        inside = np.ones(len(X), bool)
        for side in ("left", "right"):
            at = self.position(side, X)
            inside &= ((at >= 0) & (at <= [rig.width - 1, rig.height - 1])).all(axis=1)
        return X[inside]

    def position(self, side, X):
        R, T = self.pose[side]
        return project(self.cameras[side], X @ R.T + T, self.lens)


def _outline(label):
    """Pixels next to another surface."""
    edge = np.zeros(label.shape, bool)
    across, down = label[:, 1:] != label[:, :-1], label[1:] != label[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return edge & (label >= 0)


def _chunks(count, per=1):
    step = max(1, _CHUNK // per)
    return [np.arange(first, min(first + step, count)) for first in range(0, count, step)]


def _quantised(image, bits):
    levels = np.rint(image * ((1 << bits) - 1)).astype(np.uint8 if bits == 8 else np.uint16)
    return levels[..., 0] if levels.shape[2] == 1 else levels
