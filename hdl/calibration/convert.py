"""A rig as OpenCV writes calibrations: cv::FileStorage YAML that this project, cv2.FileStorage and people can read."""

from pathlib import Path

import numpy as np

from hdl import files
from hdl.calibration.rig import STRETCH, Rig, stretch
from hdl.errors import InputError
from hdl.lens import polynomial

SUFFIXES = (".yml", ".yaml")
_OPENCVS = (*polynomial.NAMES, "equidistant")


def to_opencv(rig: Rig, rectification: dict | None = None) -> str:
    """The text of the file: image size, M1, D1, M2, D2, R and T, every number to its last bit.

    Mei's lenses have xi1 and xi2 beside D1 and D2, as cv::omnidir does. Those that OpenCV does not know have their
    coefficients in lens1 and lens2, so that nobody takes them for others, and are read by this project alone.

    Parameters
    ----------
    rig : Rig
    rectification : dict of side to (R (3, 3), P (3, 4)), optional
        Written as R1, P1, R2 and P2.

    Raises
    ------
    InputError
        For a rig whose two cameras have images of different sizes or lenses of different kinds, for which such a file
        has no fields.
    """
    if len(rig.sizes) > 1:
        problem = "OpenCV's format holds one size for both cameras"
        if stretch(rig.left.size, rig.right.size) <= STRETCH:
            problem += f"; --size {rig.width}x{rig.height} makes them one"
        raise InputError(*rig.spelling("size2"), "{}x{}".format(*rig.right.size), problem)
    kinds = {"polynomial" if model in polynomial.NAMES else model for model in (rig.left.model, rig.right.model)}
    if len(kinds) > 1:
        models = f"{rig.left.model}, {rig.right.model}"
        raise InputError(rig.source, "lens models", models, "OpenCV's format holds one kind for both cameras")
    lines = ["%YAML:1.0", "---", f"image_width: {rig.width}", f"image_height: {rig.height}", f"model: {rig.left.model}"]
    if rig.unit:
        lines.append(f"unit: {rig.unit}")
    matrices = {}
    for number, camera in (("1", rig.left), ("2", rig.right)):
        matrices["M" + number] = camera.K
        if camera.model == "mei":
            lines.append(f"xi{number}: {float(camera.D[0])!r}")
            matrices["D" + number] = np.resize([*camera.D[1:], 0.0], (1, 4))
        else:
            matrices[("D" if camera.model in _OPENCVS else "lens") + number] = camera.D[None]
    matrices |= {"R": rig.R, "T": rig.T[:, None]}
    if rectification:
        (R1, P1), (R2, P2) = rectification["left"], rectification["right"]
        matrices |= {"R1": R1, "P1": P1, "R2": R2, "P2": P2}
    for name, matrix in matrices.items():
        lines += _matrix(name, matrix)
    return "\n".join(lines) + "\n"


def write(path: Path, text: str) -> None:
    """Put ``text`` at ``path``, whole or not at all; raises OSError where it cannot be written."""
    files.write({path: text})


def _matrix(name, matrix):
    rows, cols = matrix.shape
    # repr is the shortest text that reads as the same float64; OpenCV takes each of its spellings.
    numbers = [", ".join(map(repr, map(float, row))) for row in np.asarray(matrix, dtype=np.float64)]
    data = (",\n" + 10 * " ").join(numbers)
    return [f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {cols}", "   dt: d", f"   data: [ {data} ]"]
