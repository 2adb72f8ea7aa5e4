"""Rigs whose cameras stand in unusual ways, from where each stands; and what turning a camera's images does to them."""

from dataclasses import replace

import cv2
import numpy as np

from hdl.calibration import Camera, Rig, convert

SIZE = 160, 120
LENSES = [-0.21, 0.09, 0.0004, -0.0002, -0.01], [-0.2, 0.08, 0.0003, 0.0001, -0.008]


def rotation(*degrees):
    return cv2.Rodrigues(np.radians(np.array(degrees, dtype=float)))[0]


def standing(left=(0, 0, 0), right=(0.3, 0.4, -0.5), at=(0.11, 0.002, 0.001), size=SIZE, lens=True):
    """The rig of two cameras, the left one at the origin and the right one ``at`` a place, m.

    x points to the right of someone who looks along z, y down. ``left`` and ``right`` turn each camera (rotation
    vector, degrees): by (0, 0, 90) its upper side points right.
    """
    width, height = size
    cameras = []
    for index, D in enumerate(LENSES):
        K = np.array([[0.8 * width, 0, 0.498 * width + index], [0, 0.81 * width, 0.503 * height - index], [0, 0, 1]])
        cameras.append(Camera("radtan", K, np.array(D) if lens else np.zeros(0)))
    to_left, to_right = (rotation(*turn).T for turn in (left, right))
    R, T = to_right @ to_left.T, -to_right @ np.array(at, dtype=float)
    return Rig("rig.yml", *size, *cameras, R, T, unit="m")


def images_turned(rig, side, quarters):
    """The rig whose ``side`` camera's images are turned clockwise by so many quarters; square images for an odd one."""
    camera = rig.camera(side)
    (fx, _, cx), (_, fy, cy), _ = camera.K
    width, height = camera.size
    k1, k2, p1, p2, k3 = camera.D
    turn = rotation(0, 0, 90)  # clockwise in an image, as y points down
    for _ in range(quarters % 4):
        fx, fy, cx, cy, p1, p2 = fy, fx, height - 1 - cy, cx, p2, -p1
        width, height = height, width
    turn = np.linalg.matrix_power(turn, quarters % 4)
    new = replace(camera, K=np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), D=np.array([k1, k2, p1, p2, k3]))
    if side == "left":
        return replace(rig, left=new, R=rig.R @ turn.T)
    return replace(rig, right=new, R=turn @ rig.R, T=turn @ rig.T)


def pixels_turned(pixels, size, quarters):
    """Where pixels (n, 2) of images of ``size`` lie in the images turned clockwise by so many quarters."""
    width, height = size
    for _ in range(quarters % 4):
        pixels = np.column_stack([height - 1 - pixels[:, 1], pixels[:, 0]])
        width, height = height, width
    return pixels


def write(rig, path="rig.yml", rectification=None):
    """The rig in OpenCV's format, and where it is."""
    with open(path, "w") as file:
        file.write(convert.to_opencv(rig, rectification))
    return path
