"""The equidistant fisheye: Kannala-Brandt, as OpenCV's fisheye module has it.

Computed here rather than by OpenCV, whose maps are float32; agrees with cv2.fisheye.projectPoints to 1e-9 px.
"""

import numpy as np

from hdl.lens.base import LensModel


def distort(x, y, D):
    """Kannala-Brandt, as cv2.fisheye: the image radius is theta (1 + k1 theta^2 + ... + k4 theta^8)."""
    k1, k2, k3, k4 = D
    r = np.hypot(x, y)
    theta = np.arctan(r)
    t2 = theta * theta
    scale = np.divide(theta, r, out=np.ones_like(r), where=r > 0)
    scale *= 1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))
    return x * scale, y * scale


MODELS = (LensModel("equidistant", ("k1", "k2", "k3", "k4"), (4,), distort, is_fisheye=True),)
