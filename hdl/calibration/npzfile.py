"""NumPy's archives, .npz: their small arrays, and never a pickle.

np.load maps what the archive says onto memory before it looks at what is there. So the directory is looked through
first, large members, such as rectification maps, are left alone, and of the small ones only those are handed to NumPy
whose header and length agree.
Source: numpy.lib.format; PKWARE, "APPNOTE.TXT - .ZIP File Format Specification", 4.3.
"""

import io
import struct
import zipfile
from math import prod

import numpy as np

from hdl.errors import InputError

MAGIC = b"PK\x03\x04"
MAX_MEMBERS = 256
MAX_MEMBER = 1 << 16  # bytes; matrices have a few hundred
PICKLED = "a pickled object, which is never loaded"

_END = struct.Struct("<4s4H2LH")
_END_MAGIC, _END_MAGIC_64, _LOCATOR_64 = b"PK\x05\x06", b"PK\x06\x07", 20
_SUFFIX = ".npy"


def read(where: str, file) -> dict:
    """Name to number, list of numbers, str, or `PICKLED`, of the arrays in the open ``file``.

    What is larger than MAX_MEMBER is left out. Raises InputError for a file that is broken or no such archive.
    """
    try:
        _check_directory(file)
        with zipfile.ZipFile(file) as archive:
            members = [info for info in archive.infolist() if info.filename.endswith(_SUFFIX)]
            small = [info for info in members if info.file_size <= MAX_MEMBER and not info.flag_bits & 1]
            arrays = {info.filename.removesuffix(_SUFFIX): _array(archive, info) for info in small}
    except Exception as error:  # whatever zipfile and NumPy stumble over is the file's fault
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(where, None, None, f"not a NumPy archive, or a broken one: {reason}") from None
    if not members:
        raise InputError(where, None, None, "not a NumPy archive: there are no arrays in it")
    return arrays


def _check_directory(file):
    """zipfile reads the whole directory, however large it is."""
    size = file.seek(0, io.SEEK_END)
    tail = max(0, size - _END.size - _LOCATOR_64)
    file.seek(tail)
    content = file.read()
    magic, *_, members, length, _, comment = _END.unpack(content[-_END.size :])
    if magic != _END_MAGIC or comment or content.startswith(_END_MAGIC_64):
        raise ValueError("it does not end in a directory as NumPy writes it")
    if members > MAX_MEMBERS or length > 256 * MAX_MEMBERS:
        raise ValueError(f"more than {MAX_MEMBERS} arrays")


def _array(archive, info):
    with archive.open(info) as member:
        data = member.read(MAX_MEMBER + 1)
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read_header(stream)
    if dtype.hasobject:
        return PICKLED
    if dtype.kind not in "biufU":
        return f"an array of {dtype}"
    if prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError(f"{info.filename} has {len(data) - stream.tell()} bytes for {dtype} of shape {shape}")
    stream.seek(0)
    return np.load(stream, allow_pickle=False).tolist()
