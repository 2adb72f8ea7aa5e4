"""Mei's unified model: a unit sphere, a pinhole behind its centre, then radial and tangential terms.

Kalibr's omni with radtan or none, camodocal's MEI, OpenCV's cv::omnidir.
Source: Mei and Rives, Single View Point Omnidirectional Camera Calibration from Planar Grids, ICRA 2007, section II;
OpenCV, ccalib, omnidir.
"""

import numpy as np

from hdl.lens import polynomial
from hdl.lens.base import LensModel


def distort(x, y, D):
    """The projection of (x, y, 1); NaN for rays that do not reach the image plane, which a negative xi has."""
    xi = D[0]
    depth = 1 + xi * np.sqrt(x * x + y * y + 1)
    if xi < 0:
        depth = np.where(depth > 0, depth, np.nan)
    return polynomial.distort(x / depth, y / depth, D[1:])


MODELS = (
    LensModel(
        "mei",
        ("xi", "k1", "k2", "p1", "p2"),
        (1, 5),
        distort,
        is_fisheye=True,
        magnification=lambda D: 1 / (1 + D[0]),
        limits={"xi": (-0.99, 100)},
    ),
)
