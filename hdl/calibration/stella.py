"""stella_vslam's and OpenVSLAM's configuration of a stereo camera with a StereoRectifier.

K, D and the rectifying rotations of both cameras, row by row; Camera.fx and so on are of the rectified images, and
focal_x_baseline is -P2[0][3]. R and T follow, as nothing else is in the file, which does not say in which unit. Keys
are nested or, in older files, written with a dot: StereoRectifier.K_left.
Source: stella_vslam, src/stella_vslam/util/stereo_rectifier.cc and example/euroc/EuRoC_stereo.yaml.
"""

import re

import numpy as np

from hdl.calibration import checks, lenses, motion
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import SIDES, Camera, Rig

NAME = "stella"
TITLE = "stella_vslam StereoRectifier (YAML)"
SEVERAL_FILES = False
SELECT = None

_TRAIT = re.compile(r"^StereoRectifier[ \t]*:|^StereoRectifier\.K_left[ \t]*:", re.MULTILINE)
_LENSES = {"perspective": "radtan", "fisheye": "equidistant"}


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document. Raises InputError for a missing field, a wrong shape, and an unknown model."""
    (document,) = documents
    rectified, source = (_section(document, name) for name in ("Camera", "StereoRectifier"))
    width, height = (checks.whole(document.name, rectified.name(key), rectified.get(key)) for key in ("cols", "rows"))
    fx, fy, cx, cy, shift = rectified.numbers("fx", "fy", "cx", "cy", "focal_x_baseline")
    rectification, roles = {}, {"size": (document.name, rectified.name("cols, rows"))}
    for number, side, offset in zip("12", SIDES, (0.0, -shift)):
        R = checks.rotation(document.name, source.name(f"R_{side}"), source.matrix(f"R_{side}", 3, 3))
        P = np.array([[fx, 0, cx, offset], [0, fy, cy, 0], [0, 0, 1, 0]])
        rectification[side] = R, motion.projection(document.name, rectified.name("fx, fy, focal_x_baseline"), P)
        roles |= {role + number: (document.name, source.name(f"{role}_{side}")) for role in "KDR"}
        roles["P" + number] = roles["T"] = document.name, rectified.name("focal_x_baseline")
    roles["R"] = document.name, source.name("R_right")
    R, T = motion.of_rectification(*rectification["left"], *rectification["right"])
    left, right = (_camera(source, side) for side in SIDES)
    return Rig(document.name, width, height, left, right, R, T, rectification=rectification, fields=roles)


def _section(document, name):
    content = document.yaml
    if name in content:
        return Fields(document.name, content[name], name)
    flat = {key.removeprefix(f"{name}."): value for key, value in content.items() if str(key).startswith(f"{name}.")}
    return Fields(document.name, flat, name)


def _camera(fields, side):
    kind = fields.get("model") if "model" in fields else "perspective"
    if not isinstance(kind, str) or kind not in _LENSES:
        raise fields.fault("model", kind, f"{' and '.join(_LENSES)} are understood")
    D = fields.vector(f"D_{side}", (4, 5, 8, 12, 14))
    lens = lenses.model(fields.where, fields.name("model"), _LENSES[kind], D)
    return Camera(lens, fields.matrix(f"K_{side}", 3, 3), D)
