"""Lens models under the names that calibration programs give them."""

import numpy as np

from hdl.calibration.rig import Camera, polynomial_model
from hdl.errors import InputError
from hdl.lens import LENS_MODELS, scaramuzza

# Written small; dashes, underscores, and "pinhole-" before them, make no difference.
_SPELLINGS = {
    "radtan": "radtan radtan4 radtan5 radtan8 radialtangential radialtangential8 plumbbob rational rationalpolynomial "
    "thinprism tilted",
    "equidistant": "equidistant equi fisheye kannalabrandt kannalabrandt4 kannalabrandt8 kb4",
    "double_sphere": "doublesphere ds",
    "eucm": "eucm ucm",
    "mei": "mei omni omnidir omnidirectional unified",
    "fov": "fov atan",
    "scaramuzza": "scaramuzza ocam",
}
_MODELS = {spelling: model for model, spellings in _SPELLINGS.items() for spelling in spellings.split()}
_UNDISTORTED = "none", "pinhole"


def model(where: str, field: str, name, D: np.ndarray) -> str:
    """The model of :class:`Camera` for the lens that a file calls ``name`` and gives the coefficients ``D`` of.

    ``D`` has the order of the model's coefficients in `hdl.lens`: xi, alpha and beta, which files have among the
    intrinsics, belong in it. Basalt's ucm is an eucm with the beta 1.

    Raises InputError for models that are unknown.
    """
    key = name.lower().replace("-", "").replace("_", "") if isinstance(name, str) else None
    if key in _UNDISTORTED and not D.any():
        return polynomial_model(D)
    found = _MODELS.get(key and key.removeprefix("pinhole"))
    if found is None:
        raise InputError(where, field, name, f"the lens models known are {', '.join(LENS_MODELS)}")
    return polynomial_model(D) if found == "radtan" else found


def scaramuzza_camera(inverse, affine, centre) -> Camera:
    """The camera of Scaramuzza's polynomial.

    Parameters
    ----------
    inverse : (n,)
        OCamCalib's inverse polynomial, px, lowest order first.
    affine : (c, d, e)
        u = c x + d y + centre[0], v = e x + y + centre[1], as camodocal has it.
    centre : (2,)
        px.
    """
    D = np.array([*affine, *inverse], dtype=np.float64)
    f = scaramuzza.focal_length(D)
    return Camera("scaramuzza", np.array([[f, 0, centre[0]], [0, f, centre[1]], [0, 0, 1]]), D)
