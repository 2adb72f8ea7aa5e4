"""What a calibration has to satisfy before anything is computed from it, whichever format it came in."""

import math
from dataclasses import replace

import cv2
import numpy as np

from hdl.calibration import stance
from hdl.calibration.rig import SIDES, Rig, unless_faulty
from hdl.errors import InputError
from hdl.lens import LENS_MODELS

SIZE_RANGE = (16, 16384)  # px
LONGEST = 1e9  # of a baseline, in whatever unit
ROTATION_EXACT = 1e-14  # what float64 leaves of R^T R - I
ROTATION_TOLERANCE = 1e-3  # of R^T R from I: files round to as little as four digits
# Beyond this, a rectification is that of another rig. A smaller contradiction is settled in suspicions.
CONTRADICTION = 0.1  # rad


def array(where: str, field: str, values, shape: tuple[int, ...], finite: bool = True) -> np.ndarray:
    """``values``, a flat list of numbers in row order, as float64 of ``shape``.

    Raises InputError for a value that is not a finite number (not a number, unless ``finite``), and for a wrong count.
    """
    if not isinstance(values, list) or len(values) != math.prod(shape):
        found = f"{len(values)} values" if isinstance(values, list) else values
        raise InputError(where, field, found, f"{math.prod(shape)} numbers are needed")
    for index, value in enumerate(values):
        if not is_number(value) or finite and not math.isfinite(value):
            raise InputError(where, f"{field}[{index}]", value, "not a finite number")
    return np.array(values, dtype=np.float64).reshape(shape)


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def whole(where: str, field: str | None, value) -> int:
    """``value`` as int. Raises InputError unless it is a whole number."""
    if not is_number(value) or not math.isfinite(value) or value % 1:
        raise InputError(where, field, value, "a whole number of pixels is needed")
    return int(value)


def image_size(where: str, field: str | None, width, height) -> tuple[int, int]:
    """Width and height in px, as int. Raises InputError unless both are whole numbers within SIZE_RANGE."""
    size = whole(where, field, width), whole(where, field, height)
    low, high = SIZE_RANGE
    if not all(low <= value <= high for value in size):
        raise InputError(where, field, f"{size[0]}x{size[1]}", f"an image size must lie between {low} and {high} px")
    return size


def rotation(where: str, field: str | None, R: np.ndarray) -> np.ndarray:
    """``R`` itself, (3, 3). Raises InputError unless it is a rotation within ROTATION_TOLERANCE."""
    if problem := _no_rotation(R):
        raise InputError(where, field, R.tolist(), problem)
    return R


def nearest_rotation(R: np.ndarray) -> np.ndarray:
    """(3, 3): the rotation that ``R`` is, up to the digits it was written with; ``R`` itself if these are enough."""
    if np.abs(R.T @ R - np.eye(3)).max() < ROTATION_EXACT:
        return R
    U, _, V = np.linalg.svd(R)
    return U @ V


def position(where: str, field: str | None, T: np.ndarray) -> np.ndarray:
    """``T`` itself. Raises InputError unless it is a length in some unit; zero is one here."""
    if not (np.isfinite(T).all() and np.abs(T).max() < LONGEST):
        raise InputError(where, field, T.tolist(), "no length of a baseline in any unit")
    return T


def check(rig: Rig) -> Rig:
    """``rig`` itself. Raises InputError, naming file, field and value, for the first thing that cannot be right.

    A rectification that cannot be right is left out, and the error kept as ``rectification_fault``.
    """
    for number, side in enumerate(SIDES, start=1):
        camera = rig.camera(side)
        image_size(*rig.spelling(f"size{number}"), *camera.size)
        _check_matrix(rig, f"K{number}", camera.K, camera.size, principal_point_inside=True)
        _check_lens(rig, f"D{number}", camera)
    _check_rotation(rig, "R", rig.R)
    _check_baseline(rig)
    if rig.rectification:
        _, fault = unless_faulty(lambda: _check_rectification(rig))
        return replace(rig, rectification=None, rectification_fault=fault) if fault else rig
    return rig


def _check_matrix(rig, role, K, size, principal_point_inside):
    """Upper triangular, K[2][2] = 1, focal lengths and centre that fit the image."""
    _check_finite(rig, role, K)
    below = np.abs([K[1, 0], K[2, 0], K[2, 1]]).max()
    if abs(K[2, 2] - 1) > 1e-6 or below > 1e-6:
        raise rig.fault(role, K, "not of the form [fx s cx; 0 fy cy; 0 0 1]")
    width, height = size
    # Views of 168 and of half a degree. Beyond lie focal lengths in mm or m.
    low, high = max(size) / 20, max(size) * 100
    for name, f in (("fx", K[0, 0]), ("fy", K[1, 1])):
        if f <= 0:
            raise rig.fault(role, f"{name} {f:g}", "singular or mirrored: a focal length must be positive")
        if not low <= f <= high:
            raise rig.fault(role, f"{name} {f:g}", f"no focal length in px for {width}x{height} images")
    for name, c in (("skew", K[0, 1]), ("cx", K[0, 2]), ("cy", K[1, 2])):
        if abs(c) > high:
            raise rig.fault(role, f"{name} {c:g}", f"far outside a {width}x{height} image")
    if principal_point_inside:
        for name, c, extent in (("cx", K[0, 2], width), ("cy", K[1, 2], height)):
            if not 0 <= c <= extent - 1:
                problem = f"the principal point lies outside the {width}x{height} image: of another size?"
                raise rig.fault(role, f"{name} {c:g}", problem)


def _check_lens(rig, role, camera):
    _check_finite(rig, role, camera.D)
    if found := LENS_MODELS[camera.model].refusal(camera.D):
        raise rig.fault(role, *found)


def _check_rotation(rig, role, R):
    if problem := _no_rotation(R):
        raise rig.fault(role, R, problem)


def _no_rotation(R):
    if not np.isfinite(R).all():
        return "not finite"
    off = np.abs(R.T @ R - np.eye(3)).max() if np.abs(R).max() < 2 else np.inf
    if off > ROTATION_TOLERANCE:
        return f"not a rotation: R^T R differs from the identity by {off:.2g}"
    return "not a rotation: its determinant is -1" if np.linalg.det(R) < 0 else None


def _check_baseline(rig):
    """A length, and a way of standing that can be rectified. Who stands on which side is no fault: OpenCV rectifies
    both ways."""
    T = rig.T
    _check_finite(rig, "T", T)
    if not T.any():
        raise rig.fault("T", T, "the two cameras are in one place; a stereo rig has a baseline")
    if not 1 / LONGEST < np.abs(T).max() < LONGEST:
        raise rig.fault("T", T, "no length of a baseline in any unit")
    stance.check(rig)


def _check_rectification(rig):
    for number, side in enumerate(SIDES, start=1):
        R, P = rig.rectification[side]
        _check_rotation(rig, f"R{number}", R)
        _check_finite(rig, f"P{number}", P)
        _check_matrix(rig, f"P{number}", P[:, :3], (rig.width, rig.height), principal_point_inside=False)
    (R1, P1), (R2, P2) = (rig.rectification[side] for side in SIDES)
    axis = stance.along(P2[:, 3] - P1[:, 3])
    turn = np.linalg.norm(cv2.Rodrigues(R2 @ rig.R @ R1.T)[0])
    baseline = R2 @ rig.T / np.linalg.norm(rig.T)
    if turn > CONTRADICTION or np.linalg.norm(np.delete(baseline, axis)) > CONTRADICTION:
        problem = f"does not rectify these cameras: R2 R R1^T is not the identity, or R2 T not along {'xy'[axis]}"
        raise rig.fault("R2", R2, problem)
    onwards = baseline[axis] < 0
    if onwards != (P2[axis, 3] - P1[axis, 3] < 0):
        if not onwards:
            problem = "leads from the right camera to the left one, but P2 the other way; give R^T and -R^T T"
            raise rig.fault("T", rig.T, problem)
        raise rig.fault(
            "P2", P2[axis], f"the baseline has the wrong sign for a camera {('on the right', 'below')[axis]}"
        )


def _check_finite(rig, role, values):
    if not np.isfinite(values).all():
        raise rig.fault(role, values, "not finite")
