"""OpenCV's matrices under the names that people give them: lists in JSON or YAML, NumPy's .npz, one file a camera.

K, D, R and T as cv2.stereoCalibrate returns them, x_right = R x_left + T, in one file or spread over several. A file
whose names have no side is of one camera: of which, its own name says (left.yml, cam1.npz), otherwise the order in
which the files were given. Lengths are in the unit of the squares unless the file names one.
Source: OpenCV, cv::stereoCalibrate and samples/cpp/tutorial_code/calib3d/camera_calibration; numpy.savez.
"""

import re
from dataclasses import replace

from hdl.calibration import checks, lenses, matrices, npzfile, opencv, sides, spellings, suspicions, unnamed_lens
from hdl.calibration.documents import Document
from hdl.calibration.matlab import UNITS
from hdl.calibration.rig import SIDES, Camera, Rig, unless_faulty
from hdl.errors import InputError

NAME = "plain"
TITLE = "OpenCV's matrices as lists (JSON, YAML), NumPy .npz, or one file per camera"
SEVERAL_FILES = True
SELECT = None

# A name, in quotes, at the beginning of a line or within it, and what follows where it is of a matrix, or of an object.
_QUOTED, _FIRST = r'"([^"\n]{1,60})"', r"^[ \t]*([A-Za-z][\w .-]{0,60})"
_WORD = r"(?<![\w.-])([A-Za-z][\w.-]{0,60})"
_MATRIX = r'\[|!!opencv-matrix|[\r\n]|\{[ \t\r\n]*"type_id"'
_NAMES = re.compile(
    rf'(?:{_QUOTED}|{_FIRST}|{_WORD})[ \t]*:[ \t]*(?={_MATRIX})|<{_WORD}[ \t]+type_id="opencv-matrix"', re.MULTILINE
)
_OPENCV = {*opencv.SPELLINGS["K1"], *opencv.SPELLINGS["K2"]}
_OPENCV_MARK = re.compile("opencv-matrix|<opencv_storage")
_MATRICES = ("K", "D", "R", "T", "R_rect", "P")
_CALLED = {
    "K": "M1, cameraMatrix1, camera_matrix_left, mtxL", "D": "dist1, distCoeffs1, dist_coeffs_left, distL",
    "R": "Rotation, rotation_matrix", "T": "Translation, translation_vector", "P": "projection_matrix_left",
}  # fmt: skip
_TRUE, _FALSE = (True, 1, "true", "True", "yes"), (False, 0, "false", "False", "no", None)


def recognises(document: Document) -> bool:
    """cv::FileStorage under the names of stereo_calib is opencv's."""
    if document.arrays is not None:
        return True
    names = _names(document)
    if _OPENCV.intersection(names) and _OPENCV_MARK.search(document.text):
        return False
    roles = {spellings.role(name) for name in names}
    sided = any(role and role[0] == "K" and role[1] for role in roles)
    return sided or {("K", ""), ("D", "")} <= roles


def accompanies(document: Document) -> bool:
    """Whether it holds R and T, and no camera."""
    roles = {spellings.role(name) for name in _names(document)}
    return {("R", ""), ("T", "")} <= {role and (role[0], "") for role in roles} and ("K", "") not in roles


def _names(document):
    return {"".join(found) for found in _NAMES.findall(document.text)}


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in ``documents``. ``size`` (width, height in px) serves where they do not state one.

    Raises InputError for a matrix that is missing, given twice with different values, or not of its shape.
    """
    storage = _Storage(documents)
    cameras = [replace(storage.camera(number), size=storage.size(number, size)) for number in "12"]
    R, (T, unit) = storage.rotation("R"), storage.translation()
    rectification, fault = unless_faulty(storage.rectification)
    rig = Rig(
        storage.source, *cameras[0].size, *cameras, R, T,
        unit=unit, rectification=rectification, rectification_fault=fault, fields=storage.fields,
    )  # fmt: skip
    for warning in storage.warnings:
        rig = rig.warned_as(warning)
    return suspicions.left_first(rig) if storage.numbered else rig


class _Storage(matrices.Entries):
    """What the documents hold, by role: "K1" to "P2", "R", "T", "size", "width", "height", "model1" and so on."""

    def __init__(self, documents):
        self.source = ", ".join(document.name for document in documents)
        self.fields, self.warnings, self._found = {}, [], {}
        entries = [
            (document.name, ".".join(path), *role, value)
            for document in documents
            for path, value in _entries(_content(document))
            if (role := spellings.role(*path))
        ]
        entries = [entry for entry in entries if entry[2] not in _MATRICES or _is_matrix(entry[4])]
        unsided = [where for where, _, role, side, _ in entries if (role, side) == ("K", "")]
        self._sides, self.numbered = self._files_sides(unsided)
        zero_based = any((role, side) == ("K", "0") for _, _, role, side, _ in entries)
        self.numbered |= zero_based
        number = dict(zip(("0", "1") if zero_based else ("1", "2"), "12")) | {"left": "1", "right": "2"}
        for where, name, role, side, value in entries:
            if role not in ("R", "T", "unit"):
                role += number.get(side, "") if side else self._sides.get(where, "")
            self._add(role, where, name, side if role == "T" else None, value)

    def _files_sides(self, files):
        """File to "1" or "2", of ``files`` that are of one camera each; and whether their names count cameras."""
        if not files:
            return {}, False
        if len(files) != 2:
            problem = "of one camera: name the other camera's file too, and the one that has R and T"
            raise InputError(", ".join(files), None, None, problem)
        told = sides.by_name(*files)
        if told is None:
            problem = "taken for the left camera, as it was named first: the names of the files do not tell"
            self.warnings.append(InputError(files[0], None, None, problem))
        left, named = told or (0, True)
        return {files[left]: "1", files[1 - left]: "2"}, not named

    def _add(self, role, where, name, unit, value):
        other, its, _, before = self._found.setdefault(role, (where, name, unit, value))
        if before != value:
            problem = f"also given as {its}" if where == other else f"differs from the {its} in {other}"
            raise InputError(where, name, None, f"{problem}; keep one of them")

    def find(self, role):
        """(file, name, unit, value), or None."""
        found = self._found.get(role)
        if found:
            self.fields[role] = found[:2]
        return found

    def entry(self, role):
        """(file, name, value)."""
        found = self.find(role)
        if found is None:
            raise InputError(self.source, role, None, f"missing; {_CALLED[role[0]]} are understood too, and the like")
        where, name, _, value = found
        return where, name, value

    def camera(self, number):
        """The left camera by "1", the right one by "2"."""
        K, D = self.matrix("K" + number, 3, 3), self.vector("D" + number, unnamed_lens.COUNTS)
        fisheye = self.find("fisheye" + number) or self.find("fisheye")
        if fisheye and fisheye[3] not in (*_TRUE, *_FALSE):
            raise InputError(fisheye[0], fisheye[1], fisheye[3], "true or false is needed")
        if fisheye and fisheye[3] in _TRUE:
            return Camera("equidistant", K, D)
        model = self.find("model" + number) or self.find("model")
        if model:
            return Camera(lenses.model(model[0], model[1], model[3], D), K, D)
        return replace(unnamed_lens.camera(K, D), named=bool(fisheye))

    def translation(self):
        """T, in metres where the unit is known, and "m" then."""
        T, unit = self.vector("T", (3,)), self.find("T")[2]
        if not unit and (stated := self.find("unit")):
            unit = stated[3].strip().lower() if isinstance(stated[3], str) else None
            if unit not in UNITS:
                problem = f"not one of {', '.join(UNITS)}; lengths are left as they are"
                self.warnings.append(InputError(stated[0], stated[1], stated[3], problem))
        scale = UNITS.get(unit)
        return (T * scale, "m") if scale else (T, None)

    def rectification(self):
        """None unless R1, R2, P1 and P2 are there."""
        roles = [f"{role}{number}" for role in ("R_rect", "P") for number in "12"]
        found = [role for role in roles if role in self._found]
        if 0 < len(found) < len(roles):
            missing = ", ".join(role.replace("_rect", "") for role in roles if role not in found)
            where, name, _, _ = self._found[found[0]]
            problem = f"not used: R1, R2, P1 and P2 belong together, and there is no {missing}"
            self.warnings.append(InputError(where, name, None, problem))
        if len(found) < len(roles):
            return None
        pairs = {side: (self.matrix(f"R_rect{n}", 3, 3), self.matrix(f"P{n}", 3, 4)) for side, n in zip(SIDES, "12")}
        self.fields |= {f"R{n}": self.fields.pop(f"R_rect{n}") for n in "12"}
        return pairs

    def size(self, number, default):
        """(width, height) in px of the left camera's images by "1", the right one's by "2": from the files, where need
        be from what they say of the other camera, otherwise ``default``."""
        stated = [size for which in ("", number) for size in self._sizes(which)]
        stated = stated or list(self._sizes({"1": "2", "2": "1"}[number]))
        for (where, name), size in stated[1:]:
            (other, its), first = stated[0]
            if size != first:
                problem = f"not the {its} in {other}, {first[0]}x{first[1]}"
                raise InputError(where, name, "x".join(map(str, size)), problem)
        if stated:
            self.fields["size" + number] = stated[0][0]
            return stated[0][1]
        if default is None:
            problem = "missing: the calibration does not state the size of its images; give it with --size"
            raise InputError(self.source, "image_size", None, problem)
        self.fields["size"] = "--size", None
        return default

    def _sizes(self, number):
        """((file, name), (width, height)) of what is stated, in one entry, in two, or in both ways."""
        both = self._found.get("size" + number)
        if both:
            where, name, _, value = both
            values = matrices.vector(where, name, value, (2,))
            yield (where, name), tuple(checks.whole(where, name, number) for number in values.tolist())
        pair = [self._found.get(side + number) for side in ("width", "height")]
        if None not in pair:
            where, names = pair[0][0], ", ".join(entry[1] for entry in pair)
            yield (where, names), tuple(checks.whole(where, name, value) for where, name, _, value in pair)


def _content(document):
    if document.arrays is not None:
        return document.arrays
    text = document.text.lstrip()
    return document.xml if text.startswith("<") else document.json if text.startswith("{") else document.yaml


def _entries(content, above=(), depth=3):
    """(path of names, value); matrices in rows, cols and data are values."""
    for key, value in content.items():
        path = *above, str(key)
        if isinstance(value, dict) and depth and not {"rows", "cols", "data"} <= value.keys():
            yield from _entries(value, path, depth - 1)
        else:
            yield path, value


def _is_matrix(value):
    return isinstance(value, (list, dict)) or value == npzfile.PICKLED
