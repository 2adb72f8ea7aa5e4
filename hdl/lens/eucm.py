"""The extended unified camera model: an ellipsoid, then a pinhole (Kalibr's and Basalt's eucm).

With beta = 1 it is the unified camera model in Basalt's form (ucm).
Source: Khomutenko, Garcia and Martinet, An Enhanced Unified Camera Model, RA-L 1(1), 2016.
"""

import numpy as np

from hdl.lens.base import LensModel


def distort(x, y, D):
    """The projection of (x, y, 1), which is defined for all of them."""
    alpha, beta = D
    depth = alpha * np.sqrt(beta * (x * x + y * y) + 1) + (1 - alpha)
    return x / depth, y / depth


MODELS = (
    LensModel(
        "eucm",
        ("alpha", "beta"),
        (2,),
        distort,
        is_fisheye=True,
        limits={"alpha": (0, 1), "beta": (0, 100)},
    ),
)
