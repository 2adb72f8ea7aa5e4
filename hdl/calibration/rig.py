"""What every calibration format is turned into: two cameras, and how one stands to the other."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hdl.errors import InputError
from hdl.lens import LENS_MODELS

SIDES = ("left", "right")

STRETCH = 0.01  # that frames of one shape may differ by; their sizes are whole numbers


@dataclass(frozen=True, eq=False)
class Camera:
    """One pinhole camera with its lens.

    Members
    -------
    model : str
        "radtan", "rational", "thin_prism", "tilted" (OpenCV's polynomial model, ever more of its terms in use),
        "equidistant" (Kannala-Brandt, OpenCV's fisheye module), or another one of `hdl.lens.LENS_MODELS`.
    K : (3, 3) float64
        Camera matrix, px, pixel centres at integers. Upper triangular; K[0, 1] is the skew.
    D : (n,) float64
        Lens coefficients in the order of the model; for the first four in OpenCV's, as many as the file has: n = 0, 4,
        5, 8, 12 or 14.
    size : (width, height) or None
        Of its images, px, to which K belongs. A `Rig` gives its own to a camera that states none.
    named : bool
        Whether the file, or its format, says which lens it is; otherwise see `hdl.calibration.unnamed_lens`.
    """

    model: str
    K: np.ndarray
    D: np.ndarray
    size: tuple[int, int] = None  # type: ignore[assignment]  # until it is a Rig's
    named: bool = True

    @property
    def pinhole(self) -> np.ndarray:
        """(3, 3) float64: K of the camera without its lens, which shows the same next to the optical axis."""
        magnification = LENS_MODELS[self.model].magnification(self.D)
        return self.K @ np.diag([magnification, magnification, 1.0])

    def scaled(self, size: tuple[int, int]) -> "Camera":
        """The same camera, which states its size, with its images resampled to ``size`` px."""
        return self if size == self.size else replace(self, K=resampling(self.size, size) @ self.K, size=size)


def stretch(old: tuple[int, int], new: tuple[int, int]) -> float:
    """By what share an image of size ``old`` is stretched along one axis, against the other, to become ``new``."""
    return abs(new[0] * old[1] / (new[1] * old[0]) - 1)


def resampling(old: tuple[int, int], new: tuple[int, int]) -> np.ndarray:
    """(3, 3): from px of an image of size ``old`` to px of the same one of size ``new``, pixel centres at integers."""
    sx, sy = (after / before for before, after in zip(old, new))
    return np.array([[sx, 0, 0.5 * sx - 0.5], [0, sy, 0.5 * sy - 0.5], [0, 0, 1]])


@dataclass(frozen=True, eq=False)
class Rig:
    """A calibrated stereo pair; x_right = R x_left + T.

    Members
    -------
    source : str
        The file, for messages. Several files are joined by ", ".
    width, height : int
        Size of the rectified images, px: the left camera's, and the right one's too for the most part.
    left, right : Camera
        Each with the size of its own images.
    R : (3, 3) float64
    T : (3,) float64
        In ``unit``, which is None where the format does not fix one.
    rectification : dict of side to (R (3, 3), P (3, 4)), or None
        The rectification that the file carries: rectifying rotation and projection of each camera.
    rectification_fault : InputError or None
        Why there is none though the file carries one. `hdl.geometry.rectify` raises it where the file's own is wanted,
        so that a fault in what an option leaves unused refuses nothing.
    fields : mapping of role to (file, field)
        How the file spells "size1", "K1", "D1", "R1", "P1", those of the right camera, with 2, "R" and "T"; "size"
        stands for both sizes; "model1", "model2" where it should name the lens and does not; and what it calls the
        whole cameras, "camera1" and "camera2", which are those of K1 and K2 where they are not given. For messages, and
        for :attr:`origins`.
    warnings : tuple of str
        What looks wrong and yet can be used: each one line, "FILE: FIELD = VALUE: PROBLEM".
    rectification_warnings : tuple of str
        Likewise, of the rectification that the file carries: of no interest where another one is chosen.
    notes : tuple of str
        What was decided for the user without being wrong: each one line.
    format : str or None
        NAME of the format it was read from.
    """

    source: str
    width: int
    height: int
    left: Camera
    right: Camera
    R: np.ndarray
    T: np.ndarray
    unit: str | None = None
    rectification: dict[str, tuple[np.ndarray, np.ndarray]] | None = None
    rectification_fault: InputError | None = None
    fields: Mapping[str, tuple[str, str | None]] = field(default_factory=dict, repr=False)
    warnings: tuple[str, ...] = ()
    rectification_warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    format: str | None = None

    def __post_init__(self) -> None:
        for side in SIDES:
            if self.camera(side).size is None:
                object.__setattr__(self, side, replace(self.camera(side), size=(self.width, self.height)))

    def camera(self, side: str) -> Camera:
        return {"left": self.left, "right": self.right}[side]

    @property
    def origins(self) -> dict[str, str]:
        """Side to the entry and the file that became this camera, as in "cam1 of chain.yaml" or "left.yaml".

        Printable ASCII; files without their folders, but for as many as tell two of one name apart.
        """
        default = self.fields.get("K1", (self.source, None)), self.fields.get("K2", (self.source, None))
        (where, entry), (other, its) = (self.fields.get(f"camera{n}", place) for n, place in zip("12", default))
        if where != other and entry == its:
            entry = its = None  # a file each
        files = _told_apart(where, other)
        return {
            side: _printable(f"{entry} of {file}" if entry else file)
            for side, entry, file in zip(SIDES, (entry, its), files)
        }

    @property
    def sizes(self) -> set[tuple[int, int]]:
        """(width, height), px, of the rectified images and of both cameras': one for the most part."""
        return {(self.width, self.height), self.left.size, self.right.size}

    def scaled(self, width: int, height: int) -> "Rig":
        """The same rig with all its images, sources and rectified ones, resampled to ``width`` x ``height`` px.

        Pixel centres lie at integers, so that c' = (c + 0.5)*s - 0.5 and f' = f*s on each axis; the skew scales as
        u does. D, R and T do not depend on the size.
        """
        size = width, height
        if self.sizes == {size}:
            return self
        scale = resampling((self.width, self.height), size)
        return replace(
            self,
            width=width,
            height=height,
            left=self.left.scaled(size),
            right=self.right.scaled(size),
            rectification=self.rectification and {side: (R, scale @ P) for side, (R, P) in self.rectification.items()},
        )

    def exchanged(self) -> "Rig":
        """The same rig with the right camera called left and the left one right."""
        other = str.maketrans("12", "21")
        width, height = self.right.size
        return replace(
            self,
            width=width,
            height=height,
            left=self.right,
            right=self.left,
            R=self.R.T,
            T=-self.R.T @ self.T,
            rectification=self.rectification and dict(zip(SIDES, reversed(self.rectification.values()))),
            fields={role.translate(other): spelling for role, spelling in self.fields.items()},
        )

    def warned(self, role: str, value: object, problem: str, *, of: str = "rig") -> "Rig":
        """The same rig with one more warning, worded as :meth:`fault` words an error; of the "rig" or its
        "rectification"."""
        return self.warned_as(self.fault(role, value, problem), of=of)

    def warned_as(self, error: InputError, *, of: str = "rig") -> "Rig":
        """The same rig with the text of ``error``, which is not raised, as one more warning."""
        if of == "rectification":
            return replace(self, rectification_warnings=(*self.rectification_warnings, str(error)))
        return replace(self, warnings=(*self.warnings, str(error)))

    def spelling(self, role: str) -> tuple[str, str | None]:
        """(file, field) of the field in ``role``."""
        either = self.fields.get("size") if role.startswith("size") else None
        return self.fields.get(role) or either or (self.source, role)

    def fault(self, role: str, value: object, problem: str) -> InputError:
        """The error for what is wrong with the field in ``role``, in the file's own spelling."""
        where, name = self.spelling(role)
        return InputError(where, name, value.tolist() if isinstance(value, np.ndarray) else value, problem)


def polynomial_model(D: np.ndarray) -> str:
    """Name the smallest of OpenCV's polynomial models that has every non-zero coefficient of ``D``, (n,), or else the
    largest.

    Files often carry more coefficients than were calibrated: stereo_calib writes 14 of which at most 8 are used.
    """
    used = int(np.max(np.flatnonzero(D), initial=-1)) + 1
    return next(
        name for name, count in (("radtan", 5), ("rational", 8), ("thin_prism", 12), ("tilted", used)) if used <= count
    )


def unless_faulty(read: Callable) -> tuple:
    """What ``read`` returns, and None; or None, and the InputError that it raises: a Rig's rectification and fault."""
    try:
        return read(), None
    except InputError as error:
        return None, error


def camera_matrix(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    """(3, 3): K of these, px, without skew."""
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=np.float64)


def _told_apart(first: str, second: str) -> list[str]:
    """Both paths, cut down to as few of their last parts as make them differ; to the names alone if they are one."""
    parts = [Path(path).parts for path in (str(first), str(second))]
    count = 1
    while first != second and count < max(map(len, parts)) and parts[0][-count:] == parts[1][-count:]:
        count += 1
    return ["/".join(each[-count:]) for each in parts]


def _printable(text: str, most: int = 100) -> str:
    text = "".join(letter if " " <= letter <= "~" else "?" for letter in text)
    return text if len(text) <= most else text[: most - 3] + "..."
