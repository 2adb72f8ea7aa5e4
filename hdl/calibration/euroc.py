"""sensor.yaml of the ASL dataset format, one file a camera: EuRoC MAV, and Kimera's camera parameters.

``T_BS`` takes points of the sensor to the body, in metres. Which camera is the left one follows from it, in whichever
order the files are given.
Source: EuRoC MAV dataset (Burri et al., IJRR 2016), cam0/sensor.yaml.
"""

import re

import numpy as np

from hdl.calibration import lenses, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig
from hdl.calibration.suspicions import left_first
from hdl.errors import InputError

NAME = "euroc"
TITLE = "EuRoC/ASL sensor.yaml (pair)"
SEVERAL_FILES = True
SELECT = None

_TRAITS = [re.compile(rf"^{field}[ \t]*:", re.MULTILINE) for field in ("T_BS", "intrinsics")]


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in two ``documents``, in any order.

    Raises InputError for a missing field, a wrong shape, different sizes, and lenses that are neither
    radial-tangential nor equidistant.
    """
    source = ", ".join(document.name for document in documents)
    if len(documents) != 2:
        raise InputError(source, None, None, "two sensor.yaml files are needed, one of each camera")
    first, second = (Fields(document.name, document.yaml) for document in documents)
    (width, height), other = first.size("resolution"), second.size("resolution")
    if (width, height) != other:
        raise second.fault("resolution", list(other), f"not that in {first.where}, {[width, height]}")
    R, T = motion.between(*(motion.inverse(fields.transform("T_BS")) for fields in (first, second)))
    roles = {"size": (first.where, "resolution")}
    for number, fields in (("1", first), ("2", second)):
        roles["K" + number] = fields.where, "intrinsics"
        roles["D" + number] = fields.where, "distortion_coefficients"
    roles |= dict.fromkeys("RT", (second.where, "T_BS"))
    rig = Rig(source, width, height, _camera(first), _camera(second), R, T, unit="m", fields=roles)
    return left_first(rig)


def _camera(fields):
    model = fields.get("camera_model")
    lenses.refuse_omnidirectional(fields.where, "camera_model", model)
    if model != "pinhole":
        raise fields.fault("camera_model", model, "only pinhole can be rectified")
    fu, fv, cu, cv = fields.vector("intrinsics", (4,))
    D = fields.vector("distortion_coefficients", (0, 4, 5))
    lens = lenses.model(fields.where, "distortion_model", fields.get("distortion_model"), D)
    return Camera(lens, np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]]), D)
