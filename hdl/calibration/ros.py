"""ROS camera_info: one YAML file a camera, as camera_calibration writes them (left.yaml and right.yaml).

The files hold no R and T of the pair: these follow from both rectification matrices and the right projection_matrix.
Lengths are in metres, as the calibrator asks for the size of its squares. Which camera is the right one follows from
projection_matrix too, in whichever order the files are given. Files without distortion_model are older than it, when
plumb_bob was the only one; some name the lens in camera_model instead.
Source: camera_calibration_parsers (parse_yml) and sensor_msgs/CameraInfo.
"""

import re
from dataclasses import replace

from hdl.calibration import checks, lenses, motion, unnamed_lens
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig
from hdl.errors import InputError

NAME = "ros"
TITLE = "ROS camera_info (YAML pair)"
SEVERAL_FILES = True
SELECT = None

SPELLED = {
    "size": ("image_width", "image_height"), "K": "camera_matrix", "D": "distortion_coefficients",
    "R": "rectification_matrix", "P": "projection_matrix", "lens": ("distortion_model", "camera_model"),
}  # fmt: skip
_NO_LENS = "pinhole"  # what camera_model says where the lens is another matter
_TRAITS = [re.compile(rf"^{field}[ \t]*:", re.MULTILINE) for field in ("camera_matrix", "projection_matrix")]


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in two ``documents``, in any order.

    Raises InputError for a missing field, a wrong shape, and cameras calibrated one by one.
    """
    source = ", ".join(document.name for document in documents)
    if len(documents) != 2:
        raise InputError(source, None, None, "two camera_info files are needed, one of each camera")
    return pair(source, [Info(Fields(document.name, document.yaml)) for document in documents])


def pair(source: str, infos: list["Info"]) -> Rig:
    """The rig of two cameras, in any order, from ``source``. Raises InputError as :func:`read`."""
    left, right = sorted(infos, key=lambda info: -info.P[:2, 3].sum())
    if not (left.P[:2, 3].any() or right.P[:2, 3].any()):
        problem = "no baseline in either file: the cameras were calibrated one by one; calibrate them as a pair"
        raise right.fault("P", right.P.tolist(), problem)
    R, T = motion.of_rectification(left.R, left.P, right.R, right.P)
    rig = Rig(
        source=source,
        width=left.size[0],
        height=left.size[1],
        left=left.camera,
        right=right.camera,
        R=R,
        T=T,
        unit="m",
        rectification={"left": (left.R, left.P), "right": (right.R, right.P)},
        fields={
            **left.roles("1"),
            **right.roles("2"),
            "R": right.place("R"),
            "T": right.place("P"),
        },
    )
    for info, other in ((left, "right"), (right, "left")):
        if info.name and other in f"{info.name[0]} {info.name[1]}".lower():
            problem = f"yet by {info.spelled['P']} it is not the {other} one"
            rig = rig.warned_as(InputError(info.where, *info.name, problem))
        rig = info.warned_of_crop(rig)
    return rig


class Info:
    """One camera's camera_info.

    Parameters
    ----------
    fields : Fields
        With a prefix where a file has more than one.
    spelled : dict
        What the entries are called; "lens" only where the form has such entries: the first that says anything counts.
    name : (field, value), optional
        What the camera is called, and where it says so; either may tell its side.
    """

    def __init__(self, fields: Fields, spelled: dict = SPELLED, name: tuple | None = None):
        self.fields, self.spelled, self.where = fields, spelled, fields.where
        self.name = ("camera_name", fields.get("camera_name")) if "camera_name" in fields else name
        size = (checks.whole(self.where, fields.name(key), fields.get(key)) for key in spelled["size"])
        self.size = checks.image_size(*self.place("size"), *size)
        self.camera = replace(self._camera(fields.matrix(spelled["K"], 3, 3)), size=self.size)
        self.R = checks.rotation(*self.place("R"), fields.matrix(spelled["R"], 3, 3))
        self.P = motion.projection(*self.place("P"), fields.matrix(spelled["P"], 3, 4, finite=False))

    def _camera(self, K):
        D = self.fields.vector(self.spelled["D"], unnamed_lens.COUNTS)
        for key in self.spelled["lens"]:
            if key in self.fields and self.fields.get(key) not in (None, "", _NO_LENS):
                return Camera(lenses.model(self.where, self.fields.name(key), self.fields.get(key), D), K, D)
        return unnamed_lens.camera(K, D)

    def place(self, role: str) -> tuple[str, str]:
        """The file, and what the entry is called in it."""
        entry = self.spelled[role]
        return self.where, self.fields.name(entry if isinstance(entry, str) else ", ".join(entry))

    def fault(self, role: str, value, problem: str) -> InputError:
        return InputError(*self.place(role), value, problem)

    def roles(self, number: str) -> dict[str, tuple[str, str | None]]:
        """For `Rig.fields`."""
        places: dict[str, tuple[str, str | None]] = {role + number: self.place(role) for role in ("size", *"KDRP")}
        places["camera" + number] = self.where, self.fields.prefix or None
        if not self.camera.named and self.spelled["lens"]:
            places["model" + number] = self.where, self.fields.name(self.spelled["lens"][0])
        return places

    def warned_of_crop(self, rig: Rig) -> Rig:
        """K counts pixels of the whole sensor; binning and a region of interest make the images something else."""
        for axis in "xy":
            key = f"binning_{axis}"
            if key in self.fields and self.fields.number(key) > 1:
                rig = rig.warned_as(self.fields.fault(key, self.fields.get(key), "ignored: taken for full resolution"))
        if isinstance(roi := self.fields.get("roi") if "roi" in self.fields else None, dict):
            region = [roi.get(key, 0) for key in ("x_offset", "y_offset", "width", "height")]
            if region[:2] != [0, 0] or region[2:] not in ([0, 0], list(self.size)):
                rig = rig.warned_as(self.fields.fault("roi", region, "ignored: taken for the whole image"))
        return rig
