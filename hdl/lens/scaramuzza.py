"""Scaramuzza's polynomial, in the direction from the ray to the image: OCamCalib's inverse polynomial.

The coefficients give pixels: for a ray at the angle theta from the image plane, negative in front of the camera, the
image radius is a0 + a1 theta + a2 theta^2 + ..., and [c d; e 1] maps it onto the pixels. `distort` divides by the focal
length on the optical axis, `focal_length`, so that K is made of it and of the centre.
Source: Scaramuzza, Martinelli and Siegwart, IROS 2006; OCamCalib, world2cam; camodocal, ScaramuzzaCamera.
"""

import numpy as np

from hdl.lens.base import LensModel

AFFINE = ("c", "d", "e")
MOST_TERMS = 20


def distort(x, y, D):
    (c, d, e), inverse = D[:3], D[3:]
    r = np.hypot(x, y)
    radius = np.polynomial.polynomial.polyval(np.arctan(r) - np.pi / 2, inverse)
    radius /= focal_length(D)
    scale = np.divide(radius, r, out=np.ones_like(r), where=r > 0)
    x, y = x * scale, y * scale
    return c * x + d * y, e * x + y


def focal_length(D):
    """px on the image plane per unit on the normalised plane, on the optical axis, before c, d and e."""
    inverse = D[3:]
    return float(np.polynomial.polynomial.polyval(-np.pi / 2, np.polynomial.polynomial.polyder(inverse)))


MODELS = (
    LensModel(
        "scaramuzza",
        (*AFFINE, *(f"a{order}" for order in range(MOST_TERMS))),
        tuple(range(len(AFFINE) + 2, len(AFFINE) + MOST_TERMS + 1)),
        distort,
        is_fisheye=True,
        limits={"c": (0.5, 2), "d": (-0.5, 0.5), "e": (-0.5, 0.5)},
    ),
)
