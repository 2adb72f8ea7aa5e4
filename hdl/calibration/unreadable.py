"""Files of known programs that cannot be read, and why: refused by their names, rather than for what they lack."""

import re

from hdl.calibration.documents import Document
from hdl.errors import InputError

_MC_CALIB = re.compile(r"^nb_camera[ \t]*:", re.MULTILINE), re.compile(r"\bcamera_pose_matrix[ \t]*:")


def refuse(document: Document) -> None:
    """Raises InputError if ``document`` is such a file."""
    if all(trait.search(document.text) for trait in _MC_CALIB):
        problem = (
            "a calibration of MC-Calib, which does not document whether its poses lead to the camera or from it; "
            "convert the pair to OpenCV's M1, D1, M2, D2, R and T with x_2 = R x_1 + T: T[0] < 0 if 2 is on the right"
        )
        raise InputError(document.name, "camera_pose_matrix", None, problem)
