"""Calibration files for the tests: one made-up rig, written as cv::FileStorage writes it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from hdl.calibration import load
from hdl.errors import InputError
from hdl.geometry.rectification import rectify

RIG = {
    "image_width": 640,
    "image_height": 480,
    "M1": (3, 3, ["500.25", "0.", "320.5", "0.", "501.75", "240.125", "0.", "0.", "1."]),
    "D1": (1, 5, ["-0.25", "0.0625", "1.e-003", "-5.0000000000000001e-04", "0."]),
    "M2": (3, 3, ["498.5", "0.", "316.75", "0.", "497.25", "236.5", "0.", "0.", "1."]),
    "D2": (1, 5, ["-0.26", "0.07", "-1.e-003", "2.e-004", "0.01"]),
    "R": (3, 3, ["0.9998", "-0.0199986667", "0.", "0.0199986667", "0.9998", "0.", "0.", "0.", "1."]),
    "T": (3, 1, ["-100.", "1.5", "-0.5"]),
}
EYE = ["1.", "0.", "0.", "0.", "1.", "0.", "0.", "0.", "1."]
RECTIFICATION = {  # with the T that it is of
    "T": (3, 1, ["-99.98", "-1.99986667", "0."]),
    "R1": (3, 3, EYE),
    "R2": (3, 3, ["0.9998", "0.0199986667", "0.", "-0.0199986667", "0.9998", "0.", "0.", "0.", "1."]),
    "P1": (3, 4, ["450.", "0.", "300.", "0.", "0.", "450.", "250.", "0.", "0.", "0.", "1.", "0."]),
    "P2": (3, 4, ["450.", "0.", "300.", "-45000.", "0.", "450.", "250.", "0.", "0.", "0.", "1.", "0."]),
}
INTRINSICS = {name: RIG[name] for name in ("M1", "D1", "M2", "D2")}
EXTRINSICS = {name: RIG[name] for name in ("R", "T")}


def as_yaml(fields, header="%YAML:1.0\n---\n"):
    lines = []
    for name, value in fields.items():
        if isinstance(value, tuple):
            rows, cols, data = value
            lines.append(f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d")
            lines.append(f"   data: [ {', '.join(data)} ]")
        else:
            lines.append(f"{name}: {value}")
    return header + "\n".join(lines) + "\n"


def as_xml(fields):
    lines = ['<?xml version="1.0"?>', "<opencv_storage>"]
    for name, value in fields.items():
        if isinstance(value, tuple):
            rows, cols, data = value
            lines.append(f'<{name} type_id="opencv-matrix">\n  <rows>{rows}</rows>\n  <cols>{cols}</cols>')
            lines.append(f"  <dt>d</dt>\n  <data>\n    {' '.join(data)}</data></{name}>")
        else:
            lines.append(f"<{name}>{value}</{name}>")
    return "\n".join([*lines, "</opencv_storage>\n"])


def write(content, name="rig.yml"):
    """Writes a file into the current directory, so that messages name it without its folder."""
    Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return name


# What follows a fault in the file's own rectification, which is refused where that is wanted.
UNUSED = "; --alpha 0 or --fov 65 would do"


def refusal(*paths, **options):
    """The line that says why a calibration cannot be read, or not be rectified as it stands; ``options``: of load."""
    with pytest.raises(InputError) as caught:
        rectify(load(*paths, **options), lens=True)
    message = str(caught.value)
    assert "\n" not in message
    return message


def turn(*vector):
    """The rotation, (3, 3), by a vector."""
    return cv2.Rodrigues(np.array(vector, dtype=float))[0]


def transform(R, T):
    """[R T; 0 0 0 1]."""
    return np.vstack([np.column_stack([R, T]), [0, 0, 0, 1]])
