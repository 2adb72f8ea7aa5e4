"""How the two cameras of a rig stand to each other, and which ways of standing cannot be rectified."""

from typing import NamedTuple

import cv2
import numpy as np

from hdl.calibration.rig import Rig

ALIGNED = "rows", "columns"  # what agrees of a point in both rectified images, by the axis of the baseline
UNUSUAL = 10.0  # degrees; the rigs at hand are turned by less than eight in any way
MOST_APART = 120.0  # degrees between the views; even fisheyes then see next to nothing in common
MOST_TURNED = 60.0  # degrees about the view; rectification turns each image by half of it
UPSIDE_DOWN = 120.0
ALONG_VIEW = 45.0  # degrees of the baseline from straight across the view


def turn_about_view(R: np.ndarray) -> float:
    """Degrees, -180 to 180, by which a rotation turns about the z axis: from x towards y, clockwise in an image."""
    return float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))


def in_words(angle: float) -> str:
    """An angle, degrees, as people say it: a quarter or a half turn though it is not one to the degree."""
    quarters = round(angle / 90)
    return f"{90 * quarters if abs(angle - 90 * quarters) < 5 and quarters else round(angle)} degrees"


def half_rotation(R: np.ndarray) -> np.ndarray:
    """(3, 3): the rotation by half the angle of ``R``, backwards; it takes the right camera half way to the left."""
    return cv2.Rodrigues(-0.5 * cv2.Rodrigues(R)[0])[0]


def baseline(rig: Rig) -> np.ndarray:
    """(3,): T as cameras that stand like both of ``rig``, without the turn between them, would have it."""
    return half_rotation(rig.R) @ rig.T


def along(T: np.ndarray) -> int:
    """0 for cameras one beside the other, 1 for one above the other, by T of cameras that look the same way.

    It is the axis along which points of the rectified pair are apart, as cv2.stereoRectify chooses it.
    """
    return int(abs(T[1]) > abs(T[0]))


def left_is_left(rig: Rig) -> bool:
    """Whether the left camera stands left of the right one or, of two that stand one above the other, above it."""
    T = rig.R.T @ rig.T if abs(turn_about_view(rig.R)) > MOST_TURNED else baseline(rig)
    return bool(T[along(T)] <= 0)


class Turn(NamedTuple):
    """What a rectification has to turn images by: degrees, role and value of the field that it follows from, and why,
    in words."""

    angle: float
    role: str
    value: np.ndarray
    cause: str


def largest_turn(rig: Rig) -> Turn:
    """The largest part of the `Turn` between the two cameras: what to look at when a rectification fails."""
    x, y, z = np.abs(baseline(rig))
    out, aslant = np.degrees([np.arctan2(z, np.hypot(x, y)), np.arctan2(min(x, y), max(x, y))])
    apart, about = np.degrees(np.arccos(np.clip(rig.R[2, 2], -1, 1))), abs(turn_about_view(rig.R))
    return max(
        Turn(apart / 2, "R", rig.R, f"the cameras look {apart:.0f} degrees apart"),
        Turn(about / 2, "R", rig.R, f"the cameras are turned by {about:.0f} degrees about the view against each other"),
        Turn(out, "T", rig.T, f"one camera stands {out:.0f} degrees in front of the other"),
        Turn(aslant, "T", rig.T, f"the baseline lies {aslant:.0f} degrees aslant in the images"),
        key=lambda turn: round(turn.angle, 3),
    )


def check(rig: Rig) -> None:
    """Raise InputError, with the cause and what to do, for cameras that no rectification brings side by side.

    ``rig`` has a rotation R and a baseline T.
    """
    apart = np.degrees(np.arccos(np.clip(rig.R[2, 2], -1, 1)))
    if apart > MOST_APART:
        problem = f"the cameras look {apart:.0f} degrees apart; is it R of x_right = R x_left + T?"
        raise rig.fault("R", rig.R, problem)
    turn = turn_about_view(rig.R)
    if abs(turn) > MOST_TURNED:
        raise rig.fault("R", rig.R, _turned(rig, turn))
    x, y, z = baseline(rig)
    if np.degrees(np.arctan2(abs(z), np.hypot(x, y))) > ALONG_VIEW:
        problem = (
            "one camera stands behind the other, and what lies on the way from one to the other has no disparity; "
            "stereo needs them side by side. Is it T of x_right = R x_left + T, with z along the view?"
        )
        raise rig.fault("T", rig.T, problem)


def _turned(rig, turn):
    """What is wrong where the right camera is turned by ``turn`` degrees about the view, against the left one."""
    place, other = -rig.R.T @ rig.T, rig.T  # of the right camera as the left one sees it, and the other way round
    if abs(turn) > UPSIDE_DOWN:
        if along(place):
            return (
                "one camera is upside down against the other: turn the images of one of them by 180 degrees, and "
                "calibrate with these"
            )
        side = "right" if place[0] > 0 else "left"
        return f"the {side} camera is upside down: turn its images by 180 degrees, and calibrate with these"
    side, its = ("left", rig.left) if along(place) and not along(other) else ("right", rig.right)
    problem = f"the {side} camera is turned by {in_words(abs(turn))} about its axis: turn it upright"
    if its.size[0] == its.size[1]:  # others would change their shape
        way = "anticlockwise" if (turn > 0) == (side == "right") else "clockwise"
        problem += f", or its images by 90 degrees {way} and calibrate with these"
    return problem
