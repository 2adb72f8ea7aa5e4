"""MATLAB's MAT-files of version 5 to 7.2, read by SciPy, but only what has been walked through here before.

SciPy's reader is written in C for files of good will: it takes dimensions and types on trust, allocates what they ask
for and recurses as deep as cells are nested. So every element is unpacked here within limits, types and counts are
checked, and what is left, plain arrays, text and structs of them, is handed over uncompressed.
Source: MathWorks, "MAT-File Format", 2024.
"""

import io
import struct
import zlib
from dataclasses import dataclass
from math import prod

from hdl.errors import InputError

MAGIC = b"MATLAB "
MAX_UNPACKED = 16 << 20
MAX_DEPTH = 6
MAX_ELEMENTS = 20_000

_VERSION_5 = b"MATLAB 5.0 MAT-file"
_HEADER = 128
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_WIDTHS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # bytes of a number, by type of element
_TEXT_TYPES = {1: 1, 2: 1, 4: 2, 16: 1, 17: 2, 18: 4}
_CELL, _STRUCT, _CHAR = 1, 2, 4
_NUMERIC = range(6, 16)
_COMPLEX = 0x800
_FOREIGN = {3: "object", 5: "sparse matrix", 16: "function handle", 17: "object"}


@dataclass(frozen=True)
class Contents:
    """``variables``: name to number, numpy array, str or dict of these (a struct). ``foreign``: what kinds of variable
    were left out, unread: objects, sparse matrices, function handles."""

    variables: dict
    foreign: frozenset[str]


class _Broken(Exception):
    """The file is not what its format says; ``str`` is what is wrong."""


class _Foreign(Exception):
    """The variable is of a kind that is not read; ``str`` is which."""


def read(where: str, data: bytes) -> Contents:
    """The variables in the MAT-file ``data``. Raises InputError for what is broken, too large or of another version."""
    if not data.startswith(_VERSION_5):
        raise InputError(where, None, None, "not a MAT-file of version 5 to 7.2; in MATLAB: save(..., '-v7')")
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise InputError(where, None, None, "the header of the MAT-file is incomplete")
    walk = _Walk("<" if data[126:128] == b"IM" else ">")
    try:
        matrices, foreign = walk.variables(data[_HEADER:])
    except _Broken as error:
        raise InputError(where, None, None, f"broken MAT-file: {error}") from None
    # Without the offset to subsystem data, which nothing that is left refers to.
    return Contents(_load(where, data[:116] + b" " * 8 + data[124:128] + b"".join(matrices)), frozenset(foreign))


def _load(where, plain):
    from scipy.io import loadmat  # half a second that no other format needs

    try:
        variables = loadmat(io.BytesIO(plain), simplify_cells=True)
    except Exception as error:  # whatever SciPy's reader stumbles over is the file's fault
        raise InputError(where, None, None, f"broken MAT-file: {error}") from None
    return {name: value for name, value in variables.items() if not name.startswith("__")}


class _Walk:
    """Through the elements of a file, counting them."""

    def __init__(self, order):
        self._order = order
        self._elements = 0
        self._unpacked = 0

    def variables(self, data):
        """The bytes of every variable that can be read, uncompressed, and the kinds of the others."""
        matrices, foreign, offset = [], set(), 0
        while offset < len(data):
            kind, body, offset = self._element(data, offset)
            if kind == _COMPRESSED:
                kind, body = self._unpack(body)
            if kind != _MATRIX:
                raise _Broken(f"an element of type {kind} where a variable is due")
            try:
                self._matrix(body, 1)
            except _Foreign as error:
                foreign.add(str(error))
            else:
                matrices.append(struct.pack(self._order + "II", _MATRIX, len(body)) + body)
        return matrices, foreign

    def _unpack(self, packed):
        try:
            data = zlib.decompressobj().decompress(packed, MAX_UNPACKED - self._unpacked + 1)
        except zlib.error as error:
            raise _Broken(error) from None
        self._unpacked += len(data)
        if self._unpacked > MAX_UNPACKED:
            raise _Broken(f"more than {MAX_UNPACKED >> 20} MiB when unpacked")
        kind, body, _ = self._element(data, 0)
        return kind, body

    def _element(self, data, offset):
        """Type, contents, and the offset of the element behind."""
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise _Broken(f"more than {MAX_ELEMENTS} elements")
        if offset + 8 > len(data):
            raise _Broken("it ends within an element")
        kind, size = struct.unpack_from(self._order + "II", data, offset)
        start, padding = offset + 8, 8
        if kind >> 16:
            kind, size, start, padding = kind & 0xFFFF, kind >> 16, offset + 4, 4
            if size > 4:
                raise _Broken("a small element of more than 4 bytes")
        end = start + size
        if end > len(data):
            raise _Broken("it ends within an element")
        after = end if kind == _COMPRESSED else min(start + -(-size // padding) * padding, len(data))
        return kind, data[start:end], after

    def _matrix(self, body, depth):
        if depth > MAX_DEPTH:
            raise _Broken(f"nested more than {MAX_DEPTH} deep")
        flags, offset = self._numbers(body, 0, _UINT32)
        if len(flags) != 2:
            raise _Broken("array flags of the wrong length")
        kind = flags[0] & 0xFF
        if kind in _FOREIGN:
            raise _Foreign(_FOREIGN[kind])
        dims, offset = self._numbers(body, offset, _INT32)
        if len(dims) < 2 or len(dims) > 8 or min(dims) < 0:
            raise _Broken(f"dimensions {list(dims)[:9]}")
        name_type, name, offset = self._element(body, offset)
        if name_type != _INT8 or not name.isascii():
            raise _Broken("a variable without a name in ASCII")
        count = prod(dims)
        if kind in _NUMERIC:
            for _ in range(2 if flags[0] & _COMPLEX else 1):
                offset = self._data(body, offset, count, _WIDTHS)
        elif kind == _CHAR:
            self._data(body, offset, count, _TEXT_TYPES)
        elif kind in (_CELL, _STRUCT):
            self._nested(body, offset, kind, count, depth)
        else:
            raise _Broken(f"an array of class {kind}")

    def _nested(self, body, offset, kind, count, depth):
        if kind == _STRUCT:
            width, offset = self._numbers(body, offset, _INT32)
            names_type, names, offset = self._element(body, offset)
            if len(width) != 1 or names_type != _INT8 or not names.isascii():
                raise _Broken("a struct without names of its fields")
            if not 1 <= width[0] <= 64 or len(names) % width[0]:
                raise _Broken("a struct without names of its fields")
            if not names and count > 1:
                raise _Foreign("struct without fields")
            count *= len(names) // width[0]
        if count * 8 > len(body):
            raise _Broken("more cells than the file has bytes for")
        for _ in range(count):
            inner, content, offset = self._element(body, offset)
            if inner != _MATRIX:
                raise _Broken(f"an element of type {inner} where an array is due")
            if content:  # an empty cell may be empty altogether
                self._matrix(content, depth + 1)

    def _numbers(self, body, offset, expected):
        kind, content, offset = self._element(body, offset)
        if kind != expected or len(content) % 4:
            raise _Broken(f"an element of type {kind} where {expected} is due")
        return struct.unpack(f"{self._order}{len(content) // 4}{'I' if kind == _UINT32 else 'i'}", content), offset

    def _data(self, body, offset, count, widths):
        if count == 0 and offset >= len(body):
            return offset
        kind, content, offset = self._element(body, offset)
        if kind not in widths:
            raise _Broken(f"values of type {kind}")
        fits = len(content) == count * widths[kind] or (kind == 16 and count <= len(content) <= 4 * count)
        if not fits:
            raise _Broken(f"{len(content)} bytes for {count} values")
        return offset
