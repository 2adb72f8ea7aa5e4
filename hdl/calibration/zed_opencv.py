"""zed_calibration_SN.yml of Stereolabs' zed-opencv-calibration: cv::FileStorage YAML of Size, K_LEFT, D_LEFT and so on.

R is a rotation vector; T is in millimetres, in which the tool asks for the size of the squares. D_LEFT_FE in place of
D_LEFT is a fisheye's.
Source: zed-opencv-calibration, opencv_calibration.cpp (saveCalibOpenCV).
"""

import re

from hdl.calibration import checks, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model
from hdl.lens.polynomial import COUNTS as POLYNOMIAL_COUNTS

NAME = "zed-opencv"
TITLE = "zed-opencv-calibration (zed_calibration_SN.yml)"
SEVERAL_FILES = False
SELECT = None

_TRAITS = [re.compile(rf"^{field}[ \t]*:", re.MULTILINE) for field in ("Size", "K_LEFT", "D_LEFT(_FE)?")]


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing field and a wrong shape."""
    (document,) = documents
    fields = Fields(document.name, document.yaml)
    width, height = fields.size("Size")
    roles = {role: (document.name, name) for role, name in (("size", "Size"), ("R", "R"), ("T", "T"))}
    cameras = []
    for number, side in (("1", "LEFT"), ("2", "RIGHT")):
        fisheye = f"D_{side}_FE" in fields
        lens = f"D_{side}_FE" if fisheye else f"D_{side}"
        D = fields.vector(lens, (4,) if fisheye else POLYNOMIAL_COUNTS)
        model = "equidistant" if fisheye else polynomial_model(D)
        cameras.append(Camera(model, fields.matrix(f"K_{side}", 3, 3), D))
        roles |= {"K" + number: (document.name, f"K_{side}"), "D" + number: (document.name, lens)}
    R = motion.of_vector(document.name, "R", fields.vector("R", (3,)))
    T = checks.position(document.name, "T", fields.vector("T", (3,)) / 1000)
    return Rig(document.name, width, height, *cameras, R, T, unit="m", fields=roles)
