"""MATLAB's stereo parameters as a struct: s = toStruct(stereoParams); save('rig.mat', 's') or save(..., '-struct').

MATLAB multiplies row vectors from the left, so that RotationOfCamera2 and IntrinsicMatrix are the transposes of R and
K (the newer K is not), and it counts pixels from one. T is in WorldUnits, millimetres unless the struct says otherwise.
Source: MathWorks, stereoParameters, cameraParameters and stereoParametersToOpenCV.
"""

import numpy as np

from hdl.calibration import checks
from hdl.calibration.bouguet import plain
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model

NAME = "matlab"
TITLE = "MATLAB stereo parameters (toStruct, .mat)"
SEVERAL_FILES = False
SELECT = None

UNITS = {"mm": 1e-3, "millimeters": 1e-3, "millimetres": 1e-3, "cm": 1e-2, "centimeters": 1e-2, "centimetres": 1e-2,
         "m": 1.0, "meters": 1.0, "metres": 1.0, "in": 0.0254, "inches": 0.0254}  # fmt: skip
_STRUCT = "CameraParameters1"


def recognises(document: Document) -> bool:
    if not document.data:
        return False
    contents = document.mat
    return _holder(contents.variables) is not None or "object" in contents.foreign


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. ``size`` (width, height in px) serves where the struct has no ImageSize.

    Raises InputError for a missing field, a wrong shape, and parameters saved as an object.
    """
    (document,) = documents
    whole = Fields(document.name, plain(document))
    holder = _holder(document.mat.variables)
    if holder is None:
        problem = "missing"
        if "object" in document.mat.foreign:
            problem += ": it holds a MATLAB object; save the struct instead: s = toStruct(stereoParams)"
        raise whole.fault(_STRUCT, None, problem)
    fields = whole.child(holder) if holder else whole
    first, second = (fields.child(f"CameraParameters{number}") for number in (1, 2))
    left, right = (_camera(camera, size) for camera in (first, second))
    where = document.name
    R = checks.rotation(where, fields.name("RotationOfCamera2"), fields.matrix("RotationOfCamera2", 3, 3)).T
    T = checks.position(where, fields.name("TranslationOfCamera2"), fields.matrix("TranslationOfCamera2", 3))
    unit = first.get("WorldUnits") if "WorldUnits" in first else "mm"
    scale = UNITS.get(unit.strip().lower()) if isinstance(unit, str) else None
    roles = {role: (where, fields.name(f"{name}OfCamera2")) for role, name in (("R", "Rotation"), ("T", "Translation"))}
    for number, camera in (("1", first), ("2", second)):
        roles["camera" + number] = where, camera.prefix
        roles["size" + number] = where, camera.name("ImageSize")
        roles["K" + number] = where, camera.name(_matrix_name(camera))
        roles["D" + number] = where, camera.name("RadialDistortion")
    rig = Rig(where, *left.size, left, right, R, T * (scale or 1), unit=scale and "m", fields=roles)
    if scale is None:
        rig = rig.warned_as(first.fault("WorldUnits", unit, f"not one of {', '.join(UNITS)}; lengths are left as is"))
    return rig


def _holder(variables):
    """The variable that is the struct; "" if its fields are variables of their own; None if there is none."""
    if _STRUCT in variables:
        return ""
    return next((name for name, value in variables.items() if isinstance(value, dict) and _STRUCT in value), None)


def _size(camera, size):
    value = camera.get("ImageSize")
    if value == []:
        if size:
            return size
        raise camera.fault("ImageSize", None, "empty: give the size of the images with --size")
    height, width = camera.size("ImageSize")
    return width, height


def _matrix_name(camera):
    return "IntrinsicMatrix" if "IntrinsicMatrix" in camera else "K"


def _camera(fields, size):
    name = _matrix_name(fields)
    K = fields.matrix(name, 3, 3)
    K = K.T.copy() if name == "IntrinsicMatrix" else K
    K[:2, 2] -= 1
    radial, tangential = fields.vector("RadialDistortion", (2, 3)), fields.matrix("TangentialDistortion", 2)
    D = np.concatenate([radial[:2], tangential, radial[2:]])
    return Camera(polynomial_model(D), K, D, size=_size(fields, size))
