"""What a lens model is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LensModel:
    """From the normalised plane of the ideal pinhole camera to that of the real one, in float64.

    Members
    -------
    name : str
        As `hdl.calibration.Camera.model` has it.
    coefficients : tuple of str
        Their names, in the order of D.
    counts : tuple of int
        How many of them a calibration may give; those that are left out are zero.
    distort : callable
        x, y, D to new x, y: where the lens puts points of the normalised plane (z = 1), float64 arrays of one shape.
        Far outside the image what comes out may be infinite or NaN.
    is_fisheye : bool
        Made for fields of view so wide that a rectification which shows all of the source may show next to nothing.
    """

    name: str
    coefficients: tuple[str, ...]
    counts: tuple[int, ...]
    distort: Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    is_fisheye: bool = False
