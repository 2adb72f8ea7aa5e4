"""Lens models under the names that calibration programs give them."""

import numpy as np

from hdl.calibration.rig import polynomial_model
from hdl.errors import InputError

POLYNOMIAL = ("radtan", "radial-tangential", "plumb_bob", "rational", "rational_polynomial", "thin_prism", "tilted")
EQUIDISTANT = ("equidistant", "fisheye")
UNDISTORTED = "none"

OMNIDIRECTIONAL = {
    "mei": "Mei's omnidirectional model",
    "omni": "Mei's omnidirectional model",
    "omnidir": "Mei's omnidirectional model",
    "omnidirectional": "Mei's omnidirectional model",
    "ucm": "the unified omnidirectional model",
    "unified": "the unified omnidirectional model",
    "eucm": "the extended unified omnidirectional model",
    "ds": "the double sphere model",
    "double_sphere": "the double sphere model",
    "ocam": "Scaramuzza's omnidirectional model",
    "scaramuzza": "Scaramuzza's omnidirectional model",
}


def model(where: str, field: str, name, D: np.ndarray) -> str:
    """The model of :class:`Camera` for the lens that a file calls ``name`` and gives the coefficients ``D`` of.

    Raises InputError, with the reason, for models that are unknown or omnidirectional.
    """
    refuse_omnidirectional(where, field, name)
    key = name.lower() if isinstance(name, str) else name
    if key in EQUIDISTANT:
        return "equidistant"
    if key in POLYNOMIAL or (key == UNDISTORTED and not D.any()):
        return polynomial_model(D)
    raise InputError(where, field, name, f"the lens models known are {', '.join(POLYNOMIAL + EQUIDISTANT)}")


def refuse_omnidirectional(where: str, field: str, name) -> None:
    """Raises InputError if ``name`` is that of an omnidirectional lens model."""
    described = OMNIDIRECTIONAL.get(name.lower()) if isinstance(name, str) else None
    if described:
        problem = (
            f"{described} is not supported: it is made for views beyond 180 degrees, which no flat rectified image can "
            "hold; calibrate anew as pinhole with radtan or equidistant"
        )
        raise InputError(where, field, name, problem)
