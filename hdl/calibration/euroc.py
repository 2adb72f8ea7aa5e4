"""sensor.yaml of the ASL dataset format, one file a camera: EuRoC MAV, and Kimera's camera parameters.

``T_BS`` takes points of the sensor to the body, in metres. Which camera is the left one follows from it, in whichever
order the files are given, unless their names say left and right.
Source: EuRoC MAV dataset (Burri et al., IJRR 2016), cam0/sensor.yaml.
"""

import re

from hdl.calibration import asl, motion, sides
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Rig
from hdl.calibration.suspicions import left_first
from hdl.errors import InputError

NAME = "euroc"
TITLE = "EuRoC/ASL sensor.yaml (pair)"
SEVERAL_FILES = True
SELECT = None

_COEFFICIENTS = "distortion_coefficients"
_TRAITS = [re.compile(rf"^{field}[ \t]*:", re.MULTILINE) for field in ("T_BS", "intrinsics")]


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in two ``documents``, in any order.

    Raises InputError for a missing field, a wrong shape, and lenses that are not known.
    """
    source = ", ".join(document.name for document in documents)
    if len(documents) != 2:
        raise InputError(source, None, None, "two sensor.yaml files are needed, one of each camera")
    told, named = sides.by_name(*(document.name for document in documents)) or (0, False)
    first, second = (Fields(document.name, document.yaml) for document in (documents[told], documents[1 - told]))
    R, T = motion.between(*(motion.inverse(fields.transform("T_BS")) for fields in (first, second)))
    left, right = (asl.camera(fields, _COEFFICIENTS) for fields in (first, second))
    roles = asl.roles(first, "1", _COEFFICIENTS) | asl.roles(second, "2", _COEFFICIENTS)
    roles |= dict.fromkeys("RT", (second.where, "T_BS"))
    rig = Rig(source, *left.size, left, right, R, T, unit="m", fields=roles)
    return rig if named else left_first(rig)
