"""What is probably wrong with a calibration that passes the checks, and what to make of it."""

from dataclasses import replace

import cv2
import numpy as np

from hdl.calibration import stance
from hdl.calibration.checks import nearest_rotation
from hdl.calibration.rig import SIDES, Rig
from hdl.errors import InputError
from hdl.lens import LENS_MODELS

FARTHEST_CENTRE = 1 / 16  # of the image size; the rigs at hand reach 1/21
LARGEST_TANGENTIAL = 0.05  # p1 and p2; the rigs at hand reach 0.012
LARGEST_ASPECT = 1.1  # fx over fy, or the reverse
BASELINES = 1e-3, 50.0  # m
BASELINE_DIFFERENCE = 0.01  # of T against P2, relative
# Rows of a rectification that the file brings, px: below the first it is exact to the digits of the file, beyond the
# last it is not one of these cameras.
ROWS_EXACT, ROWS_WRONG = 0.05, 1.0
PROJECTIONS_APART = 0.01  # px, of the focal lengths and the rows of the centres in P1 and P2, which have to be one
ROWS_EQUAL = 1e-9  # nothing is left to be settled
DIGITS = 1e-4  # of R, within which it may follow the rectification
_NEAREST = 10  # baselines


def settled(rig: Rig) -> Rig:
    """``rig``, which has passed checks.check, with R, T and rectification in agreement, and with warnings.

    A rectification of the file whose rows differ by more than ROWS_WRONG, or whose projections are not those of a pair,
    is left out, with a warning. One that is exact
    to the digits of the file decides on the last digits of R, so that rows agree; R is then a rotation to these digits.
    Without one, R becomes the rotation nearest to the digits of the file.
    """
    rig = _with_rectification(rig) if rig.rectification else replace(rig, R=nearest_rotation(rig.R))
    for suspicion in (_sides, _centres, _aspects, _tangentials, _copies, _rectified, _baseline):
        rig = suspicion(rig)
    return rig


def row_difference(rig: Rig, rectification=None) -> float:
    """How far the rows of one point differ in the rectified views, px, at most; of cameras that are rectified as one
    above the other, the columns.

    Over points seen at 9x9 places of the left view, from 10 baselines to infinity.

    Parameters
    ----------
    rectification : dict of side to (R (3, 3), P (3, 4)), optional
        That of the rig itself where it is not given.
    """
    (R1, P1), (R2, P2) = (rectification or rig.rectification).values()
    across = 1 - stance.along(P2[:, 3] - P1[:, 3])
    x, y = np.meshgrid(np.linspace(0, rig.width - 1, 9), np.linspace(0, rig.height - 1, 9))
    rays = np.linalg.inv(P1[:, :3] @ R1) @ [x.ravel(), y.ravel(), np.ones(x.size)]
    farthest = 0.0
    for depth in (_NEAREST, 10 * _NEAREST, 1e9):
        points = depth * np.linalg.norm(rig.T) * rays
        seen = P2[:, :3] @ R2 @ (rig.R @ points + rig.T[:, None])
        farthest = max(farthest, np.abs(seen[across] / seen[2] - (x, y)[across].ravel()).max())
    return float(farthest)


def _with_rectification(rig):
    rig = _baseline_of_projection(rig)
    (R1, P1), (R2, P2) = rig.rectification.values()
    rows, axis = row_difference(rig), stance.along(P2[:, 3] - P1[:, 3])
    lines = stance.ALIGNED[axis]
    apart = np.abs(P1 - P2)[[0, 1, 1 - axis], [0, 1, 2]].max() > PROJECTIONS_APART
    if apart or not rows <= ROWS_WRONG:
        culprit, names, why = ("R2", R2), "R1 and R2", "they are not of these cameras"
        if apart:
            culprit, names, why = ("P2", P2[:, :3]), "P1 and P2", "each is of its own camera"
        elif row_difference(replace(rig, R=rig.R.T)) <= ROWS_EXACT:
            why = "they belong to the transpose of R"
        problem = f"{names} are not used: {lines} would differ by {rows:.1f} px, as {why}; rectified anew from R and T"
        rig = rig.warned(*culprit, problem)
        return replace(rig, rectification=None, R=nearest_rotation(rig.R))
    if rows > ROWS_EXACT:
        problem = f"{lines} of the rectification in the file differ by up to {rows:.2f} px, {_NEAREST} baselines away"
        return rig.warned("P2", P2, problem, of="rectification")
    if rows < ROWS_EQUAL:
        return rig
    R = np.linalg.inv(R2) @ R1
    if np.abs(R - rig.R).max() > DIGITS:
        angle = np.degrees(np.linalg.norm(cv2.Rodrigues(R2 @ rig.R @ R1.T)[0]))
        problem = f"R1 and R2 leave the cameras turned by {angle:.2g} degrees: disparities are off"
        return rig.warned("R2", R2, problem, of="rectification")
    return replace(rig, R=R)


def _baseline_of_projection(rig):
    (_, P1), (R2, P2) = rig.rectification.values()
    axis = stance.along(P2[:, 3] - P1[:, 3])
    stated = (P2[axis, 3] - P1[axis, 3]) / P2[axis, axis]
    given = (R2 @ rig.T)[axis]
    if abs(stated - given) > BASELINE_DIFFERENCE * abs(given):
        problem = f"its baseline, {stated:.6g}, is not that of T, {given:.6g}"
        return rig.warned("P2", P2[axis], problem, of="rectification")
    return rig


def left_first(rig: Rig) -> Rig:
    """``rig``, or the same with its cameras exchanged, which is noted: for files that number cameras without naming
    their sides. Of two cameras one above the other, the upper one is called left."""
    if stance.left_is_left(rig):
        return rig
    rig = rig.exchanged()
    left, right = (rig.origins[side] for side in SIDES)
    place = ("left one", "upper one, called left,")[stance.along(stance.baseline(rig))]
    note = f"{rig.source}: as the cameras stand, the {place} is {left}, the right one {right}"
    return replace(rig, notes=(*rig.notes, note))


def sides(rig: Rig) -> InputError | None:
    """What is to be said where the left camera stands right of the right one, or below it; not raised."""
    if stance.left_is_left(rig):
        return None
    place, axis = (("on the right", "x"), ("the lower one", "y"))[stance.along(stance.baseline(rig))]
    problem = (
        f"the camera called left is {place} (x_right = R x_left + T with T.{axis} > 0), so disparities are negative; "
        "are the cameras exchanged, or do R and T lead from right to left?"
    )
    return rig.fault("T", rig.T, problem)


def _sides(rig):
    if rig.rectification:
        (_, P1), (_, P2) = rig.rectification.values()
        shift = P2[:, 3] - P1[:, 3]
        if shift[stance.along(shift)] < 0:
            return rig  # it makes disparities positive by turning the images
    said = sides(rig)
    return rig.warned_as(said) if said else rig


def _centres(rig):
    for number, side in enumerate(SIDES, start=1):
        K, (width, height) = rig.camera(side).K, rig.camera(side).size
        for name, c, extent in (("cx", K[0, 2], width), ("cy", K[1, 2], height)):
            if abs(c - (extent - 1) / 2) > FARTHEST_CENTRE * extent:
                problem = f"far from the middle of a {width}x{height} image: calibrated at another size?"
                rig = rig.warned(f"K{number}", f"{name} {c:.6g}", problem)
    return rig


def _aspects(rig):
    for number, side in enumerate(SIDES, start=1):
        fx, fy = np.diag(rig.camera(side).K)[:2]
        if not 1 / LARGEST_ASPECT < fx / fy < LARGEST_ASPECT:
            rig = rig.warned(f"K{number}", f"fx {fx:.6g}, fy {fy:.6g}", "pixels are seldom so far from square")
    return rig


def _tangentials(rig):
    for number, side in enumerate(SIDES, start=1):
        camera = rig.camera(side)
        names = LENS_MODELS[camera.model].coefficients
        tangential = [abs(value) for name, value in zip(names, camera.D) if name in ("p1", "p2")]
        if max(tangential, default=0) > LARGEST_TANGENTIAL:
            order = ", ".join(names[:5])
            problem = f"large tangential terms: OpenCV's order {order} is meant"
            rig = rig.warned(f"D{number}", camera.D, problem)
    return rig


def _copies(rig):
    left, right = rig.left, rig.right
    if np.array_equal(left.K, right.K) and np.array_equal(left.D, right.D) and left.D.any():
        return rig.warned("K2", right.K, "both cameras have the same numbers to the last digit: one is a copy")
    return rig


def _rectified(rig):
    left, right = rig.left, rig.right
    equal = np.array_equal(left.K, right.K) and not left.D.any() and not right.D.any()
    if equal and np.array_equal(rig.R, np.eye(3)) and not rig.T[1:].any():
        problem = "these are cameras of images that are rectified already, which a core would leave as they are"
        return rig.warned("K2", None, problem)
    return rig


def _baseline(rig):
    length, (least, most) = np.linalg.norm(rig.T), BASELINES
    if rig.unit == "m" and not least <= length <= most:
        return rig.warned("T", rig.T, f"a baseline of {length:.3g} m; is it in another unit than the format's?")
    return rig
