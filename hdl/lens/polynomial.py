"""OpenCV's polynomial lens: radial and tangential terms, a rational radial one, thin prism, tilted sensor.

Computed here rather than by OpenCV, whose maps are float32; agrees with cv2.projectPoints to 1e-9 px.
"""

import numpy as np

from hdl.lens.base import LensModel

COEFFICIENTS = tuple("k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y".split())
COUNTS = (0, 4, 5, 8, 12, 14)
NAMES = ("radtan", "rational", "thin_prism", "tilted")  # the same formula, ever more of its terms in use


def distort(x, y, D):
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


MODELS = tuple(LensModel(name, COEFFICIENTS, COUNTS, distort) for name in NAMES)
