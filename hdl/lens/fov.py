"""The FOV model: the image radius grows with the angle, by one coefficient (Kalibr's fov; ATAN in PTAM).

Source: Devernay and Faugeras, Straight lines have to be straight,
Machine Vision and Applications 13, 2001, the FOV model.
"""

import numpy as np

from hdl.lens.base import LensModel


def distort(x, y, D):
    """The image radius is atan(2 r tan(w / 2)) / w; w = 0 is no distortion."""
    (w,) = D
    if w == 0:
        return x.copy(), y.copy()
    r = np.hypot(x, y)
    stretch = 2 * np.tan(w / 2)
    scale = np.divide(np.arctan(stretch * r), r, out=np.full_like(r, stretch), where=r > 0)
    scale /= w
    return x * scale, y * scale


MODELS = (
    LensModel(
        "fov",
        ("w",),
        (1,),
        distort,
        is_fisheye=True,
        magnification=lambda D: 2 * np.tan(D[0] / 2) / D[0] if D[0] else 1.0,
        limits={"w": (0, 3.1)},
    ),
)
