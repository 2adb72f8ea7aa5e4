"""OV2SLAM's parameters: cv::FileStorage YAML with Camera.fxl, Camera.fxr and so on, and body_T_cam0 and body_T_cam1.

These take points of the camera to the body, in metres; camera 0 is the left one.
Source: ov2slam, src/slam_params.cpp, src/camera_calibration.cpp and parameters_files.
"""

import re

import numpy as np

from hdl.calibration import checks, lenses, mounted
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.mounted import Mounted
from hdl.calibration.rig import Camera, Rig, camera_matrix

NAME = "ov2slam"
TITLE = "OV2SLAM parameters (YAML)"
SEVERAL_FILES = False
SELECT = None

_TRAIT = re.compile(r"^Camera\.fxl[ \t]*:", re.MULTILINE)
_LENSES = {"pinhole": "radtan", "fisheye": "equidistant"}


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing field and an unknown model."""
    (document,) = documents
    fields = Fields(document.name, document.yaml)
    return mounted.rig(document.name, _mounted(fields, "left", 0), _mounted(fields, "right", 1))


def _mounted(fields, side, number):
    width, height = names = f"Camera.{side}_nwidth", f"Camera.{side}_nheight"
    size = tuple(checks.whole(fields.where, name, fields.get(name)) for name in names)
    letter = side[0]
    K, D, pose = f"Camera.fx{letter}, fy, cx, cy", f"Camera.k1{letter}, k2, p1, p2", f"body_T_cam{number}"
    spelled = {"camera": f"the {side} camera", "size": f"{width}, {height}", "K": K, "D": D, "pose": pose}
    return Mounted(fields.where, size, _camera(fields, side), fields.transform(pose), spelled)


def _camera(fields, side):
    key, letter = f"Camera.model_{side}", side[0]
    kind = fields.get(key)
    if not isinstance(kind, str) or kind not in _LENSES:
        raise fields.fault(key, kind, f"{' and '.join(_LENSES)} are understood")
    # Of a fisheye lens these are cv::fisheye's k1 to k4.
    D = np.array(fields.numbers(*(f"Camera.{name}{letter}" for name in ("k1", "k2", "p1", "p2"))))
    lens = lenses.model(fields.where, key, _LENSES[kind], D)
    return Camera(
        lens, camera_matrix(*fields.numbers(*(f"Camera.{name}{letter}" for name in ("fx", "fy", "cx", "cy")))), D
    )
