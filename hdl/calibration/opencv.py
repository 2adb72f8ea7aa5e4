"""Calibrations in cv::FileStorage form: YAML, XML or JSON, in one file or spread over several.

OpenCV's stereo_calib sample writes intrinsics.yml (M1, D1, M2, D2) and extrinsics.yml (R, T, R1, R2, P1, P2, Q), and
nowhere the image size. Other programs write one file, often with K1 for M1. Matrices are cv::Mat; cv::Vec, cv::Point,
cv::Size and std::vector come as plain sequences, which here stand for a row, a column or a matrix row by row.
Source: cv::FileStorage and samples/cpp/stereo_calib.cpp of OpenCV 4 and 5. cv2.FileStorage itself is not used, because
broken files can take the interpreter down with it.
"""

import re
from dataclasses import replace

import numpy as np

from hdl.calibration import checks, lenses, matrices, motion, unnamed_lens
from hdl.calibration.documents import Document
from hdl.calibration.rig import SIDES, Camera, Rig, unless_faulty
from hdl.errors import InputError

NAME = "opencv"
TITLE = "OpenCV FileStorage (YAML, XML, JSON)"
SEVERAL_FILES = True
SELECT = None

SPELLINGS = {
    "K1": ("M1", "K1", "camera_matrix_left", "camera_matrix_1"),
    "D1": ("D1", "dist_coeffs_left", "distortion_coeffs_left", "distortion_coefficients_1", "lens1"),
    "K2": ("M2", "K2", "camera_matrix_right", "camera_matrix_2"),
    "D2": ("D2", "dist_coeffs_right", "distortion_coeffs_right", "distortion_coefficients_2", "lens2"),
    "R": ("R", "rotation_matrix"),
    "T": ("T", "translation_vector"),
    "R1": ("R1", "rectification_transform_left"),
    "R2": ("R2", "rectification_transform_right"),
    "P1": ("P1", "projection_matrix_left"),
    "P2": ("P2", "projection_matrix_right"),
    "size": ("image_size", "imageSize", "ImageSize", "imgSize", "img_size", "Size", "size"),
    "model": ("model", "distortion_model"),
    "fisheye": ("fisheye_model",),  # 0 or 1, as OpenCV's camera_calibration sample writes it
    "unit": ("unit",),  # as this project writes it
    "xi1": ("xi1", "XI1", "xi_1", "xi_left"),  # cv::omnidir, and its omni_stereo_calibration sample
    "xi2": ("xi2", "XI2", "xi_2", "xi_right"),
    "xi": ("xi", "XI"),
    "motion": ("extrinsic_parameters",),  # of that sample: rotation vector and T
}
SIZE_PAIRS = (
    ("image_width", "image_height"),
    ("image_Width", "image_Height"),
    ("imageWidth", "imageHeight"),
    ("img_width", "img_height"),
    ("width", "height"),
)

_CAMERA_MATRICES = "|".join(SPELLINGS["K1"] + SPELLINGS["K2"])
_TRAITS = re.compile(rf'opencv-matrix|<opencv_storage|^[ \t]*"?(?:{_CAMERA_MATRICES})"?[ \t]*:', re.MULTILINE)
_HINTS = {
    "K1": " (stereo_calib writes it to intrinsics.yml)",
    "R": " (stereo_calib writes it to a second file, extrinsics.yml)",
    "R1": "; R1, R2, P1 and P2 belong together",
}
_HINTS |= dict.fromkeys(("K2", "D1", "D2"), _HINTS["K1"]) | {"T": _HINTS["R"]}
_HINTS |= dict.fromkeys(("R2", "P1", "P2"), _HINTS["R1"])


def recognises(document: Document) -> bool:
    return bool(_TRAITS.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in ``documents``, in any order. ``size`` (width, height in px) serves where they do not state one.

    Raises InputError for a field that is missing, given twice with different values, or not of its shape.
    """
    storage = _Storage(documents)
    left, right = (storage.camera(number) for number in "12")
    R, T = storage.pose()
    rectification, fault = unless_faulty(storage.rectification)
    width, height = storage.size(size)
    unit = storage.find("unit")
    return Rig(
        source=storage.source,
        width=width,
        height=height,
        left=left,
        right=right,
        R=R,
        T=T,
        unit="m" if unit and unit[2] == "m" else None,
        rectification=rectification,
        rectification_fault=fault,
        fields=storage.fields,
    )


def _essence(value):
    """What two files have to agree in, whichever of YAML, XML and JSON each is."""
    return repr([value.get(key) for key in ("rows", "cols", "data")] if isinstance(value, dict) else value)


class _Storage(matrices.Entries):
    """The top-level fields of all documents together, found by role; ``fields`` remembers what was found where."""

    def __init__(self, documents):
        self.source = ", ".join(document.name for document in documents)
        self.fields = {}
        self._found = {}  # name to (file, name, value)
        names = [name for group in (*SPELLINGS.values(), *SIZE_PAIRS) for name in group]
        for document in documents:
            content = document.xml if document.text.lstrip().startswith("<") else document.yaml
            for name in names:
                if name not in content:
                    continue
                where, _, value = self._found.setdefault(name, (document.name, name, content[name]))
                if _essence(value) != _essence(content[name]):
                    raise InputError(document.name, name, None, f"differs from the {name} in {where}")

    def find(self, role):
        """(file, name, value) of ``role``, or None."""
        found = [self._found[name] for name in SPELLINGS[role] if name in self._found]
        if not found:
            return None
        where, name, _ = found[0]
        if len(found) > 1:
            raise InputError(where, name, None, f"also given as {found[1][1]}; keep one of them")
        self.fields[role] = where, name
        return found[0]

    def camera(self, number):
        """The left camera by "1", the right one by "2"."""
        K, D = self.matrix("K" + number, 3, 3), self.vector("D" + number, unnamed_lens.COUNTS)
        if found := self.find("xi"):
            raise InputError(*found, "of which camera? an omnidirectional pair has xi1 and xi2")
        if self.find("xi1") or self.find("xi2"):
            return Camera("mei", K, np.concatenate([self.number("xi" + number), D]))
        stated, fisheye = self.find("model"), self.find("fisheye")
        if fisheye and fisheye[2] not in (0, 1):
            raise InputError(*fisheye, "0 or 1 is needed")
        if fisheye and fisheye[2]:
            return Camera("equidistant", K, D)
        if stated:
            return Camera(lenses.model(*stated, D), K, D)
        return replace(unnamed_lens.camera(K, D), named=bool(fisheye))

    def number(self, role):
        """float64 of shape (1,), from a number or a matrix of one."""
        found = self.find(role)
        if found and checks.is_number(found[2]):
            return checks.array(*found[:2], [found[2]], (1,))
        return self.vector(role, (1,))

    def pose(self):
        """R (3, 3) and T (3,)."""
        if found := self.find("motion"):
            both = self.vector("motion", (6,))
            self.fields |= dict.fromkeys("RT", self.fields["motion"])
            return motion.of_vector(*found[:2], both[:3]), both[3:]
        return self.rotation("R"), self.vector("T", (3,))

    def rectification(self):
        """{side: (R, P)} or None."""
        if not any(self.find(role) for role in ("R1", "R2", "P1", "P2")):
            return None
        return {
            side: (self.matrix("R" + number, 3, 3), self.matrix("P" + number, 3, 4))
            for side, number in zip(SIDES, "12")
        }

    def entry(self, role):
        found = self.find(role)
        if not found:
            names = " or ".join(SPELLINGS[role][:2])
            raise InputError(self.source, names, None, "missing" + _HINTS.get(role, ""))
        return found

    def size(self, default):
        """(width, height) in px: from the file, otherwise ``default``."""
        for pair in SIZE_PAIRS:
            if all(name in self._found for name in pair):
                self.fields["size"] = self._found[pair[0]][0], ", ".join(pair)
                return tuple(checks.whole(*self._found[name]) for name in pair)
        if both := self.find("size"):
            where, name, _ = both
            return tuple(checks.whole(where, name, item) for item in self.vector("size", (2,)))
        if default is None:
            for given, other in (names for pair in SIZE_PAIRS for names in (pair, pair[::-1])):
                if given in self._found:
                    raise InputError(self._found[given][0], other, None, f"missing beside {given}")
            problem = "missing: the calibration does not state the size of its images; give it with --size"
            raise InputError(self.source, SIZE_PAIRS[0][0], None, problem)
        self.fields["size"] = "--size", None
        return default
