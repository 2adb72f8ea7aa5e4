"""Calibrations in cv::FileStorage form: YAML, XML or JSON, in one file or spread over several.

OpenCV's stereo_calib sample writes intrinsics.yml (M1, D1, M2, D2) and extrinsics.yml (R, T, R1, R2, P1, P2, Q), and
nowhere the image size. Other programs write one file, often with K1 for M1.
Source: cv::FileStorage and samples/cpp/stereo_calib.cpp of OpenCV 4 and 5. cv2.FileStorage itself is not used, because
broken files can take the interpreter down with it.
"""

import re

from hdl.calibration import checks, lenses
from hdl.calibration.documents import Document
from hdl.calibration.rig import Camera, Rig, polynomial_model
from hdl.errors import InputError
from hdl.lens.polynomial import COUNTS as POLYNOMIAL_COUNTS

NAME = "opencv"
TITLE = "OpenCV FileStorage (YAML, XML, JSON)"
SEVERAL_FILES = True
SELECT = None

SPELLINGS = {
    "K1": ("M1", "K1", "camera_matrix_left"),
    "D1": ("D1", "dist_coeffs_left", "distortion_coeffs_left"),
    "K2": ("M2", "K2", "camera_matrix_right"),
    "D2": ("D2", "dist_coeffs_right", "distortion_coeffs_right"),
    "R": ("R", "rotation_matrix"),
    "T": ("T", "translation_vector"),
    "R1": ("R1", "rectification_transform_left"),
    "R2": ("R2", "rectification_transform_right"),
    "P1": ("P1", "projection_matrix_left"),
    "P2": ("P2", "projection_matrix_right"),
    "size": ("image_size", "imageSize", "ImageSize", "imgSize"),
    "model": ("model", "distortion_model"),
    "fisheye": ("fisheye_model",),  # 0 or 1, as OpenCV's camera_calibration sample writes it
    "unit": ("unit",),  # as this project writes it
    "xi": ("xi", "xi1", "xi_left"),  # cv::omnidir
}
SIZE_PAIRS = (("image_width", "image_height"), ("image_Width", "image_Height"), ("imageWidth", "imageHeight"))

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
    if found := storage.find("xi"):
        lenses.refuse_omnidirectional(found[0], found[1], "omnidir")
    K1, K2 = (storage.matrix(role, 3, 3) for role in ("K1", "K2"))
    D1, D2 = (storage.vector(role, POLYNOMIAL_COUNTS) for role in ("D1", "D2"))
    R, T = storage.matrix("R", 3, 3), storage.vector("T", (3,))
    rectification = None
    if any(storage.find(role) for role in ("R1", "R2", "P1", "P2")):
        R1, R2 = (storage.matrix(role, 3, 3) for role in ("R1", "R2"))
        P1, P2 = (storage.matrix(role, 3, 4) for role in ("P1", "P2"))
        rectification = {"left": (R1, P1), "right": (R2, P2)}
    width, height = storage.size(size)
    unit = storage.find("unit")
    return Rig(
        source=storage.source,
        width=width,
        height=height,
        left=Camera(storage.model(D1), K1, D1),
        right=Camera(storage.model(D2), K2, D2),
        R=R,
        T=T,
        unit="m" if unit and unit[2] == "m" else None,
        rectification=rectification,
        fields=storage.fields,
    )


def _essence(value):
    """What two files have to agree in, whichever of YAML, XML and JSON each is."""
    return repr([value.get(key) for key in ("rows", "cols", "data")] if isinstance(value, dict) else value)


class _Storage:
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

    def matrix(self, role, rows, cols):
        """float64 of shape (rows, cols)."""
        where, name, value = self._matrix(role)
        if (value["rows"], value["cols"]) != (rows, cols):
            raise InputError(where, name, f"{value['rows']}x{value['cols']}", f"a {rows}x{cols} matrix is needed")
        return checks.array(where, f"{name}.data", value["data"], (rows, cols))

    def vector(self, role, counts):
        """float64 of shape (n,), n in ``counts``, from one row or one column."""
        where, name, value = self._matrix(role)
        shape = value["rows"], value["cols"]
        count = shape[0] * shape[1]
        if min(shape) > 1 or count not in counts:
            accepted = " or ".join(map(str, counts))
            problem = f"{accepted} numbers in one row or column are needed"
            raise InputError(where, name, f"{shape[0]}x{shape[1]}", problem)
        return checks.array(where, f"{name}.data", value["data"], (count,))

    def _matrix(self, role):
        found = self.find(role)
        if not found:
            names = " or ".join(SPELLINGS[role][:2])
            raise InputError(self.source, names, None, "missing" + _HINTS[role])
        where, name, value = found
        if not isinstance(value, dict) or not {"rows", "cols", "data"} <= value.keys():
            raise InputError(where, name, value, "a matrix with rows, cols, dt and data is needed")
        for key in ("rows", "cols"):
            if not isinstance(value[key], int) or value[key] < 0:
                raise InputError(where, f"{name}.{key}", value[key], "a whole number is needed")
        if value.get("dt", "d") not in ("u", "c", "w", "s", "i", "f", "d"):
            raise InputError(where, f"{name}.dt", value["dt"], "a matrix of one channel is needed")
        return found

    def model(self, D):
        """The lens model: equidistant where the file says so, otherwise what the coefficients in use amount to."""
        stated, fisheye = self.find("model"), self.find("fisheye")
        if fisheye and fisheye[2] not in (0, 1):
            raise InputError(*fisheye, "0 or 1 is needed")
        if stated and not (fisheye and fisheye[2]):
            return lenses.model(*stated, D)
        return "equidistant" if fisheye and fisheye[2] else polynomial_model(D)

    def size(self, default):
        """(width, height) in px: from the file, otherwise ``default``."""
        for pair in SIZE_PAIRS:
            found = [self._found[name] for name in pair if name in self._found]
            if len(found) == 1:
                where, given, _ = found[0]
                raise InputError(where, next(name for name in pair if name != given), None, f"missing beside {given}")
            if found:
                self.fields["size"] = found[0][0], ", ".join(pair)
                return tuple(checks.whole(*entry) for entry in found)
        if both := self.find("size"):
            where, name, value = both
            if not isinstance(value, list) or len(value) != 2:
                raise InputError(where, name, value, "width and height are needed")
            return tuple(checks.whole(where, name, item) for item in value)
        if default is None:
            problem = "missing: the calibration does not state the size of its images; give it with --size"
            raise InputError(self.source, SIZE_PAIRS[0][0], None, problem)
        self.fields["size"] = "--size", None
        return default
