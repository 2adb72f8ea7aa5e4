"""Rigid motions as pairs (R, T): x_to = R x_from + T."""

import cv2
import numpy as np

from hdl.calibration import checks
from hdl.errors import InputError

Motion = tuple[np.ndarray, np.ndarray]

QUATERNION_TOLERANCE = 1e-3  # of its length from 1: files round


def of_vector(where: str, field: str, vector: np.ndarray) -> np.ndarray:
    """The rotation, (3, 3), by ``vector``, rad. Raises InputError for one beyond a whole turn, as degrees are."""
    if not np.abs(vector).max() <= 2 * np.pi:
        raise InputError(where, field, vector.tolist(), "a rotation vector in rad is needed")
    return cv2.Rodrigues(vector)[0]


def of_quaternion(where: str, field: str, x: float, y: float, z: float, w: float) -> np.ndarray:
    """The rotation, (3, 3). Raises InputError unless x, y, z and w are of length 1, up to the digits of a file."""
    length = np.sqrt(x * x + y * y + z * z + w * w)
    if not abs(length - 1) < QUATERNION_TOLERANCE:
        raise InputError(where, field, [x, y, z, w], f"no rotation: the quaternion is of length {length:.4g}, not 1")
    x, y, z, w = (part / length for part in (x, y, z, w))
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def inverse(motion: Motion) -> Motion:
    R, T = motion
    return R.T, -R.T @ T


def then(first: Motion, second: Motion) -> Motion:
    """``first``, followed by ``second``."""
    (R, T), (R_second, T_second) = first, second
    return R_second @ R, R_second @ T + T_second


def between(left: Motion, right: Motion) -> Motion:
    """From the left camera to the right one, each given by its motion from a common frame to the camera."""
    return then(inverse(left), right)


def of_rectification(R1, P1, R2, P2) -> Motion:
    """R and T of the cameras that a rectification is of, for files that hold nothing else.

    Rectified axes are parallel, so R = R2^-1 R1; the fourth column of P is the focal length times the place of the
    camera. The inverse, not the transpose: with the R1 and R2 of the file, rounded as they are, rows then agree.

    Parameters
    ----------
    R1, R2 : (3, 3) float64
        Rotations to the digits of the file.
    P1, P2 : (3, 4) float64
        T is not finite unless P2[0, 0] and P2[1, 1] are numbers other than zero.
    """
    back = np.linalg.inv(R2)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (P2[:2, 3] - P1[:2, 3]) / [P2[0, 0], P2[1, 1]]
        return back @ R1, back @ [x, y, 0]


def projection(where: str, field: str, P: np.ndarray) -> np.ndarray:
    """``P``, (3, 4). Raises InputError unless a place can be recovered from it; the rest of it may be nonsense."""
    if P[:2, 3].any():
        if not (P[0, 0] > 0 and P[1, 1] > 0):
            raise InputError(where, field, P.tolist(), "a focal length must be positive")
        checks.position(where, field, P[:2, 3] / [P[0, 0], P[1, 1]])
    return P
