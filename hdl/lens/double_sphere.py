"""The double sphere: two unit spheres one behind the other, then a pinhole (Kalibr's and Basalt's ds).

Source: Usenko, Demmel and Cremers, The Double Sphere Camera Model, 3DV 2018, Eq. 40 to 45.
"""

import numpy as np

from hdl.lens.base import LensModel


def distort(x, y, D):
    """The projection of (x, y, 1) by Eq. 40 to 42; NaN beyond the rays of Eq. 43."""
    xi, alpha = D
    r2 = x * x + y * y
    first = np.sqrt(r2 + 1)
    z = xi * first + 1
    depth = alpha * np.sqrt(r2 + z * z) + (1 - alpha) * z
    w1 = alpha / (1 - alpha) if alpha <= 0.5 else (1 - alpha) / alpha
    w2 = (w1 + xi) / np.sqrt(2 * w1 * xi + xi * xi + 1)
    if w2 < 0:
        depth[-w2 * first >= 1] = np.nan
    return x / depth, y / depth


MODELS = (
    LensModel(
        "double_sphere",
        ("xi", "alpha"),
        (2,),
        distort,
        is_fisheye=True,
        magnification=lambda D: 1 / (1 + D[0]),
        limits={"xi": (-0.99, 10), "alpha": (0, 1)},
    ),
)
