"""What RealSense's rs-enumerate-devices -c prints: intrinsics of every stream and size, and extrinsics between them.

The pair is of two streams of one name, numbered 1 and 2: infrared, or the fisheyes of a T265. x_to = R x_from + T, in
metres; R is printed row by row. Infrared images of a D400 are rectified in the camera and have no lens left. Of
Brown-Conrady's model in its plain form projection is OpenCV's; with "Inverse" the coefficients are of the way back.
Source: librealsense, tools/enumerate-devices/rs-enumerate-devices.cpp, src/rs.cpp (rs2_project_point_to_pixel) and
include/librealsense2/h/rs_types.h (rs2_distortion).
"""

import re

import numpy as np

from hdl.calibration import checks, lenses
from hdl.calibration.documents import Document, scalar
from hdl.calibration.rig import Camera, Rig, camera_matrix
from hdl.calibration.selection import one
from hdl.errors import InputError

NAME = "realsense"
TITLE = "RealSense, as rs-enumerate-devices -c prints it"
SEVERAL_FILES = False
SELECT = "a resolution, as in 848x480"

_INTRINSIC = re.compile(r'^[ \t]*Intrinsic of "([^"\n]{1,60})"[ \t]*/[ \t]*([0-9]{1,5}x[0-9]{1,5})[ \t]*/[ \t]*(.*)$')
_EXTRINSIC = re.compile(r'^[ \t]*Extrinsic from "([^"\n]{1,60})"[ \t]+To[ \t]+"([^"\n]{1,60})"')
_OTHER = re.compile(r"^[ \t]*(?:Motion Intrinsic|Extrinsic)\b")
_TRAIT = re.compile(r'^[ \t]*Intrinsic of "[^"\n]{1,60}"[ \t]*/', re.MULTILINE)
_STREAMS = ("Infrared", "Fisheye")
_NUMBERS = ("Width", "Height", "PPX", "PPY", "Fx", "Fy")
_UNDISTORTED, _DISTORTED = "None", {
    "Brown Conrady": ("radtan", 5), "Modified Brown Conrady": ("radtan", 5), "Kannala Brandt4": ("equidistant", 4),
    "Ftheta": ("fov", 1),
}  # fmt: skip
_INVERSE = "Inverse Brown Conrady"


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig of the two streams in one document at the resolution ``select``, otherwise at ``size`` (px), otherwise at
    the largest, with a warning if there are more.

    Raises InputError for a stream or resolution that is not there, and for a lens model that is not OpenCV's.
    """
    (document,) = documents
    intrinsics, extrinsics = _blocks(document)
    streams = [f"{name} {number}" for name in _STREAMS for number in (1, 2)]
    pairs = [pair for pair in zip(streams[::2], streams[1::2]) if all(stream in intrinsics for stream in pair)]
    if not pairs:
        found = ", ".join(intrinsics) or "none"
        problem = "two streams of a pair are needed, Infrared 1 and 2 or Fisheye 1 and 2"
        raise InputError(document.name, "Intrinsic of", found, problem)
    left, right = pairs[0]
    sizes = [name for name in intrinsics[left] if name in intrinsics[right]]
    if not sizes:
        raise InputError(document.name, "Intrinsic of", f"{left}, {right}", "no resolution that both streams have")
    chosen = _resolution(document.name, sizes, size, select)
    cameras = [_camera(document.name, stream, chosen, intrinsics[stream][chosen]) for stream in (left, right)]
    (R, T), spelling = _motion(document.name, extrinsics, left, right)
    roles = dict.fromkeys("RT", (document.name, spelling))
    for number, stream in (("1", left), ("2", right)):
        roles |= {role + number: (document.name, _title(stream, chosen)) for role in "KD"}
        roles["camera" + number] = document.name, f'"{stream}"'
    roles["size"] = roles["K1"]
    rig = Rig(document.name, *map(int, chosen.split()[0].split("x")), *cameras, R, T, unit="m", fields=roles)
    if size is None and select is None and len(sizes) > 1:
        problem = f"the largest of {', '.join(sizes)}; choose another with --select or --size"
        rig = rig.warned("size", None, problem)
    return rig


def _title(stream, chosen):
    return f'Intrinsic of "{stream}" / {chosen}'


def _resolution(where, sizes, size, select):
    if select is not None:
        return one(select, sizes)
    if size is None:
        return max(sizes, key=lambda name: int(name.split()[0].split("x")[0]) * int(name.split()[0].split("x")[1]))
    name = f"{size[0]}x{size[1]}"
    if name in sizes:
        return name
    problem = f"no intrinsics for it in {where}: {', '.join(sizes)}; name the one to be scaled with --select"
    raise InputError("--size", None, name, problem)


def _blocks(document):
    """Stream to resolution to lines of its block, and (from, to) to lines.

    Where a stream has one size twice, with numbers that differ by the format of its pixels, these belong to the name.
    """
    intrinsics, extrinsics, lines = {}, {}, []
    for line in document.text.splitlines():
        if found := _INTRINSIC.match(line):
            stream, size, formats = found.groups()
            lines = []
            intrinsics.setdefault(stream, {}).setdefault(size, []).append((formats.strip(), lines))
        elif found := _EXTRINSIC.match(line):
            if found.groups() in extrinsics:
                stream = found.group(1)
                problem = "given twice: the text of one device is needed"
                raise InputError(document.name, f'Extrinsic from "{stream}"', None, problem)
            lines = extrinsics[found.groups()] = []
        elif _OTHER.match(line):
            lines = []
        else:
            lines.append(line)
    named = {}
    for stream, sizes in intrinsics.items():
        named[stream] = {}
        for size, blocks in sizes.items():
            blocks = [block for block in blocks if not any("NOT available" in line for line in block[1])]
            named[stream] |= {f"{size} {formats}" if len(blocks) > 1 else size: lines for formats, lines in blocks}
    return {stream: sizes for stream, sizes in named.items() if sizes}, extrinsics


def _camera(where, stream, chosen, lines):
    entries = {key.strip(): value.split() for key, colon, value in (line.partition(":") for line in lines) if colon}
    title = _title(stream, chosen)
    width, height, *K = (
        checks.array(where, f"{title}: {key}", [scalar(word) for word in entries.get(key, ())], (1,))[0]
        for key in _NUMBERS
    )
    if chosen.split()[0] != f"{width:g}x{height:g}":
        raise InputError(where, f"{title}: Width, Height", f"{width:g}x{height:g}", "not the size in the line above")
    values = [scalar(word) for word in entries.get("Coeffs", ())]
    D = checks.array(where, f"{title}: Coeffs", values, (5,))
    kind = " ".join(entries.get("Distortion", ()))
    cx, cy, fx, fy = K
    model, D = _lens(where, f"{title}: Distortion", kind, D)
    return Camera(model, camera_matrix(fx, fy, cx, cy), D)


def _lens(where, field, kind, D):
    """The model and the coefficients in use."""
    if kind in (_UNDISTORTED, _INVERSE, *_DISTORTED) and not D.any() and kind != "Kannala Brandt4":
        return "radtan", np.zeros(0)
    if kind == _INVERSE:
        problem = "its coefficients lead from the image to the ray; a rectifier needs those from the ray to the image"
        raise InputError(where, field, kind, problem)
    if kind == "Modified Brown Conrady" and D[2:4].any():
        raise InputError(where, field, kind, "with tangential terms it is not OpenCV's model")
    if kind not in _DISTORTED:
        raise InputError(where, field, kind, f"the models known are {', '.join((_UNDISTORTED, *_DISTORTED))}")
    model, count = _DISTORTED[kind]
    if D[count:].any():
        raise InputError(where, field, kind, f"has {count} coefficients that are not zero")
    return lenses.model(where, field, model, D[:count]), D[:count]


def _motion(where, extrinsics, left, right):
    """R and T from left to right, and the entry."""
    title = f'Extrinsic from "{left}" To "{right}"'
    lines = extrinsics.get((left, right))
    if lines is None:
        raise InputError(where, title, None, "missing; rs-enumerate-devices prints it with -c")
    text = " ".join(lines)
    R_words = text.partition("Rotation Matrix:")[2].partition("Translation Vector:")[0].split()
    T_words = text.partition("Translation Vector:")[2].split()[:3]
    R = checks.array(where, f"{title}: Rotation Matrix", [scalar(word) for word in R_words], (3, 3))
    T = checks.array(where, f"{title}: Translation Vector", [scalar(word) for word in T_words], (3,))
    R = checks.nearest_rotation(checks.rotation(where, f"{title}: Rotation Matrix", R))
    return (R, checks.position(where, f"{title}: Translation Vector", T)), title
