"""What a lens model is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

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
        Far outside the image what comes out may be infinite or NaN; beyond the rays that the model is defined for it
        is NaN.
    is_fisheye : bool
        Not one of those that cv2.stereoRectify knows, and mostly made for fields of view so wide that a rectification
        which shows all of the source would show next to nothing: the rectified focal length is chosen instead.
    magnification : callable
        D to how much larger than K says the image is next to the optical axis: distort is about (x, y) times this
        there.
    limits : mapping of coefficient to (float, float)
        What coefficients may be, both ends included, where not every number is a lens.
    """

    name: str
    coefficients: tuple[str, ...]
    counts: tuple[int, ...]
    distort: Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    is_fisheye: bool = False
    magnification: Callable[[np.ndarray], float] = lambda D: 1.0
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def refusal(self, D: np.ndarray) -> tuple[str, str] | None:
        """What of ``D`` makes no such lens, and why not, in words; None for a lens."""
        if len(D) not in self.counts:
            return f"{len(D)} coefficients", f"a lens of model {self.name} has {' or '.join(map(str, self.counts))}"
        for name, value in zip(self.coefficients, D):
            low, high = self.limits.get(name, (-np.inf, np.inf))
            if not low <= value <= high:
                return f"{name} {value:g}", f"in a lens of model {self.name} it lies between {low:g} and {high:g}"
        return None
