"""Views to test with, at any small size: the embedded rig, and cameras that stand worse than real ones do."""

from functools import cache

import cv2
import numpy as np

from hdl import calibration
from hdl.calibration import Camera, Rig
from hdl.geometry.rectification import RectificationOptions, rectify

# Turn of the left camera (roll about the optical axis, pitch, yaw; degrees; the right one's is the opposite), focal
# length in widths, zoom of the rectified image, and how far it looks down, in heights.
_TURNED = {
    "rolled": ((9.0, 0.5, 0.5), 0.9, 1.0, 0.0),
    "toed_in": ((1.0, -6.0, 14.0), 0.7, 1.0, 0.0),
    "looks_up": ((0.4, 0.0, 0.3), 1.0, 1.0, -0.3),
    "looks_down": ((0.4, 0.0, 0.3), 1.0, 1.0, 0.3),
    "zoomed": ((1.5, -2.0, 3.0), 0.8, 1.5, 0.0),
}
NAMES = ("samples", "samples_whole", *_TURNED)
SIDES = ("left", "right")


@cache
def views(name, width, height):
    """The rectified views, left and right, of the rig called ``name``, without the lens.

    samples, samples_whole
        The embedded rig with alpha 0 and 1: cut to valid pixels, or shown to its corners. From 16x16 px on.
    rolled
        Output rows cross many source rows, upwards at one end and downwards at the other.
    toed_in
        The division by z matters: z goes from 0.75 to 1.2 over the frame.
    looks_up, looks_down
        Every source row lies above, below the output row.
    zoomed
        Every source is inside the source image.
    """
    if name.startswith("samples"):
        options = RectificationOptions(alpha=float(name == "samples_whole"))
        return rectify(calibration.embedded((width, height)), options, lens=False)
    angles, focal, zoom, down = _TURNED[name]
    turn = _rotation(*np.radians(angles))
    K = np.array([[focal * width, 0.0, 0.49 * width], [0.0, focal * width, 0.51 * height], [0.0, 0.0, 1.0]])
    P1 = np.hstack([K, np.zeros((3, 1))])
    P1[0, 0] *= zoom
    P1[1, 1] *= zoom
    P1[1, 2] -= down * height
    P2 = P1.copy()
    P2[0, 3] = -0.1 * P1[0, 0]
    camera = Camera("radtan", K, np.zeros(0))
    # x_rectified = turn x_left = turn^T x_right
    rig = Rig(
        name,
        width,
        height,
        camera,
        camera,
        turn @ turn,
        turn @ np.array([-0.1, 0.0, 0.0]),
        rectification={"left": (turn, P1), "right": (turn.T, P2)},
    )
    return rectify(rig, lens=False)


def view(name, side="left", width=24, height=18):
    """One of `views`."""
    return views(name, width, height)[side]


def matrix(view):
    """Eq. 2 as the paper has it: C = A R_rect^T A_rect^-1."""
    return view.camera.K @ view.R.T @ np.linalg.inv(view.P[:, :3])


def fits(q, values):
    """Whether the stored integers fit into the format `q`."""
    most = 2 ** (q.width - q.is_signed)
    return values.min() >= (-most if q.is_signed else 0) and values.max() < most


def _rotation(roll, pitch, yaw):
    return (
        cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
        @ cv2.Rodrigues(np.array([pitch, 0.0, 0.0]))[0]
        @ (cv2.Rodrigues(np.array([0.0, yaw, 0.0]))[0])
    )
