"""Kalibr's camchain.yaml and camchain-imucam.yaml, and OpenVINS' version of them.

``T_cn_cnm1`` takes points of the camera before to this one. ``T_cam_imu`` (x_cam = T x_imu) and its inverse
``T_imu_cam`` serve where it is missing. Lengths are in metres, as Kalibr's targets are.
Source: Kalibr wiki, "YAML formats"; OpenVINS, config/*/kalibr_imucam_chain.yaml.
"""

import re

import numpy as np

from hdl.calibration import asl, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Rig
from hdl.calibration.selection import pair
from hdl.calibration.suspicions import left_first
from hdl.errors import InputError

NAME = "kalibr"
TITLE = "Kalibr camchain (YAML)"
SEVERAL_FILES = False
SELECT = "two cameras, left first, as in cam0,cam1"

_TRAITS = re.compile(r"^cam[0-9]+[ \t]*:", re.MULTILINE), re.compile(r"^[ \t]+intrinsics[ \t]*:", re.MULTILINE)
_COEFFICIENTS = "distortion_coeffs"
_AGREEMENT = 1e-3  # rad and m, of T_cn_cnm1 with the way over the IMU


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of two cameras of the chain in one document: those of ``select``, otherwise cam0 and cam1, the left one
    being called left.

    Raises InputError for a missing field, a lens that is not known, and cameras without connection.
    """
    (document,) = documents
    chain = Fields(document.name, document.yaml)
    cameras = sorted((key for key in chain if re.fullmatch("cam[0-9]{1,3}", key)), key=lambda key: int(key[3:]))
    if len(cameras) < 2:
        raise InputError(document.name, None, None, "two cameras are needed, cam0 and cam1")
    left, right = pair(select, cameras) if select is not None else cameras[:2]
    left_camera, right_camera = (asl.camera(chain.child(name), _COEFFICIENTS) for name in (left, right))
    (R, T), spelling = _motion(chain, cameras, left, right)
    fields = {}
    for number, name in (("1", left), ("2", right)):
        fields["camera" + number] = document.name, name
        fields |= asl.roles(chain.child(name), number, _COEFFICIENTS)
    fields |= dict.fromkeys("RT", (document.name, spelling))
    rig = Rig(document.name, *left_camera.size, left_camera, right_camera, R, T, unit="m", fields=fields)
    rig = _warned_of_contradiction(rig, chain, left, right, spelling)
    return rig if select is not None else left_first(rig)


def _motion(chain, cameras, left, right):
    """R and T from left to right, and the field that they come from."""
    first, last = sorted((cameras.index(left), cameras.index(right)))
    links = cameras[first + 1 : last + 1]
    if all("T_cn_cnm1" in chain.child(name) for name in links):
        whole = np.eye(3), np.zeros(3)
        for name in links:
            whole = motion.then(whole, chain.child(name).transform("T_cn_cnm1"))
        backwards = cameras.index(left) > cameras.index(right)
        return motion.inverse(whole) if backwards else whole, f"{links[-1]}.T_cn_cnm1"
    poses = [_from_imu(chain, name) for name in (left, right)]
    if None in poses:
        raise chain.fault(f"{right}.T_cn_cnm1", None, "missing, and T_cam_imu or T_imu_cam of both cameras as well")
    given = "T_cam_imu" if "T_cam_imu" in chain.child(right) else "T_imu_cam"
    return motion.between(*poses), f"{right}.{given}"


def _from_imu(chain, name):
    fields = chain.child(name)
    if "T_cam_imu" in fields:
        return fields.transform("T_cam_imu")
    return motion.inverse(fields.transform("T_imu_cam")) if "T_imu_cam" in fields else None


def _warned_of_contradiction(rig, chain, left, right, spelling):
    poses = [_from_imu(chain, name) for name in (left, right)]
    if not spelling.endswith("T_cn_cnm1") or None in poses:
        return rig
    R, T = motion.between(*poses)
    if max(np.abs(R - rig.R).max(), np.abs(T - rig.T).max()) < _AGREEMENT:
        return rig
    return rig.warned("T", rig.T, f"over the IMU it is {T.round(6).tolist()}; this one is used")
