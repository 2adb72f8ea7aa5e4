"""ORB-SLAM3's settings of a stereo camera: cv::FileStorage YAML with Camera1.*, Camera2.* and Stereo.T_c1_c2.

T_c1_c2 is where the right camera stands: it takes points of Camera2 to Camera1, in metres. Older settings call the left
camera Camera.* and the transformation Tlr, of three or four rows. Camera.type Rectified stands for images that are
rectified already, of cameras Stereo.b apart. Files that have the LEFT.* and RIGHT.* of ORB-SLAM2 are read as such.
Source: ORB_SLAM3, src/Settings.cc, src/Tracking.cc (ParseCamParamFile), Examples and Examples_old.
"""

import re

import numpy as np

from hdl.calibration import checks, lenses, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, camera_matrix

NAME = "orbslam3"
TITLE = "ORB-SLAM3 settings (YAML)"
SEVERAL_FILES = False
SELECT = None

_PAIR = re.compile(r"^Camera2\.fx[ \t]*:", re.MULTILINE), re.compile(r"^Camera1?\.fx[ \t]*:", re.MULTILINE)
_RECTIFIED = re.compile(r"^Camera\.type[ \t]*:[ \t]*\"?Rectified\b", re.MULTILINE)


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _PAIR) or bool(_RECTIFIED.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing field, and for a camera type without such a lens."""
    (document,) = documents
    fields = Fields(document.name, document.yaml)
    kind = fields.get("Camera.type")
    if kind == "Rectified":
        return _rectified(fields)
    if kind not in _LENSES:
        raise fields.fault("Camera.type", kind, f"{', '.join((*_LENSES, 'Rectified'))} are understood")
    names = ("Camera1" if "Camera1.fx" in fields else "Camera", "Camera2")
    left, right = (_camera(fields, name, _LENSES[kind]) for name in names)
    pose = "Stereo.T_c1_c2" if names[0] == "Camera1" else "Tlr"
    R, T = motion.inverse(fields.transform(pose) if names[0] == "Camera1" else _three_rows(fields, pose))
    return Rig(fields.where, *_size(fields), left, right, R, T, unit="m", fields=_roles(fields, names, pose))


def _rectified(fields):
    camera = Camera("radtan", camera_matrix(*fields.numbers(*(f"Camera1.{name}" for name in _INTRINSICS))), np.zeros(0))
    T = checks.position(fields.where, "Stereo.b", np.array([-fields.number("Stereo.b"), 0, 0]))
    roles = _roles(fields, ("Camera1", "Camera1"), "Stereo.b")
    roles |= {"camera1": (fields.where, "the left of the rectified pair"),
              "camera2": (fields.where, "the right of the rectified pair")}  # fmt: skip
    return Rig(fields.where, *_size(fields), camera, camera, np.eye(3), T, unit="m", fields=roles)


def _size(fields):
    return tuple(checks.whole(fields.where, name, fields.get(name)) for name in ("Camera.width", "Camera.height"))


def _roles(fields, names, pose):
    roles = {"size": (fields.where, "Camera.width, Camera.height")} | dict.fromkeys("RT", (fields.where, pose))
    for number, name in zip("12", names):
        roles["camera" + number] = fields.where, name
        roles["K" + number] = fields.where, f"{name}.fx, fy, cx, cy"
        roles["D" + number] = fields.where, f"{name}.k1, k2, ..."
    return roles


def _three_rows(fields, key):
    """R and T of [R T], whether or not 0 0 0 1 stands below; some files state three rows and give four."""
    content = fields.get(key)
    rows = content.get("rows") if isinstance(content, dict) else None
    data = content.get("data") if isinstance(content, dict) else None
    if rows == 3 and isinstance(data, list) and len(data) in (12, 16):
        whole = [*data[:12], *(data[12:] or [0, 0, 0, 1])]
        return Fields(fields.where, {key: whole}).transform(key)
    return fields.transform(key)


def _camera(fields, name, lens):
    model, D = lens(fields, name)
    return Camera(model, camera_matrix(*fields.numbers(*(f"{name}.{entry}" for entry in _INTRINSICS))), D)


def _pinhole(fields, name):
    """None or four coefficients, or five with k3."""
    names = [f"{name}.{entry}" for entry in ("k1", "k2", "p1", "p2", "k3")]
    count = 4 + (names[4] in fields) if any(entry in fields for entry in names) else 0
    D = np.array(fields.numbers(*names[:count]))
    return lenses.model(fields.where, "Camera.type", "radtan", D), D


def _kannala_brandt(fields, name):
    D = np.array(fields.numbers(*(f"{name}.k{order}" for order in (1, 2, 3, 4))))
    return lenses.model(fields.where, "Camera.type", "equidistant", D), D


_INTRINSICS = ("fx", "fy", "cx", "cy")
_LENSES = {"PinHole": _pinhole, "KannalaBrandt8": _kannala_brandt}
