"""Stereo calibrations: one rig, whatever program wrote the file.

A further format is one module and its entry in ``FORMATS``. The module has

    NAME            for the option --format
    TITLE           for people
    SEVERAL_FILES   whether one rig may be spread over several files
    SELECT          what ``select`` chooses in such a file, or None if there is nothing to choose
    recognises      document to bool: by content, never by the name of a file
    read            (documents, size, select) to Rig
    accompanies     document to bool, if any do: by itself not of the format, but read with files that are
"""

from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import ModuleType

from hdl.calibration import (
    aslam,
    basalt,
    bouguet,
    checks,
    depthai,
    euroc,
    folder,
    kalibr,
    kitti,
    matlab,
    mynt,
    okvis,
    opencv,
    orbslam,
    orbslam3,
    ost,
    ov2slam,
    plain,
    realsense,
    ros,
    ros_message,
    stella,
    suspicions,
    unnamed_lens,
    unreadable,
    vins,
    zed,
    zed_opencv,
)
from hdl.calibration.documents import Document
from hdl.calibration.rig import SIDES, STRETCH, Camera, Rig, stretch
from hdl.errors import InputError

__all__ = ["FORMATS", "SIDES", "Camera", "Rig", "embedded", "load"]

# The first that recognises a file reads it. OpenCV's come last: others are written in its YAML too.
FORMATS = (
    ros, ros_message, ost, euroc, kalibr, kitti, basalt, depthai, realsense, zed, zed_opencv, mynt, orbslam, orbslam3,
    ov2slam, okvis, aslam, vins, stella, bouguet, matlab, plain, opencv,
)  # fmt: skip

_EMBEDDED = "opencv_samples.yml"
_EXAMPLE = "the embedded example rig"


def load(
    path: str | Path,
    *more: str | Path,
    size: tuple[int, int] | None = None,
    format: str | None = None,
    select: str | None = None,
    lens_model: str | None = None,
) -> Rig:
    """The rig in one calibration file, or in several that belong together, checked.

    Parameters
    ----------
    path, *more : str or Path
        In any order. A folder stands for the calibration files in it.
    size : (width, height), optional
        The frame size in px. A calibration of another size is scaled to it, both cameras of it where they have two;
        one that states none is taken to be of it; of one with several resolutions it chooses the one.
    format : str, optional
        NAME of the format that the files are in, for files that are not recognised, or as two formats.
    select : str, optional
        Which cameras or which resolution of a file that holds more than one pair; see SELECT of the format.
    lens_model : str, optional
        A name in LENS_MODELS: the lens of both cameras, where the file does not say what its coefficients are of.

    Raises
    ------
    InputError
        For anything that is wrong with the files: one line that names file, field and value.
    """
    reader = _forced(format)
    recognised = reader.recognises if reader else _recognised
    documents, folders = [], [name for name in (path, *more) if folder.is_folder(name)]
    for name in (path, *more):
        documents += folder.documents(name, recognised) if name in folders else [Document.open(name)]
    for document in documents:
        unreadable.refuse(document)
    reader = reader or _format(documents, folders)
    if len(documents) > 1 and not reader.SEVERAL_FILES:
        problem = f"several calibrations ({reader.TITLE}), each complete in itself; name one"
        raise InputError(_names(documents), None, None, problem)
    return _rig(reader, documents, size, select, lens_model)


def embedded(size: tuple[int, int] | None = None) -> Rig:
    """The default rig: OpenCV's sample pair, 640x480, scaled to ``size`` if given."""
    text = resources.files(__package__).joinpath(_EMBEDDED).read_text(encoding="utf-8")
    rig = _rig(opencv, [Document(_EMBEDDED, text)], size)
    entries = {f"camera{number}": (_EXAMPLE, f"M{number}") for number in "12"}
    return replace(rig, fields={**rig.fields, **entries})


def _rig(
    reader: ModuleType,
    documents: list[Document],
    size: tuple[int, int] | None,
    select: str | None = None,
    lens_model: str | None = None,
) -> Rig:
    if size is not None:
        size = checks.image_size("--size", None, *size)
    if select is not None and not reader.SELECT:
        raise InputError("--select", None, select, f"there is nothing to choose in a calibration of {reader.TITLE}")
    rig = unnamed_lens.chosen(reader.read(documents, size, select), lens_model)
    rig = suspicions.settled(unnamed_lens.guessed(checks.check(rig)))
    rig = replace(rig, format=reader.NAME)
    return _scaled(rig, *size) if size else rig


def _scaled(rig: Rig, width: int, height: int) -> Rig:
    scaled = rig.scaled(width, height)
    for size in dict.fromkeys((rig.left.size, rig.right.size)):
        share = stretch(size, (width, height))
        if share > STRETCH:
            problem = (
                f"stretches the {size[0]}x{size[1]} images by {100 * share:.0f} %; "
                "where a sensor crops them the calibration needs another principal point instead"
            )
            scaled = scaled.warned_as(InputError("--size", None, f"{width}x{height}", problem))
    return scaled


def _forced(format: str | None) -> ModuleType | None:
    if format is None:
        return None
    for candidate in FORMATS:
        if candidate.NAME == format:
            return candidate
    raise InputError("--format", None, format, f"the formats are {_known()}")


def _recognised(document: Document) -> bool:
    return any(candidate.recognises(document) or _accompanies(candidate, document) for candidate in FORMATS)


def _accompanies(candidate: ModuleType, document: Document) -> bool:
    return hasattr(candidate, "accompanies") and candidate.accompanies(document)


def _format(documents: list[Document], folders: list[str | Path]) -> ModuleType:
    for candidate in FORMATS:
        recognised = [candidate.recognises(document) for document in documents]
        others = [document for document, itself in zip(documents, recognised) if not itself]
        if any(recognised) and all(_accompanies(candidate, document) for document in others):
            return candidate
    groups: dict[str, list[Document]] = {}
    for document in documents:
        name = next((candidate.NAME for candidate in FORMATS if candidate.recognises(document)), None)
        if name is None:
            problem = f"not a stereo calibration in a known format: {_known()}"
            raise InputError(document.name, None, None, problem)
        groups.setdefault(name, []).append(document)
    described = "; ".join(f"{name}: {_names(group)}" for name, group in groups.items())
    problem = "files of different calibration formats; name those of one"
    if folders:  # of files that were named none is left out
        problem += ", or choose it with --format"
    raise InputError(described, None, None, problem)


def _known() -> str:
    return ", ".join(candidate.NAME for candidate in FORMATS)


def _names(documents: list[Document], most: int = 4) -> str:
    names = [document.name for document in documents]
    return ", ".join(names if len(names) <= most else [*names[: most - 1], f"{len(names) - most + 1} more"])
