"""Stereolabs' SNxxxx.conf: both cameras at several resolutions, in sections such as [LEFT_CAM_HD], and [STEREO].

The rotation vector from left to right is (RX, CV, RZ). Stereolabs' own code hands T = (Baseline, TY, TZ), in
millimetres, to cv2.stereoRectify, where the place of the right camera has the opposite sign in x_right = R x_left + T;
rectification is the same for T and -T.
Source: zed-open-capture, examples/include/calibration.hpp; docs.stereolabs.com, "Camera calibration".
"""

import re

import cv2
import numpy as np

from hdl.calibration.documents import Document, scalar
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model
from hdl.calibration.selection import one
from hdl.errors import InputError

NAME = "zed"
TITLE = "ZED factory calibration (SNxxxx.conf)"
SEVERAL_FILES = False
SELECT = "a resolution, as in HD"

SIZES = {
    "2K": (2208, 1242),
    "FHD1200": (1920, 1200),
    "FHD": (1920, 1080),
    "HD": (1280, 720),
    "SVGA": (960, 600),
    "VGA": (672, 376),
}
_TRAIT = re.compile(r"^\[LEFT_CAM_\w+\]", re.MULTILINE | re.IGNORECASE)
_REQUIRED = ("k1", "k2", "p1", "p2", "k3")
_FURTHER = (("k4", "k5", "k6"), ("s1", "s2", "s3", "s4"))


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig in one document at the resolution ``select``, otherwise at the one that ``size`` (px) is of, otherwise at
    the first one, with a warning.

    Raises InputError for a missing field and a size that the file has no section for.
    """
    (document,) = documents
    sections = _sections(document)
    prefix = "LEFT_CAM_"
    names = [name[len(prefix) :] for name in sections if name.startswith(prefix) and name[len(prefix) :] in SIZES]
    if not names:
        raise InputError(document.name, None, None, f"no section of a known resolution: {', '.join(SIZES)}")
    resolution = _resolution(document.name, names, size, select)
    (left, K1, D1), (right, K2, D2) = (_camera(sections, f"{side}_CAM_{resolution}") for side in ("LEFT", "RIGHT"))
    stereo = _section(sections, "STEREO")
    turn = np.array([stereo.number(f"{axis}_{resolution}".lower()) for axis in ("RX", "CV", "RZ")])
    if not np.abs(turn).max() <= np.pi:
        raise stereo.fault(f"RX, CV, RZ_{resolution}", turn.tolist(), "angles in rad are needed")
    offsets = [f"{axis}_{resolution}".lower() for axis in ("TY", "TZ")]
    offsets = [key if key in stereo else key[:2] for key in offsets]
    T = -np.array([stereo.number(key) for key in ("baseline", *offsets)]) / 1000
    roles = {"R": "CV_" + resolution, "T": "Baseline"}
    fields = {role: (document.name, f"STEREO.{key}") for role, key in roles.items()}
    fields["size"] = document.name, left.prefix
    for number, section in (("1", left), ("2", right)):
        fields |= {role + number: (document.name, section.prefix) for role in "KD"}
    lefty, righty = (Camera(polynomial_model(D), K, D) for K, D in ((K1, D1), (K2, D2)))
    R = cv2.Rodrigues(turn)[0]
    rig = Rig(document.name, *SIZES[resolution], lefty, righty, R, T, unit="m", fields=fields)
    if size is None and select is None and len(names) > 1:
        problem = f"the first of {', '.join(names)}; choose another with --select or --size"
        rig = rig.warned_as(InputError(document.name, left.prefix, None, problem))
    return rig


def _resolution(where, names, size, select):
    if select is not None:
        return one(select, names)
    if size is None:
        return names[0]
    for name in names:
        if SIZES[name] == tuple(size):
            return name
    there = ", ".join(f"{name} ({SIZES[name][0]}x{SIZES[name][1]})" for name in names)
    problem = f"no section for it in {where}: {there}; name the one to be scaled with --select"
    raise InputError("--size", None, f"{size[0]}x{size[1]}", problem)


def _sections(document):
    """Section, in capitals, to its entries, by keys in small letters.

    Not by configparser, whose time grows with the square of the number of lines that it cannot read.
    """
    sections = {}
    for number, line in enumerate(document.text.splitlines(), start=1):
        line = line.strip()
        if not line or line[0] in "#;":
            continue
        key, equals, value = line.partition("=")
        key = key.strip().lower()
        if line[0] == "[" and line[-1] == "]":
            name = line[1:-1].strip().upper()
            if name in sections:
                raise InputError(document.name, name, None, f"given twice, again in line {number}")
            content = sections[name] = {}
        elif not equals or not sections:
            raise InputError(document.name, f"line {number}", line, "not of the form KEY=VALUE in a [SECTION]")
        elif key in content:
            raise InputError(document.name, f"{name}.{key}", None, f"given twice, again in line {number}")
        else:
            content[key] = scalar(value.strip())
    return {name: Fields(document.name, content, name) for name, content in sections.items()}


def _section(sections, name):
    if name not in sections:  # there is one at least, of the left camera
        raise InputError(next(iter(sections.values())).where, name, None, "the section is missing")
    return sections[name]


def _camera(sections, name):
    """The section, K and D."""
    fields = _section(sections, name)
    fx, fy, cx, cy = (fields.number(key) for key in ("fx", "fy", "cx", "cy"))
    names = list(_REQUIRED)
    for group in _FURTHER:
        if any(key in fields for key in group):
            names += group
    if "s1" in names and "k4" not in names:
        raise fields.fault("k4", None, "missing beside s1")
    D = np.array([fields.number(key) for key in names])
    return fields, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), D
