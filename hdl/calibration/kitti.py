"""KITTI's calib_cam_to_cam.txt: four cameras, raw (S, K, D, R, T) and rectified (S_rect, R_rect, P_rect).

R_i and T_i take points of camera 0 to camera i, in metres. KITTI cuts its rectified images (1242x375) out of the upper
left corner of a frame that is made here in whole, at the size of the raw images: P_rect is the same for both.
Source: Geiger et al., "Vision meets robotics: the KITTI dataset", IJRR 2013, and the readme of its devkit.
"""

import re

from hdl.calibration import checks, motion
from hdl.calibration.documents import Document, scalar
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model, unless_faulty
from hdl.calibration.selection import pair
from hdl.calibration.suspicions import left_first
from hdl.errors import InputError

NAME = "kitti"
TITLE = "KITTI calib_cam_to_cam.txt"
SEVERAL_FILES = False
SELECT = "two cameras, left first, as in 02,03"

_TRAIT = re.compile(r"^K_[0-9]{2}:", re.MULTILINE)


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of two cameras in one document: those of ``select``, otherwise 00 and 01, the gray ones.

    Raises InputError for a missing field and a wrong number of values.
    """
    (document,) = documents
    fields = Fields(document.name, _lines(document))
    cameras = sorted(key[2:] for key in fields if re.fullmatch("K_[0-9]{2}", key))
    if len(cameras) < 2:
        raise InputError(document.name, None, None, "two cameras are needed, K_00 and K_01")
    left, right = pair(select, cameras) if select is not None else cameras[:2]
    left_camera, right_camera = _camera(fields, left), _camera(fields, right)
    R, T = motion.between(_from_first(fields, left), _from_first(fields, right))
    roles = {role: (document.name, f"{role}_{right}") for role in "RT"}
    for number, name in (("1", left), ("2", right)):
        roles["camera" + number] = document.name, f"camera {name}"
        for role, field in (("size", "S"), ("K", "K"), ("D", "D"), ("R", "R_rect"), ("P", "P_rect")):
            roles[role + number] = document.name, f"{field}_{name}"
    rectification, fault = unless_faulty(lambda: _rectification(fields, left, right))
    rig = Rig(
        source=document.name,
        width=left_camera.size[0],
        height=left_camera.size[1],
        left=left_camera,
        right=right_camera,
        R=R,
        T=T,
        unit="m",
        rectification=rectification,
        rectification_fault=fault,
        fields=roles,
    )
    rig = _warned_of_cut(rig, fields, left) if rig.rectification else rig
    return rig if select is not None else left_first(rig)


def _lines(document):
    content = {}
    for number, line in enumerate(document.text.splitlines(), start=1):
        key, colon, values = line.partition(":")
        if not line.strip():
            continue
        if not colon:
            raise InputError(document.name, f"line {number}", line, "not of the form NAME: VALUES")
        if key in content:
            raise InputError(document.name, key, None, f"given twice, again in line {number}")
        content[key] = [scalar(word) for word in values.split()]
    return content


def _camera(fields, name):
    D = fields.vector(f"D_{name}", (5,))
    return Camera(polynomial_model(D), fields.matrix(f"K_{name}", 3, 3), D, size=fields.size(f"S_{name}"))


def _from_first(fields, name):
    R = checks.rotation(fields.where, f"R_{name}", fields.matrix(f"R_{name}", 3, 3))
    return checks.nearest_rotation(R), checks.position(fields.where, f"T_{name}", fields.matrix(f"T_{name}", 3))


def _rectification(fields, left, right):
    if not any(f"{field}_{name}" in fields for field in ("R_rect", "P_rect") for name in (left, right)):
        return None
    return {
        side: (fields.matrix(f"R_rect_{name}", 3, 3), fields.matrix(f"P_rect_{name}", 3, 4))
        for side, name in (("left", left), ("right", right))
    }


def _warned_of_cut(rig, fields, name):
    key = f"S_rect_{name}"
    if key not in fields or (cut := fields.size(key)) == (rig.width, rig.height):
        return rig
    problem = (
        f"KITTI's rectified images are the upper left corner, of this size, of the {rig.width}x{rig.height} here; "
        "with --alpha 0 the rectification is another one, which fills the frame"
    )
    return rig.warned_as(fields.fault(key, "x".join(map(str, cut)), problem), of="rectification")
