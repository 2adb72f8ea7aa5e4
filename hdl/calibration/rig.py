"""What every calibration format is turned into: two cameras, and how one stands to the other."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hdl.errors import InputError
from hdl.lens import LENS_MODELS

SIDES = ("left", "right")


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
    named : bool
        Whether the file, or its format, says which lens it is; otherwise see `hdl.calibration.unnamed_lens`.
    """

    model: str
    K: np.ndarray
    D: np.ndarray
    named: bool = True

    @property
    def pinhole(self) -> np.ndarray:
        """(3, 3) float64: K of the camera without its lens, which shows the same next to the optical axis."""
        magnification = LENS_MODELS[self.model].magnification(self.D)
        return self.K @ np.diag([magnification, magnification, 1.0])


@dataclass(frozen=True, eq=False)
class Rig:
    """A calibrated stereo pair; x_right = R x_left + T.

    Members
    -------
    source : str
        The file, for messages. Several files are joined by ", ".
    width, height : int
        Size of both source images, px.
    left, right : Camera
    R : (3, 3) float64
    T : (3,) float64
        In ``unit``, which is None where the format does not fix one.
    rectification : dict of side to (R (3, 3), P (3, 4)), or None
        The rectification that the file carries: rectifying rotation and projection of each camera.
    rectification_fault : InputError or None
        Why there is none though the file carries one. `hdl.geometry.rectify` raises it where the file's own is wanted,
        so that a fault in what an option leaves unused refuses nothing.
    fields : mapping of role to (file, field)
        How the file spells "size", "K1", "D1", "K2", "D2", "R", "T", "R1", "R2", "P1" and "P2", and "model1", "model2"
        where it should name the lens and does not; and what it calls the whole cameras, "camera1" and "camera2", which
        are those of K1 and K2 where they are not given. For messages, and for :attr:`origins`.
    warnings : tuple of str
        What looks wrong and yet can be used: each one line, "FILE: FIELD = VALUE: PROBLEM".
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
    notes: tuple[str, ...] = ()
    format: str | None = None

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

    def scaled(self, width: int, height: int) -> "Rig":
        """The same rig with its images resampled to ``width`` x ``height`` px.

        Pixel centres lie at integers, so that c' = (c + 0.5)*s - 0.5 and f' = f*s on each axis; the skew scales as
        u does. D, R and T do not depend on the size.
        """
        if (width, height) == (self.width, self.height):
            return self
        sx, sy = width / self.width, height / self.height
        scale = np.array([[sx, 0, 0.5 * sx - 0.5], [0, sy, 0.5 * sy - 0.5], [0, 0, 1]])
        rectification = self.rectification and {side: (R, scale @ P) for side, (R, P) in self.rectification.items()}
        return replace(
            self,
            width=width,
            height=height,
            left=replace(self.left, K=scale @ self.left.K),
            right=replace(self.right, K=scale @ self.right.K),
            rectification=rectification,
        )

    def exchanged(self) -> "Rig":
        """The same rig with the right camera called left and the left one right."""
        other = str.maketrans("12", "21")
        return replace(
            self,
            left=self.right,
            right=self.left,
            R=self.R.T,
            T=-self.R.T @ self.T,
            rectification=self.rectification and dict(zip(SIDES, reversed(self.rectification.values()))),
            fields={role.translate(other): spelling for role, spelling in self.fields.items()},
        )

    def warned(self, role: str, value: object, problem: str) -> "Rig":
        """The same rig with one more warning, worded as :meth:`fault` words an error."""
        return self.warned_as(self.fault(role, value, problem))

    def warned_as(self, error: InputError) -> "Rig":
        """The same rig with the text of ``error``, which is not raised, as one more warning."""
        return replace(self, warnings=(*self.warnings, str(error)))

    def fault(self, role: str, value: object, problem: str) -> InputError:
        """The error for what is wrong with the field in ``role``, in the file's own spelling."""
        where, name = self.fields.get(role, (self.source, role))
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
