"""Calib_Results_stereo.mat of Bouguet's Camera Calibration Toolbox for MATLAB.

X_right = R X_left + T with R from the rotation vector om. Pixels are counted from zero and kc is in OpenCV's order. T
is in millimetres, in which the toolbox asks for the size of the squares.
Source: Bouguet, "Camera Calibration Toolbox for Matlab", description of the calibration parameters, and example 5.
"""

import numpy as np

from hdl.calibration import checks, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model
from hdl.errors import InputError

NAME = "bouguet"
TITLE = "Bouguet's toolbox (Calib_Results_stereo.mat)"
SEVERAL_FILES = False
SELECT = None


def recognises(document: Document) -> bool:
    return bool(document.data) and "fc_left" in document.mat.variables


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing variable and a wrong shape."""
    (document,) = documents
    fields = Fields(document.name, plain(document))
    R = motion.of_vector(document.name, "om", fields.matrix("om", 3))
    T = checks.position(document.name, "T", fields.matrix("T", 3)) / 1000
    width, height = (checks.whole(document.name, key, fields.get(key)) for key in ("nx", "ny"))
    roles = {"size": (document.name, "nx, ny"), "R": (document.name, "om"), "T": (document.name, "T")}
    for number, side in (("1", "left"), ("2", "right")):
        roles |= {"K" + number: (document.name, f"KK_{side}"), "D" + number: (document.name, f"kc_{side}")}
    return Rig(
        document.name, width, height, _camera(fields, "left"), _camera(fields, "right"), R, T,
        unit="m", fields=roles,
    )  # fmt: skip


def _camera(fields, side):
    """K from fc, cc and alpha_c, as the toolbox itself makes KK."""
    (fx, fy), (cx, cy) = fields.matrix(f"fc_{side}", 2), fields.matrix(f"cc_{side}", 2)
    alpha = fields.number(f"alpha_c_{side}")
    D = fields.vector(f"kc_{side}", (4, 5))
    return Camera(polynomial_model(D), np.array([[fx, alpha * fx, cx], [0, fy, cy], [0, 0, 1]]), D)


def plain(document: Document) -> dict:
    """The variables of a MAT-file as dict, list, int, float and str. Raises InputError for a file of another kind."""
    if not document.data:
        raise InputError(document.name, None, None, "not a MAT-file")
    return _plain(document.mat.variables)


def _plain(value):
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return value
