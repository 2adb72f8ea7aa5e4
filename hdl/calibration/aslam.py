"""The ASL's camera systems, as maplab and SVO read them: a list of cameras with T_B_C, from the camera to the body.

Lengths are in metres. Of lenses, "fisheye" is the FOV model of one coefficient.
Source: aslam_cv2, aslam_cv_cameras (NCamera, Camera and Distortion, loadFromYamlNode); rpg_svo_pro_open, vikit_cameras.
"""

import re

import numpy as np

from hdl.calibration import checks, lenses, motion, mounted
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.mounted import Mounted
from hdl.calibration.rig import Camera, Rig, camera_matrix

NAME = "aslam"
TITLE = "ASLAM camera system of maplab and SVO (YAML)"
SEVERAL_FILES = False
SELECT = mounted.SELECT

_TRAITS = re.compile(r"^cameras[ \t]*:", re.MULTILINE), re.compile(r"\bT_(B_C|C_B)[ \t]*:")
_SIZE = "image_width", "image_height"
_LENSES = {
    "none": ("none", 0), "no-distortion": ("none", 0), "radial-tangential": ("radtan", 4),
    "equidistant": ("equidistant", 4), "fisheye": ("fov", 1),
}  # fmt: skip


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of two cameras in one document: those of ``select``, otherwise 0 and 1, the left one being called left.

    Raises InputError for a missing field and a camera or lens that is not known.
    """
    (document,) = documents
    cameras = Fields(document.name, document.yaml).children("cameras")
    return mounted.listed(document.name, "cameras", cameras, select, lambda index: _mounted(cameras[index], index))


def _mounted(entry, index):
    camera, pose = entry.child("camera"), "T_B_C" if "T_B_C" in entry else "T_C_B"
    to_body = entry.transform(pose)
    size = tuple(checks.whole(camera.where, camera.name(key), camera.get(key)) for key in _SIZE)
    spelled = {
        "camera": f"camera {index}", "size": camera.name("image_width, image_height"), "K": camera.name("intrinsics"),
        "D": camera.name("distortion.parameters"), "pose": entry.name(pose),
    }  # fmt: skip
    to_body = to_body if pose == "T_B_C" else motion.inverse(to_body)
    return Mounted(entry.where, size, _camera(camera), to_body, spelled)


def _camera(fields):
    kind, distortion = fields.get("type"), fields.child("distortion")
    lens = distortion.get("type")
    if not isinstance(lens, str) or lens not in _LENSES:
        raise distortion.fault("type", lens, f"the lenses known are {', '.join(_LENSES)}")
    name, count = _LENSES[lens]
    D = distortion.vector("parameters", (count,)) if count else np.zeros(0)
    if kind == "pinhole":
        K = camera_matrix(*fields.vector("intrinsics", (4,)))
        return Camera(lenses.model(fields.where, distortion.name("type"), name, D), K, D)
    if kind == "unified-projection" and name in ("none", "radtan"):
        xi, *K = fields.vector("intrinsics", (5,))
        D = np.array([xi, *D])
        return Camera(lenses.model(fields.where, fields.name("type"), "mei", D), camera_matrix(*K), D)
    raise fields.fault("type", kind, "pinhole, or unified-projection with radial-tangential, is needed")
