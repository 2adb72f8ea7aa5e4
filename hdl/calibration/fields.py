"""Named entries of a file, with refusals that name the file, the entry and what was found there."""

import math

import numpy as np

from hdl.calibration import checks
from hdl.errors import InputError


class Fields:
    """The entries of one mapping in a file.

    Parameters
    ----------
    where : str
        The file.
    content : dict
        As a Document gives it. Anything else is refused.
    prefix : str
        The path of the mapping within the file, for messages.
    """

    def __init__(self, where: str, content, prefix: str = ""):
        if not isinstance(content, dict):
            raise InputError(where, prefix or None, content, "named fields are needed here")
        self.where = where
        self.prefix = prefix
        self._content = content

    def __contains__(self, key) -> bool:
        return key in self._content

    def __iter__(self):
        return (key for key in self._content if isinstance(key, str))

    def name(self, key) -> str:
        return f"{self.prefix}.{key}" if self.prefix else str(key)

    def fault(self, key, value, problem: str) -> InputError:
        return InputError(self.where, self.name(key), value, problem)

    def get(self, key):
        if key not in self._content:
            raise self.fault(key, None, "missing")
        return self._content[key]

    def child(self, key) -> "Fields":
        """The mapping under ``key``."""
        return Fields(self.where, self.get(key), self.name(key))

    def children(self, key) -> list["Fields"]:
        """The mappings in the list under ``key``."""
        content = self.get(key)
        if not isinstance(content, list):
            raise self.fault(key, content, "a list is needed here")
        return [Fields(self.where, item, f"{self.name(key)}[{index}]") for index, item in enumerate(content)]

    def numbers(self, *keys) -> list[float]:
        return [self.number(key) for key in keys]

    def number(self, key) -> float:
        value = self.get(key)
        if not checks.is_number(value) or not math.isfinite(value):
            raise self.fault(key, value, "not a finite number")
        return float(value)

    def matrix(self, key, *shape: int, finite: bool = True) -> np.ndarray:
        """float64 of ``shape``, from a flat list in row order, from a list of rows, or from rows, cols and data.

        ``finite``: refuse infinity and NaN.
        """
        value = self._data(key, shape)
        if isinstance(value, list) and len(value) == shape[0] and all(isinstance(row, list) for row in value):
            if any(len(row) != shape[-1] for row in value):
                raise self.fault(key, value, f"{shape[0]} rows of {shape[-1]} numbers are needed")
            value = [item for row in value for item in row]
        return checks.array(self.where, self.name(key), value, shape, finite)

    def vector(self, key, counts: tuple[int, ...]) -> np.ndarray:
        """float64 of shape (n,), n in ``counts``, from a list or from rows, cols and data."""
        value = self._data(key, None)
        if not isinstance(value, list) or len(value) not in counts:
            found = f"{len(value)} values" if isinstance(value, list) else value
            raise self.fault(key, found, f"{' or '.join(map(str, counts))} numbers are needed")
        return checks.array(self.where, self.name(key), value, (len(value),))

    def transform(self, key) -> tuple[np.ndarray, np.ndarray]:
        """R (3, 3) and T (3,) of a 4x4 matrix [R T; 0 0 0 1]; R is the rotation nearest to what is written."""
        matrix = self.matrix(key, 4, 4)
        if np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-9:
            raise self.fault(key, matrix[3].tolist(), "the last row of a transformation must be 0 0 0 1")
        R = checks.rotation(self.where, self.name(key), matrix[:3, :3])
        return checks.nearest_rotation(R), checks.position(self.where, self.name(key), matrix[:3, 3])

    def size(self, key) -> tuple:
        """The two numbers of an image size; Rig checks them."""
        return tuple(checks.whole(self.where, self.name(key), value) for value in self.vector(key, (2,)))

    def _data(self, key, shape):
        value = self.get(key)
        if not isinstance(value, dict):
            return value
        rows, cols = (value.get(side) for side in ("rows", "cols"))
        if shape and (rows, cols) != (shape[0], shape[1] if len(shape) > 1 else 1):
            raise self.fault(key, f"{rows}x{cols}", f"a {'x'.join(map(str, shape))} matrix is needed")
        return value.get("data")
