"""The double sphere: two unit spheres one behind the other, then a pinhole (Kalibr's and Basalt's ds).

Source: Usenko, Demmel and Cremers, The Double Sphere Camera Model, 3DV 2018.
"""

import numpy as np

from hdl.lens.base import LensModel


def distort(x, y, D):
    """The projection of (x, y, 1); NaN for rays that reach the second sphere where the pinhole does not see it.

    That is decided on the sphere itself, not by the paper's w2, which for xi < 0 lets a few more rays pass.
    """
    xi, alpha = D
    r2 = x * x + y * y
    z = xi * np.sqrt(r2 + 1) + 1
    second = np.sqrt(r2 + z * z)
    depth = alpha * second + (1 - alpha) * z
    if xi < 0:
        w1 = alpha / (1 - alpha) if alpha <= 0.5 else (1 - alpha) / alpha
        depth = np.where(z > -w1 * second, depth, np.nan)
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
