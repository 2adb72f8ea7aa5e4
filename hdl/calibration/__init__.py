"""Stereo calibrations: one rig, whatever program wrote the file.

A further format is one module with ``NAME``, ``recognises(document)`` and ``read(documents, size)``, and its entry in
``FORMATS``. The format is chosen by content, never by the name of a file.
"""

from importlib import resources

from hdl.calibration import checks, opencv
from hdl.calibration.documents import Document
from hdl.calibration.rig import SIDES, Camera, Rig
from hdl.errors import InputError

__all__ = ["FORMATS", "SIDES", "Camera", "Rig", "embedded", "load"]

FORMATS = (opencv,)

_EMBEDDED = "opencv_samples.yml"


def load(path, *more, size: tuple[int, int] | None = None) -> Rig:
    """The rig in one calibration file, or in several that belong together, checked.

    Parameters
    ----------
    path, *more : str or Path
        In any order.
    size : (width, height), optional
        The frame size in px. A calibration of another size is scaled to it; one that states none is taken to be of it.

    Raises
    ------
    InputError
        For anything that is wrong with the files: one line that names file, field and value.
    """
    return _rig([Document.open(name) for name in (path, *more)], size)


def embedded(size: tuple[int, int] | None = None) -> Rig:
    """The default rig: OpenCV's sample pair, 640x480, scaled to ``size`` if given."""
    text = resources.files(__package__).joinpath(_EMBEDDED).read_text(encoding="utf-8")
    return _rig([Document(_EMBEDDED, text)], size)


def _rig(documents, size):
    if size is not None:
        size = checks.image_size("--size", None, *size)
    rig = checks.check(_format(documents).read(documents, size))
    return rig.scaled(*size) if size else rig


def _format(documents):
    for candidate in FORMATS:
        if all(candidate.recognises(document) for document in documents):
            return candidate
    for document in documents:
        if not any(candidate.recognises(document) for candidate in FORMATS):
            known = ", ".join(candidate.NAME for candidate in FORMATS)
            raise InputError(document.name, None, None, f"not a stereo calibration in a known format: {known}")
    names = ", ".join(document.name for document in documents)
    raise InputError(names, None, None, "files of different calibration formats")
