"""Basalt's calibration.json, as basalt_calibrate and basalt_calibrate_imu write it.

``T_imu_cam`` takes points of a camera to the IMU: a place in metres and a quaternion x, y, z, w.
Source: basalt-headers, calibration.hpp, serialization/headers_serialization.h and camera/*.hpp.
"""

import re

import numpy as np

from hdl.calibration import checks, lenses, motion, mounted
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.mounted import Mounted
from hdl.calibration.rig import Camera, Rig, camera_matrix

NAME = "basalt"
TITLE = "Basalt calibration (JSON)"
SEVERAL_FILES = False
SELECT = mounted.SELECT

_TRAITS = re.compile(r'"T_imu_cam"\s*:'), re.compile(r'"camera_type"\s*:')
# Type to our name of the lens, and to what it has beside fx, fy, cx and cy, in our order.
_LENSES = {
    "pinhole": ("none", ()),
    "pinhole-radtan8": ("radtan", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "kb4": ("equidistant", ("k1", "k2", "k3", "k4")),
    "ds": ("double_sphere", ("xi", "alpha")),
    "eucm": ("eucm", ("alpha", "beta")),
    "ucm": ("eucm", ("alpha",)),
    "fov": ("fov", ("w",)),
}


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of two cameras in one document: those of ``select``, otherwise 0 and 1, the left one being called left.

    Raises InputError for a missing field and a camera type that is not known.
    """
    (document,) = documents
    fields = Fields(document.name, document.json)
    fields = fields.child("value0") if "value0" in fields else fields
    poses, intrinsics, sizes = fields.children("T_imu_cam"), fields.children("intrinsics"), fields.get("resolution")
    if not isinstance(sizes, list) or not len(poses) == len(intrinsics) == len(sizes):
        found = f"{len(poses)}, {len(intrinsics)}, {len(sizes) if isinstance(sizes, list) else sizes}"
        raise fields.fault("T_imu_cam, intrinsics, resolution", found, "as many of each are needed")
    return mounted.listed(
        document.name, fields.name("intrinsics"), intrinsics, select,
        lambda index: _mounted(fields, poses[index], intrinsics[index], index),
    )  # fmt: skip


def _mounted(fields, pose, entry, index):
    resolution = f"resolution[{index}]"
    size = Fields(fields.where, {resolution: fields.get("resolution")[index]}, fields.prefix).size(resolution)
    x, y, z, *quaternion = pose.numbers("px", "py", "pz", "qx", "qy", "qz", "qw")
    R = motion.of_quaternion(pose.where, pose.name("qx, qy, qz, qw"), *quaternion)
    T = checks.position(pose.where, pose.name("px, py, pz"), np.array([x, y, z]))
    spelled = {
        "camera": f"camera {index}", "size": fields.name(resolution), "K": entry.name("intrinsics"),
        "D": entry.name("intrinsics"), "pose": pose.prefix,
    }  # fmt: skip
    return Mounted(fields.where, size, _camera(entry), (R, T), spelled)


def _camera(entry):
    kind = entry.get("camera_type")
    if not isinstance(kind, str) or kind not in _LENSES:
        raise entry.fault("camera_type", kind, f"the camera types known are {', '.join(_LENSES)}")
    lens, names = _LENSES[kind]
    values = entry.child("intrinsics")
    D = np.array(values.numbers(*names))
    if kind == "ucm":
        D = np.append(D, 1.0)  # beta, which the model is extended by
    model = lenses.model(entry.where, entry.name("camera_type"), lens, D)
    return Camera(model, camera_matrix(*values.numbers("fx", "fy", "cx", "cy")), D)
