"""The names under which people save OpenCV's matrices: K1, M1, cameraMatrix1, camera_matrix_left, mtxL and so on.

Case, underscores, dashes, dots and spaces make no difference.
"""

import re
from itertools import combinations, product

_CAMERA_BASES = {
    "K": "k m mtx kmatrix cameramatrix cameramat cameramtx cammatrix cammat cammtx intrinsic intrinsics "
    "intrinsicmatrix intrinsicsmatrix",
    "D": "d dist distcoeff distcoeffs distcoef distcoefs distcoefficients distortion distortions distortioncoeff "
    "distortioncoeffs distortioncoef distortioncoefs distortioncoefficients distortionvector distortionparameters",
    "R_rect": "r rect rectification rectificationmatrix rectificationtransform rectificationrotation",
    "P": "p proj projection projectionmatrix projmat projmatrix",
    "size": "imagesize imgsize size framesize resolution imageresolution",
    "width": "imagewidth imgwidth framewidth width",
    "height": "imageheight imgheight frameheight height",
    "model": "model distortionmodel lensmodel cameramodel distortiontype",
    "fisheye": "fisheye isfisheye fisheyemodel",
}
_PAIR_BASES = {
    "R": "r rot rotation rotationmatrix rmat rmatrix rotmat",
    "T": "t trans trns translation translationvector tvec tvector",
}
_LENGTH_UNITS = ("mm", "cm", "m")
_OF_OTHERS = "intrinsic", "intrinsics"  # Kalibr's and the ASL's fx, fy, cx and cy
_PAIR_UNIT = "unit units lengthunit translationunit"
_BEFORE, _BEHIND = ("", "stereo", "extrinsic", "extrinsics"), ("", "stereo", "betweencameras", "lefttoright")
SIDES = {"left": "left", "l": "left", "right": "right", "r": "right", "0": "0", "1": "1", "2": "2"}
_CAMERAS = ("", "cam", "camera")


def role(*path: str) -> tuple[str, str] | None:
    """What a name means, at the end of a ``path`` of objects whose names may say something of it.

    The matrix, "K", "D", "R_rect", "P", "R" or "T", or "size" and so on, and a second word: of all that a camera has
    the side ("left", "right", "0", "1", "2", or "" where no name has it), of T the unit.

    None for names that mean nothing here.
    """
    names = [re.sub(r"[^a-z0-9]", "", name.lower()) for name in path]
    for count in reversed(range(len(names))):
        for before in combinations(names[:-1], count):
            if found := _ROLES.get("".join([*before, names[-1]])):
                return found
    return None


def _roles():
    found = {}
    for matrix, bases in _CAMERA_BASES.items():
        for base in bases.split():
            if matrix not in ("R_rect", "P") and base not in _OF_OTHERS:
                found[base] = matrix, ""
            for (word, side), camera in product(SIDES.items(), _CAMERAS):
                for spelling in (
                    f"{base}{camera}{word}", f"{camera}{word}{base}", f"{word}{camera}{base}", f"{base}{word}{camera}"
                ):  # fmt: skip
                    found[spelling] = matrix, side
    for matrix, bases in _PAIR_BASES.items():
        for base, before, behind in product(bases.split(), _BEFORE, _BEHIND):
            found[f"{before}{base}{behind}"] = matrix, ""
            if matrix == "T":
                found |= {f"{before}{base}{behind}{unit}": (matrix, unit) for unit in _LENGTH_UNITS}
    return found | dict.fromkeys(_PAIR_UNIT.split(), ("unit", ""))


_ROLES = _roles()
