"""VINS' configuration of a stereo camera, and camodocal's files of the two cameras, which it names.

``body_T_cam0`` and ``body_T_cam1`` take points of the cameras to the body (the IMU), in metres. The camera files are
looked for beside the configuration, unless they are given. camodocal's own extrinsics.yaml serves in its place: there
``transform`` takes points of the left camera to the right one, in the unit of the squares.
Source: VINS-Fusion, vins_estimator/src/estimator/parameters.cpp and config; camodocal,
src/calib/StereoCameraCalibration.cc, writeParams.
"""

import re
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np

from hdl.calibration import camodocal, checks, motion, mounted, sides
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.mounted import Mounted
from hdl.calibration.rig import Rig
from hdl.errors import InputError

NAME = "vins"
TITLE = "VINS configuration with camodocal cameras (YAML)"
SEVERAL_FILES = True
SELECT = None

_TRAIT = re.compile(r"^cam0_calib[ \t]*:", re.MULTILINE)
_SIZE = ("image_width", "image_height")
_TRANSFORM = re.compile(r"^transform[ \t]*:[ \t]*\n[ \t]+q_x[ \t]*:", re.MULTILINE)


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text) or _TRANSFORM.search(document.text)) or camodocal.recognises(document)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig of one configuration and the cameras that it names, or of two cameras and extrinsics.yaml.

    Raises InputError for a missing field or file, an unknown lens, and cameras by themselves.
    """
    configurations = [document for document in documents if _TRAIT.search(document.text)]
    cameras = [document for document in documents if camodocal.recognises(document)]
    if len(configurations) > 1:
        names = ", ".join(document.name for document in configurations)
        raise InputError(names, None, None, "several VINS configurations, each complete in itself; name one")
    if configurations:
        return _configured(configurations[0], cameras)
    transforms = [document for document in documents if _TRANSFORM.search(document.text)]
    if len(transforms) == 1 and len(cameras) == 2:
        return _transformed(transforms[0], cameras)
    for camera in cameras:
        camodocal.read(camera)  # what is wrong with its lens goes before
    problem = (
        "camodocal's files hold a camera each, and nothing of how the two stand: name the VINS configuration with "
        "body_T_cam0 and body_T_cam1, or camodocal's extrinsics.yaml and both cameras"
    )
    raise InputError(", ".join(document.name for document in documents), None, None, problem)


def _configured(document, cameras):
    fields = Fields(document.name, document.yaml)
    if "cam1_calib" not in fields:
        raise fields.fault("cam1_calib", None, "missing: a configuration of one camera; a rig needs two")
    rig = mounted.numbered(document.name, *(_mounted(fields, cameras, number) for number in "01"))
    stated = tuple(fields.get(key) for key in _SIZE if key in fields)
    if stated not in ((), *rig.sizes):
        problem = f"the cameras' files say {rig.width}x{rig.height}, which their numbers are of: that is used"
        rig = rig.warned_as(fields.fault(", ".join(_SIZE), "x".join(map(str, stated)), problem))
    return rig


def _mounted(fields, cameras, number):
    field = f"body_T_cam{number}"
    pose = fields.transform(field)
    document = _camera_file(fields, cameras, f"cam{number}_calib")
    camera, size = camodocal.read(document)
    spelled = {
        "camera": (fields.where, f"cam{number}"), "size": "image_width, image_height", "K": "projection_parameters",
        "D": "distortion_parameters", "pose": (fields.where, field),
    }  # fmt: skip
    return Mounted(document.name, size, camera, pose, spelled)


def _camera_file(fields, cameras, key):
    """The document that ``key`` names: one of ``cameras``, which were given, or the file beside the configuration."""
    name = fields.get(key)
    path = PurePosixPath(name if isinstance(name, str) and name.isprintable() else "")
    for camera in cameras:
        if Path(camera.name).name == path.name:
            return camera
    if not path.name or path.is_absolute() or ".." in path.parts:
        raise fields.fault(key, name, "the name of a file beside the configuration is needed")
    return Document.open(Path(fields.where).parent / path)


def _transformed(document, cameras):
    told = sides.by_name(*(camera.name for camera in cameras))
    if told is None:
        names = ", ".join(camera.name for camera in cameras)
        raise InputError(names, None, None, "which is of the left camera? call one left, the other right")
    left, right = cameras if told[0] == 0 else reversed(cameras)
    (camera, size), (other, its) = camodocal.read(left), camodocal.read(right)
    fields = Fields(document.name, document.yaml).child("transform")
    where, field = document.name, fields.prefix
    R = motion.of_quaternion(where, field, *fields.numbers("q_x", "q_y", "q_z", "q_w"))
    T = checks.position(where, field, np.array(fields.numbers("t_x", "t_y", "t_z")))
    roles = dict.fromkeys("RT", (where, field))
    for number, file in (("1", left), ("2", right)):
        roles["size" + number] = file.name, ", ".join(_SIZE)
        roles["K" + number] = file.name, "projection_parameters"
        roles["D" + number] = file.name, "distortion_parameters"
    source = ", ".join(file.name for file in (left, right, document))
    return Rig(source, *size, replace(camera, size=size), replace(other, size=its), R, T, fields=roles)
