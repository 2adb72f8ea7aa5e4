"""OKVIS' configuration: a list of cameras, each with T_SC, the transformation from the camera to the body (the IMU).

Lengths are in metres. OKVIS 2 lists more than two: depth and colour cameras with the others.
Source: okvis and okvis2, config/*.yaml and okvis_common, VioParametersReader.
"""

import re

from hdl.calibration import lenses, mounted
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.mounted import Mounted
from hdl.calibration.rig import Camera, Rig, camera_matrix

NAME = "okvis"
TITLE = "OKVIS configuration (YAML)"
SEVERAL_FILES = False
SELECT = mounted.SELECT

_TRAITS = re.compile(r"^cameras[ \t]*:", re.MULTILINE), re.compile(r"\bT_SC[ \t]*:")
_LENSES = {
    "radialtangential": "radtan", "radialtangential8": "radtan", "plumb_bob": "radtan", "plumb_bob8": "radtan",
    "equidistant": "equidistant",
}  # fmt: skip


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of two cameras in one document: those of ``select``, otherwise 0 and 1, the left one being called left.

    Raises InputError for a missing field and a lens that is not known.
    """
    (document,) = documents
    cameras = Fields(document.name, document.yaml).children("cameras")
    return mounted.listed(document.name, "cameras", cameras, select, lambda index: _mounted(cameras[index], index))


def _mounted(fields, index):
    spelled = {
        "camera": f"camera {index}", "size": fields.name("image_dimension"),
        "K": fields.name("focal_length, principal_point"), "D": fields.name("distortion_coefficients"),
        "pose": fields.name("T_SC"),
    }  # fmt: skip
    size, pose = fields.size("image_dimension"), fields.transform("T_SC")
    return Mounted(fields.where, size, _camera(fields), pose, spelled)


def _camera(fields):
    kind = fields.get("distortion_type")
    if not isinstance(kind, str) or kind.lower() not in _LENSES:
        raise fields.fault("distortion_type", kind, f"the lenses known are {', '.join(_LENSES)}")
    D = fields.vector("distortion_coefficients", (4, 5, 8))
    lens = lenses.model(fields.where, fields.name("distortion_type"), _LENSES[kind.lower()], D)
    K = camera_matrix(*fields.vector("focal_length", (2,)), *fields.vector("principal_point", (2,)))
    return Camera(lens, K, D)
