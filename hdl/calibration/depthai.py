"""The calibration of a Luxonis OAK device, as depthai's CalibrationHandler writes it (JSON).

Each camera has a socket and the motion from it to another one's: x_to = R x_from + T, in centimetres. Lens coefficients
are OpenCV's fourteen; those of a camera of type fisheye begin with the four of the equidistant model. The file's own
rectified rotations are those of cv2.stereoRectify and come without P, so that they are computed again.
Source: depthai-core, depthai-shared/common (CameraInfo, Extrinsics, StereoRectification, CameraBoardSocket).
"""

import re

import numpy as np

from hdl.calibration import checks, lenses, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig
from hdl.calibration.selection import pair
from hdl.errors import InputError
from hdl.lens.polynomial import COUNTS as POLYNOMIAL_COUNTS

NAME = "depthai"
TITLE = "DepthAI calibration (JSON)"
SEVERAL_FILES = False
SELECT = "two sockets, left first, as in 1,2 or CAM_B,CAM_C"

_TRAIT = re.compile(r'"cameraData"\s*:')
_ALIASES = {"rgb": "0", "left": "1", "right": "2"} | {f"cam_{letter}": str(n) for n, letter in enumerate("abcdefghij")}
_MODELS = {0: "tilted", 1: "equidistant"}
_UNSUPPORTED = {2: "equirectangular", 3: "radial division"}


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of two sockets in one document: those of ``select``, otherwise those of stereoRectificationData.

    Raises InputError for a missing field, and sockets without a chain of extrinsics between them.
    """
    (document,) = documents
    fields = Fields(document.name, document.json)
    cameras = _cameras(fields)
    left, right = pair(select, list(cameras), _ALIASES) if select is not None else _stereo_pair(fields, cameras)
    R, T = _motion(cameras, left, right)
    roles = {}
    for number, socket in (("1", left), ("2", right)):
        roles["camera" + number] = document.name, f"socket {socket}"
        roles["size" + number] = document.name, cameras[socket].name("width, height")
        roles["K" + number] = document.name, cameras[socket].name("intrinsicMatrix")
        roles["D" + number] = document.name, cameras[socket].name("distortionCoeff")
    roles["R"] = document.name, cameras[left].name("extrinsics.rotationMatrix")
    roles["T"] = document.name, cameras[left].name("extrinsics.translation")
    left_camera, right_camera = _camera(cameras[left]), _camera(cameras[right])
    return Rig(document.name, *left_camera.size, left_camera, right_camera, R, T / 100, unit="m", fields=roles)


def _cameras(fields):
    """Socket, as text, to the entries of its camera."""
    data = fields.get("cameraData")
    if not isinstance(data, list):
        raise fields.fault("cameraData", data, "a list of pairs of socket and camera is needed")
    cameras = {}
    for entry in data:
        if not (isinstance(entry, list) and len(entry) == 2 and checks.is_number(entry[0])):
            raise fields.fault("cameraData", entry, "a pair of socket and camera is needed")
        socket = str(entry[0])
        if socket in cameras:
            raise fields.fault("cameraData", socket, "the socket is given twice")
        cameras[socket] = Fields(fields.where, entry[1], f"cameraData[{socket}]")
    return cameras


def _stereo_pair(fields, cameras):
    stereo = fields.child("stereoRectificationData")
    sockets = [str(stereo.get(f"{side}CameraSocket")) for side in ("left", "right")]
    if sockets[0] == sockets[1] or not set(sockets) <= set(cameras):
        problem = f"no pair of sockets of this file; choose two of {', '.join(cameras)} with --select"
        raise stereo.fault("leftCameraSocket, rightCameraSocket", ", ".join(sockets), problem)
    return sockets


def _camera(fields):
    kind = fields.get("cameraType")
    if checks.is_number(kind) and kind in _UNSUPPORTED:
        raise fields.fault("cameraType", kind, f"{_UNSUPPORTED[kind]} images are not supported")
    if not checks.is_number(kind) or kind not in _MODELS:
        raise fields.fault("cameraType", kind, "0 (perspective) or 1 (fisheye) is needed")
    D = fields.vector("distortionCoeff", POLYNOMIAL_COUNTS)
    if _MODELS[kind] == "equidistant":
        if D[4:].any():
            raise fields.fault("distortionCoeff", D.tolist(), "a fisheye lens has four coefficients that are not zero")
        D = D[:4]
    model = lenses.model(fields.where, fields.name("cameraType"), _MODELS[kind], D)
    size = tuple(checks.whole(fields.where, fields.name(key), fields.get(key)) for key in ("width", "height"))
    return Camera(model, fields.matrix("intrinsicMatrix", 3, 3), D, size=size)


def _motion(cameras, left, right):
    """R and T (cm) along the shortest chain of extrinsics from one socket to the other."""
    steps = {socket: {} for socket in cameras}
    for socket, fields in cameras.items():
        extrinsics = fields.child("extrinsics")
        to = str(extrinsics.get("toCameraSocket"))
        if to not in cameras or to == socket:
            continue
        place = extrinsics.child("translation")
        R = checks.rotation(fields.where, extrinsics.name("rotationMatrix"), extrinsics.matrix("rotationMatrix", 3, 3))
        T = checks.position(fields.where, place.prefix, np.array([place.number(axis) for axis in "xyz"]))
        steps[socket][to] = checks.nearest_rotation(R), T
        steps[to].setdefault(socket, motion.inverse(steps[socket][to]))
    reached = {left: (np.eye(3), np.zeros(3))}
    for socket in (queue := [left]):
        for to, step in steps[socket].items():
            if to not in reached:
                reached[to] = motion.then(reached[socket], step)
                queue.append(to)
    if right not in reached:
        field = cameras[left].name("extrinsics.toCameraSocket")
        raise InputError(cameras[left].where, field, None, f"no chain of extrinsics leads from {left} to {right}")
    return reached[right]
