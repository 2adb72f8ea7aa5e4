"""ORB-SLAM2's settings of a stereo camera: cv::FileStorage YAML with LEFT.K, LEFT.D, LEFT.R, LEFT.P and RIGHT.*.

R and T follow from both R and P, as nothing else is in the file. It does not say in which unit: that of Camera.bf.
Source: ORB_SLAM2, Examples/Stereo/EuRoC.yaml.
"""

import re

from hdl.calibration import checks, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model
from hdl.lens.polynomial import COUNTS as POLYNOMIAL_COUNTS

NAME = "orbslam"
TITLE = "ORB-SLAM settings (YAML)"
SEVERAL_FILES = False
SELECT = None

_TRAIT = re.compile(r"^LEFT\.K[ \t]*:", re.MULTILINE)


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing field and a wrong shape."""
    (document,) = documents
    fields = Fields(document.name, document.yaml)
    if "Camera.type" in fields and fields.get("Camera.type") != "PinHole":
        raise fields.fault("Camera.type", fields.get("Camera.type"), "LEFT and RIGHT are understood for PinHole only")
    left, right = (_camera(fields, side) for side in ("LEFT", "RIGHT"))
    rectification = {}
    for side in ("LEFT", "RIGHT"):
        R = checks.rotation(document.name, f"{side}.R", fields.matrix(f"{side}.R", 3, 3))
        P = motion.projection(document.name, f"{side}.P", fields.matrix(f"{side}.P", 3, 4, finite=False))
        rectification[side.lower()] = R, P
    R, T = motion.of_rectification(*rectification["left"], *rectification["right"])
    roles = {}
    for number, side in (("1", "LEFT"), ("2", "RIGHT")):
        roles["camera" + number] = document.name, side
        roles["size" + number] = document.name, f"{side}.width, {side}.height"
        roles |= {role + number: (document.name, f"{side}.{role}") for role in "KDRP"}
    roles |= {"R": (document.name, "RIGHT.R"), "T": (document.name, "RIGHT.P")}
    return Rig(document.name, *left.size, left, right, R, T, rectification=rectification, fields=roles)


def _camera(fields, side):
    names = f"{side}.width", f"{side}.height"
    size = tuple(checks.whole(fields.where, name, fields.get(name)) for name in names)
    D = fields.vector(f"{side}.D", POLYNOMIAL_COUNTS)
    return Camera(polynomial_model(D), fields.matrix(f"{side}.K", 3, 3), D, size=size)
