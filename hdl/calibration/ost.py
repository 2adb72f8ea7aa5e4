"""The oST text that ROS' camera_calibration prints and saves, ost.txt and ost.ini: one or both cameras a file.

Words in lines of their own, and numbers below them; [image] begins a camera. What else a terminal shows before and
between is passed over.
Source: camera_calibration, calibrator.py (lrost); camera_calibration_parsers, parse_ini.cpp.
"""

import re

from hdl.calibration.documents import Document, scalar
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Rig
from hdl.calibration.ros import Info, pair
from hdl.errors import InputError

NAME = "ost"
TITLE = "oST text of ROS' camera_calibration (ost.txt, ost.ini)"
SEVERAL_FILES = True
SELECT = None

_TRAITS = [
    re.compile(rf"^[ \t]*{line}[ \t\r]*$", re.MULTILINE) for line in (r"\[image\]", "camera matrix", "projection")
]
_SECTION = re.compile(r"\[([^\[\]]{1,60})\]")
_SPELLED = {
    "size": ("width", "height"), "K": "camera matrix", "D": "distortion", "R": "rectification", "P": "projection",
    "lens": (),
}  # fmt: skip
_WORDS = ("width", "height", "camera matrix", "distortion", "rectification", "projection")


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document or two. Raises InputError as `ros` does, and unless there are two cameras in all."""
    source = ", ".join(document.name for document in documents)
    cameras = [(document.name, *camera) for document in documents for camera in _cameras(document)]
    if len(cameras) != 2:
        raise InputError(source, None, f"{len(cameras)} cameras", "two are needed, in one file or one a file")
    infos = [Info(Fields(where, content, name), _SPELLED, (f"[{name}]", None)) for where, name, content in cameras]
    return pair(source, infos)


def _cameras(document):
    """Name and entries of each camera."""
    cameras, key = [], None
    for number, line in enumerate(document.text.splitlines(), start=1):
        line = line.strip()
        section = _SECTION.fullmatch(line)
        if section and section.group(1) == "image":
            cameras.append(["", {}])
            key = None
        elif section and cameras:
            cameras[-1][0], key = section.group(1), None
        elif line in _WORDS and cameras:
            key = line
            if key in cameras[-1][1]:
                raise InputError(document.name, f"line {number}", line, "given twice for one camera")
            cameras[-1][1][key] = []
        elif line and line[0] != "#" and key:
            values = [scalar(word) for word in line.split()]
            if any(isinstance(value, str) for value in values):
                key = None
            else:
                cameras[-1][1][key] += values
    return [(name, {key: _lone(key, values) for key, values in entries.items()}) for name, entries in cameras]


def _lone(key, values):
    return values[0] if key in _SPELLED["size"] and len(values) == 1 else values
