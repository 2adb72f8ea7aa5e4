"""ROS camera_info: one YAML file a camera, as camera_calibration writes them (left.yaml and right.yaml).

The files hold no R and T of the pair: these follow from both rectification matrices and the right projection_matrix.
Lengths are in metres, as the calibrator asks for the size of its squares. Which camera is the right one follows from
projection_matrix too, in whichever order the files are given. Files without distortion_model are older than it, when
plumb_bob was the only one; some name the lens in camera_model instead.
Source: camera_calibration_parsers (parse_yml) and sensor_msgs/CameraInfo.
"""

import re

from hdl.calibration import checks, lenses, motion, unnamed_lens
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig
from hdl.errors import InputError

NAME = "ros"
TITLE = "ROS camera_info (YAML pair)"
SEVERAL_FILES = True
SELECT = None

_LENS = "distortion_model", "camera_model"
_NO_LENS = "pinhole"  # what camera_model says where the lens is another matter
_TRAITS = [re.compile(rf"^{field}[ \t]*:", re.MULTILINE) for field in ("camera_matrix", "projection_matrix")]


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in two ``documents``, in any order.

    Raises InputError for a missing field, a wrong shape, different sizes, and cameras calibrated one by one.
    """
    source = ", ".join(document.name for document in documents)
    if len(documents) != 2:
        raise InputError(source, None, None, "two camera_info files are needed, one of each camera")
    left, right = sorted(map(_Info, documents), key=lambda info: -info.P[:2, 3].sum())
    if not (left.P[:2, 3].any() or right.P[:2, 3].any()):
        problem = "no baseline in either file: the cameras were calibrated one by one; calibrate them as a pair"
        raise right.fields.fault("projection_matrix", right.P.tolist(), problem)
    if left.size != right.size:
        raise InputError(right.where, right.size_field, "x".join(map(str, right.size)), f"not the size in {left.where}")
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
            "size": (left.where, left.size_field),
            **left.roles("1"),
            **right.roles("2"),
            "R": (right.where, "rectification_matrix"),
            "T": (right.where, "projection_matrix"),
        },
    )
    for info, other in ((left, "right"), (right, "left")):
        name = info.fields.get("camera_name") if "camera_name" in info.fields else None
        if isinstance(name, str) and other in name.lower():
            text = InputError(info.where, "camera_name", name, f"yet by projection_matrix it is not the {other} one")
            rig = rig.warned_as(text)
        rig = info.warned_of_crop(rig)
    return rig


class _Info:
    """One camera_info file."""

    size_field = "image_width, image_height"

    def __init__(self, document):
        self.where = document.name
        self.fields = fields = Fields(document.name, document.yaml)
        width, height = (checks.whole(self.where, name, fields.get(name)) for name in ("image_width", "image_height"))
        self.size = checks.image_size(self.where, self.size_field, width, height)
        self.camera = self._camera(fields.matrix("camera_matrix", 3, 3))
        self.R = checks.rotation(self.where, "rectification_matrix", fields.matrix("rectification_matrix", 3, 3))
        P = fields.matrix("projection_matrix", 3, 4, finite=False)
        self.P = motion.projection(self.where, "projection_matrix", P)

    def _camera(self, K):
        D = self.fields.vector("distortion_coefficients", unnamed_lens.COUNTS)
        for name in _LENS:
            if name in self.fields and self.fields.get(name) not in (None, "", _NO_LENS):
                return Camera(lenses.model(self.where, name, self.fields.get(name), D), K, D)
        return unnamed_lens.camera(K, D)

    def roles(self, number):
        names = {"K": "camera_matrix", "D": "distortion_coefficients", "R": "rectification_matrix",
                 "P": "projection_matrix"}  # fmt: skip
        if not self.camera.named:
            names["model"] = _LENS[0]
        return {role + number: (self.where, name) for role, name in names.items()}

    def warned_of_crop(self, rig):
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
