"""ORB-SLAM3's settings of a stereo camera: cv::FileStorage YAML with Camera1.*, Camera2.* and Stereo.T_c1_c2.

T_c1_c2 is where the right camera stands: it takes points of Camera2 to Camera1, in metres. Files that still have the
LEFT.* and RIGHT.* of ORB-SLAM2 are read as such.
Source: ORB_SLAM3, src/Settings.cc and Examples/Stereo/TUM-VI.yaml.
"""

import re

import numpy as np

from hdl.calibration import checks, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model

NAME = "orbslam3"
TITLE = "ORB-SLAM3 settings (YAML)"
SEVERAL_FILES = False
SELECT = None

_TRAITS = tuple(re.compile(rf"^Camera{number}\.fx[ \t]*:", re.MULTILINE) for number in "12")


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing field, and for a camera type without such a lens."""
    (document,) = documents
    fields = Fields(document.name, document.yaml)
    kind = fields.get("Camera.type")
    if kind not in _LENSES:
        raise fields.fault("Camera.type", kind, f"{' and '.join(_LENSES)} are understood")
    R, T = motion.inverse(fields.transform("Stereo.T_c1_c2"))
    roles = {"size": (document.name, "Camera.width, Camera.height")}
    roles |= dict.fromkeys("RT", (document.name, "Stereo.T_c1_c2"))
    for number in "12":
        roles["K" + number] = document.name, f"Camera{number}.fx, fy, cx, cy"
        roles["D" + number] = document.name, f"Camera{number}.k1, k2, ..."
    width, height = (checks.whole(fields.where, name, fields.get(name)) for name in ("Camera.width", "Camera.height"))
    left, right = (_camera(fields, f"Camera{number}", _LENSES[kind]) for number in "12")
    return Rig(document.name, width, height, left, right, R, T, unit="m", fields=roles)


def _camera(fields, name, lens):
    fx, fy, cx, cy = (fields.number(f"{name}.{entry}") for entry in ("fx", "fy", "cx", "cy"))
    model, D = lens(fields, name)
    return Camera(model, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), D)


def _pinhole(fields, name):
    """None or four coefficients, or five with k3."""
    names = [f"{name}.{entry}" for entry in ("k1", "k2", "p1", "p2", "k3")]
    if not any(entry in fields for entry in names):
        return "radtan", np.zeros(0)
    D = np.array([fields.number(entry) for entry in names[: 4 + (names[4] in fields)]])
    return polynomial_model(D), D


def _kannala_brandt(fields, name):
    return "equidistant", np.array([fields.number(f"{name}.k{order}") for order in (1, 2, 3, 4)])


_LENSES = {"PinHole": _pinhole, "KannalaBrandt8": _kannala_brandt}
