"""Stereolabs' SNxxxx.conf: both cameras at several resolutions, in sections such as [LEFT_CAM_HD], and [STEREO].

The rotation vector from left to right is (RX, CV, RZ), and T = (-Baseline, TY, TZ) in millimetres: the file has the
length of the baseline, and the other two as they are in x_right = R x_left + T. The first cameras have no TY and TZ.

The lens of all resolutions is in [LEFT_DISTO] and [RIGHT_DISTO], k1 k2 p1 p2 k3 k4 k5 k6 or, for fisheyes, k1 to k4;
before SDK 3.5 it was in each camera's sections, with five coefficients or fewer.
Source: zed-opencv-calibration, opencv_calibration.hpp (StereoCalib::setFrom) and saveCalibZED; zed-open-capture,
examples/include/calibration.hpp; docs.stereolabs.com, "Camera calibration".
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
    "4K": (3840, 2160),
    "QHDPLUS": (3200, 1800),
    "2K": (2208, 1242),
    "FHD1200": (1920, 1200),
    "FHD": (1920, 1080),
    "HD": (1280, 720),
    "SVGA": (960, 600),
    "VGA": (672, 376),
}
_TRAIT = re.compile(r"^\[LEFT_CAM_\w+\]", re.MULTILINE | re.IGNORECASE)
_FISHEYE = ("k1", "k2", "k3", "k4")
_NO_FISHEYE = ("p1", "p2", "k5", "k6")  # which are zero, or not there, where the lens is one
_GROUPS = (("k1", "k2"), ("p1", "p2"), ("k3",), ("k4", "k5", "k6"), ("s1", "s2", "s3", "s4"))  # in the order of D


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
    cameras = {side: _section(sections, f"{side}_CAM_{resolution}") for side in ("LEFT", "RIGHT")}
    lenses = {side: sections.get(f"{side}_DISTO", section) for side, section in cameras.items()}
    left, right = (_camera(cameras[side], lens) for side, lens in lenses.items())
    R, T = _motion(_section(sections, "STEREO"), resolution)
    fields = {"size": (document.name, cameras["LEFT"].prefix)}
    fields |= {"R": (document.name, f"STEREO.CV_{resolution}"), "T": (document.name, "STEREO.Baseline")}
    for number, side in (("1", "LEFT"), ("2", "RIGHT")):
        fields["K" + number] = document.name, cameras[side].prefix
        fields["D" + number] = document.name, lenses[side].prefix
    rig = Rig(document.name, *SIZES[resolution], left, right, R, T, unit="m", fields=fields)
    for side, lens in lenses.items():
        passed_over = cameras[side]
        if _given(passed_over) not in ({}, _given(lens)):
            problem = f"taken, and not the lens in {passed_over.prefix}, as the SDK does from version 3.5 on"
            rig = rig.warned_as(InputError(document.name, lens.prefix, None, problem))
    if size is None and select is None and len(names) > 1:
        problem = f"the first of {', '.join(names)}; choose another with --select or --size"
        rig = rig.warned("size", None, problem)
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


def _motion(stereo, resolution):
    """R and T, m."""
    turn = np.array([stereo.number(f"{axis}_{resolution}".lower()) for axis in ("RX", "CV", "RZ")])
    if not np.abs(turn).max() <= np.pi:
        raise stereo.fault(f"RX, CV, RZ_{resolution}", turn.tolist(), "angles in rad are needed")
    offsets = []
    for axis in ("ty", "tz"):
        found = [key for key in (f"{axis}_{resolution}".lower(), axis) if key in stereo]
        offsets.append(stereo.number(found[0]) if found else 0.0)
    return cv2.Rodrigues(turn)[0], np.array([-stereo.number("baseline"), *offsets]) / 1000


def _camera(section, lens):
    fx, fy, cx, cy = (section.number(key) for key in ("fx", "fy", "cx", "cy"))
    model, D = _lens(lens)
    return Camera(model, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), D)


def _given(section):
    """The lens coefficients in a section by their names, as they are."""
    return {key: section.get(key) for group in _GROUPS for key in group if key in section}


def _lens(section):
    """The model and D. Groups of coefficients that are not there are zero."""
    given = {key: section.number(key) for key in _given(section)}
    if set(_FISHEYE) <= set(given) and not any(given.get(key) for key in _NO_FISHEYE):
        # With all eight there, the SDK takes them for a fisheye's if p1 and p2 are zero, and k3 and k4 are not.
        if len(given) == len(_FISHEYE) or given["k3"] and given["k4"]:
            return "equidistant", np.array([given[key] for key in _FISHEYE])
    there = [not given.keys().isdisjoint(group) for group in _GROUPS]
    there[0] = True
    D = []
    for index, group in enumerate(_GROUPS):
        if there[index]:
            D += [section.number(key) for key in group]
        elif index == 1 or any(there[index:]):
            D += [0.0] * len(group)
    return polynomial_model(np.array(D)), np.array(D)
