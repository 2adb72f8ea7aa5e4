"""What z = 1 costs as a camera is turned away from its rectified view: Eq. 6 against Eq. 3, in float64."""

from dataclasses import replace

import cv2
import numpy as np

from scripts.coordinate_errors import errors

AXES = {"x": "pitch", "y": "yaw", "z": "roll"}
MOST = 10.0  # degrees


def turned(view, axis, angle):
    """``view``, without the lens, with nothing but a rotation by ``angle``, degrees, about ``axis``."""
    vector = np.radians(angle) * (np.array(list(AXES)) == axis)
    return replace(view, R=cv2.Rodrigues(vector)[0], lens=False)


def approximation_error(view):
    """`errors` of Eq. 6 with z taken as 1 against Eq. 3, over the pixels whose source is in the image."""
    x, y = np.arange(view.width), np.arange(view.height)[:, None]
    linear = tuple(row[0] * x + row[1] * y + row[2] for row in view.homography[:2])
    return errors(linear, view.map(), view.inside)


def worst_mean(error):
    """The larger of the two axes' means in the paper's measure, px."""
    return max(axis["mean"] for axis in error["rounded"].values())


def crossing(view, axis, limit=1.0, tolerance=0.001):
    """The angle about ``axis``, degrees, from which on the mean error of z = 1 is ``limit`` px or more; None if it is
    below at `MOST` degrees.

    By bisection, within ``tolerance``; between 0 and `MOST` the mean rises with the angle.
    """

    def exceeds(angle):
        return worst_mean(approximation_error(turned(view, axis, angle))) >= limit

    low, high = 0.0, MOST
    if not exceeds(high):
        return None
    while high - low > tolerance:
        middle = (low + high) / 2
        low, high = (low, middle) if exceeds(middle) else (middle, high)
    return high
