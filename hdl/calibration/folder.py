"""Folders that are given in place of calibration files: the files in them that can be one."""

from itertools import islice
from pathlib import Path

from hdl.calibration import npzfile
from hdl.calibration.documents import MAX_BYTES, Document
from hdl.errors import InputError

MAX_FILES = 500


def is_folder(path) -> bool:
    """Raises InputError for what cannot be a path."""
    try:
        return Path(path).is_dir()
    except (OSError, ValueError) as error:
        raise InputError(path, None, None, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


def documents(path, recognised) -> list[Document]:
    """The documents in the folder ``path`` that ``recognised`` is true of, by name; if there are none, those in the
    folders right under it, as in an ASL dataset (cam0/sensor.yaml, cam1/sensor.yaml).

    Files that are too large, not text, or links to elsewhere are passed over. Raises InputError if nothing is left.
    """
    folder = Path(path)
    for files in (_files(folder), _files(folder, "*/")):
        if found := [document for document in files if _is(recognised, document)]:
            return found
    raise InputError(folder, None, None, "no calibration file of a known format in this folder")


def _files(folder, below=""):
    try:
        paths = list(islice(folder.glob(f"{below}*"), MAX_FILES + 1))
    except OSError as error:
        raise InputError(folder, None, None, f"cannot be read: {error.strerror}") from None
    if len(paths) > MAX_FILES:
        if below:
            return
        raise InputError(folder, None, None, f"more than {MAX_FILES} files in this folder; name the calibration")
    home = folder.resolve()
    for path in sorted(paths):
        try:
            if path.resolve().is_relative_to(home) and path.is_file() and _may_be_one(path):
                yield Document.open(path)
        except (InputError, OSError, RuntimeError):  # RuntimeError: links in a circle
            continue


def _may_be_one(path):
    size = path.stat().st_size
    if size <= MAX_BYTES:
        return size > 0
    with path.open("rb") as file:  # NumPy's archives may be large, and are not read in whole
        return file.read(len(npzfile.MAGIC)) == npzfile.MAGIC


def _is(recognised, document):
    try:
        return recognised(document)
    except InputError:  # a broken file beside the calibration
        return False
