"""Matrices and vectors as people's files hold them: rows, cols and data, a sequence, or a sequence of rows.

A sequence of numbers stands for a row, a column, or a matrix row by row. Each function takes a value with the file and
the field that it was found in, and raises InputError for one that is not of the shape.
"""

import math
import re

import numpy as np

from hdl.calibration import checks, motion
from hdl.errors import InputError

_TYPE = re.compile(r"([1-9][0-9]{0,2})?[ucwsifdh]\Z")  # of elements: channels and depth


def matrix(where: str, name: str, value, rows: int, cols: int) -> np.ndarray:
    """float64 of shape (rows, cols)."""
    shape = _shape(where, name, value)
    if len(shape) == 2 and shape != (rows, cols):
        raise InputError(where, name, f"{shape[0]}x{shape[1]}", f"a {rows}x{cols} matrix is needed")
    return checks.array(*_elements(where, name, value), (rows, cols))


def vector(where: str, name: str, value, counts: tuple[int, ...]) -> np.ndarray:
    """float64 of shape (n,), n in ``counts``, from one row, one column or a sequence."""
    shape = _shape(where, name, value)
    count = math.prod(shape)
    if min(shape) > 1 and len(shape) == 2 or count not in counts:
        accepted = " or ".join(map(str, counts))
        found = "x".join(map(str, shape)) if len(shape) == 2 else f"{count} values"
        raise InputError(where, name, found, f"{accepted} numbers in one row or column are needed")
    return checks.array(*_elements(where, name, value), (count,))


def rotation(where: str, name: str, value) -> np.ndarray:
    """float64 of shape (3, 3), from a matrix, of which nothing is checked, or from a rotation vector, rad."""
    if _shape(where, name, value) in ((1, 3), (3, 1), (3,)):
        return motion.of_vector(where, name, vector(where, name, value, (3,)))
    return matrix(where, name, value, 3, 3)


class Entries:
    """Matrices and vectors by the role that they have."""

    def entry(self, role: str) -> tuple:
        """File, name and value. Raises InputError where there is none."""
        raise NotImplementedError

    def matrix(self, role: str, rows: int, cols: int) -> np.ndarray:
        return matrix(*self.entry(role), rows, cols)

    def vector(self, role: str, counts: tuple[int, ...]) -> np.ndarray:
        return vector(*self.entry(role), counts)

    def rotation(self, role: str) -> np.ndarray:
        return rotation(*self.entry(role))


def _shape(where, name, value):
    """(rows, cols) of a matrix or of a sequence of rows, (n,) of a sequence. Several channels lie along the columns."""
    if isinstance(value, list):
        rows = [len(row) for row in value if isinstance(row, list)]
        return (len(rows), rows[0]) if rows and rows == len(value) * rows[:1] else (len(value),)
    if not isinstance(value, dict) or not {"rows", "cols", "data"} <= value.keys():
        raise InputError(where, name, value, "a matrix with rows, cols, dt and data, or a sequence, is needed")
    for key in ("rows", "cols"):
        if not isinstance(value[key], int) or value[key] < 0:
            raise InputError(where, f"{name}.{key}", value[key], "a whole number is needed")
    kind = _TYPE.match(str(value.get("dt", "d")))
    if not kind:
        raise InputError(where, f"{name}.dt", value["dt"], "a matrix of numbers is needed")
    return value["rows"], value["cols"] * int(kind.group(1) or 1)


def _elements(where, name, value):
    """File, field and the flat list of what a matrix, a sequence or a sequence of rows holds."""
    if isinstance(value, dict):
        return where, f"{name}.data", value.get("data")
    if len(_shape(where, name, value)) == 2:
        value = [item for row in value for item in row]
    return where, name, value
