"""Cameras that stand unusually: what cannot be rectified is refused with the cause, and what it advises works."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from calibration_files import refusal
from standing_rigs import images_turned, pixels_turned, rotation, standing, write

from hdl.calibration import embedded, load
from hdl.calibration.stance import along, left_is_left, turn_about_view
from hdl.geometry.notes import row_disagreement, warnings
from hdl.geometry.rectification import RectificationOptions, rectify
from sim.reference import project

SQUARE = 128, 128
QUARTER = "camera is turned by 90 degrees about its axis: turn it upright"
BACK = "or its images by 90 degrees {} and calibrate with these"
BEHIND = (
    "one camera stands behind the other, and what lies on the way from one to the other has no disparity; stereo needs "
    "them side by side. Is it T of x_right = R x_left + T, with z along the view?"
)


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def said(rig):
    """What a file with this rig is refused with, without the field."""
    message = refusal(write(rig))
    assert message.startswith(("rig.yml: R = [[", "rig.yml: T = ["))
    return message.split("]: ")[-1].split("...: ")[-1]


@pytest.mark.parametrize("extra", [0, 4, -4])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_camera_upside_down_is_named_and_its_turned_images_do(side, extra):
    rig = standing(**{side: (0.5, -0.4, 180 + extra)})
    message = f"the {side} camera is upside down: turn its images by 180 degrees, and calibrate with these"
    assert said(rig) == message
    assert_rectified(images_turned(rig, side, 2))


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("roll", [90, -90])
def test_a_camera_turned_by_a_quarter_is_named_and_its_turned_images_do(side, roll):
    rig = standing(**{side: (0.5, -0.4, roll)}, size=SQUARE)
    way = "clockwise" if roll > 0 else "anticlockwise"  # a camera that leans to the right shows a world that leans left
    assert said(rig) == f"the {side} {QUARTER}, {BACK.format(way)}"
    assert_rectified(images_turned(rig, side, 1 if roll > 0 else -1))


@pytest.mark.parametrize("roll, degrees", [(90, 90), (-90, 90), (75, 75), (-110, 110)])
def test_images_that_are_not_square_are_not_turned_by_a_quarter(roll, degrees):
    assert said(standing(right=(0, 0, roll))) == (
        f"the right camera is turned by {degrees} degrees about its axis: turn it upright"
    )


def test_turned_images_are_those_of_the_turned_calibration():
    """Of the helper that tries the advice."""
    points = np.random.default_rng(1).uniform([-0.5, -0.4, 2], [0.5, 0.4, 4], (50, 3))
    for side, quarters in (("left", 1), ("right", 1), ("right", 2), ("left", 3)):
        rig = standing(size=SQUARE)
        turned = images_turned(rig, side, quarters)
        before, after = (
            project(each.camera(side), points if side == "left" else points @ each.R.T + each.T, True)
            for each in (rig, turned)
        )
        if side == "left":  # whose axes are those of the points
            after = project(turned.left, points @ np.linalg.matrix_power(rotation(0, 0, 90), quarters).T, True)
        assert np.abs(after - pixels_turned(before, SQUARE, quarters)).max() < 1e-9


def assert_rectified(rig):
    """A file with this rig is read without a word, and rectified."""
    loaded = load(write(rig))
    views = rectify(loaded, lens=True)
    assert warnings(loaded, views) == []
    assert row_disagreement(loaded, views) < 1e-9
    assert all(view.window.rows < 40 for view in views.values())


def test_of_cameras_one_above_the_other_either_may_be_turned():
    rig = standing(right=(0, 0, 180), at=(0.001, 0.1, 0))
    assert said(rig) == (
        "one camera is upside down against the other: turn the images of one of them by 180 degrees, and calibrate "
        "with these"
    )
    for side in ("left", "right"):
        loaded = load(write(images_turned(rig, side, 2)))
        assert {view.aligned for view in rectify(loaded, lens=True).values()} == {"columns"}


def test_both_cameras_upside_down_are_a_pair_that_is_exchanged():
    rig = load(write(standing(left=(0, 0, 180), right=(0.3, 0.4, 179.5))))
    (warning,) = rig.warnings
    assert "the camera called left is on the right" in warning and warning.endswith("lead from right to left?")
    both = images_turned(images_turned(standing((0, 0, 180), (0.3, 0.4, 179.5)), "left", 2), "right", 2)
    assert_rectified(both)
    assert_rectified(rig.exchanged())


def test_both_cameras_turned_by_a_quarter_stand_one_above_the_other():
    for roll, first in ((90, False), (-90, True)):
        rig = load(write(standing(left=(0, 0, roll), right=(0.3, 0.4, roll - 0.5))))
        assert {view.aligned for view in rectify(rig, lens=True).values()} == {"columns"}
        assert (rig.warnings == ()) == first
        assert (
            first or "the camera called left is the lower one (x_right = R x_left + T with T.y > 0)" in rig.warnings[0]
        )


@pytest.mark.parametrize("at", [(0.02, -0.25, -0.9), (0.02, 0.1, 0.9), (-0.3, 0, 0.4), (0.1, 0.1, -0.2)], ids=str)
def test_one_camera_behind_the_other_is_refused(at):
    assert said(standing(at=at)) == BEHIND
    across = max(np.abs(at[:2]))
    load(write(standing(at=(*at[:2], 0.9 * across))))


@pytest.mark.parametrize("yaw, degrees", [(150, 150), (180, 180), (-130, 130)])
def test_cameras_that_look_apart_are_refused(yaw, degrees):
    assert said(standing(right=(0, yaw, 0))) == (
        f"the cameras look {degrees} degrees apart; is it R of x_right = R x_left + T?"
    )


APART = "the cameras are turned by {} degrees about the view against each other"
ASLANT = "the baseline lies {} degrees aslant in the images"


@pytest.mark.parametrize("right, at, which, cause", [
    ((0, 0, 45), (0.1, 0, 0), "right images by 45", APART.format(45)),
    ((0, 0, -30), (0.1, 0, 0), "right images by 30", APART.format(30)),
    ((0, 0, 0), (0.1, 0.08, 0), "images by 39", ASLANT.format(39)),
    ((0, 0, 0), (-0.05, 0.1, 0), "images by 27", ASLANT.format(27)),
], ids=str)  # fmt: skip
def test_what_turns_the_images_is_said_and_what_it_costs(right, at, which, cause):
    rig = load(write(standing(right=right, at=at)))
    views = rectify(rig, lens=True)
    rows = max(view.window.rows for view in views.values())
    assert row_disagreement(rig, views) < 1e-9
    found = [line for line in warnings(rig, views) if "turns" in line]
    (line,) = found
    assert f"the computed rectification turns the {which} degrees, as {cause}, which costs " in line
    assert line.endswith(f"{rows} rows of line buffer") or rows > 120


def test_numbered_cameras_turned_against_each_other_are_not_exchanged():
    """The half rotation, by which others are judged, tells nothing of them."""
    for roll in (90, -90, 180, 170):
        assert left_is_left(standing(right=(0, 0, roll)))
        assert not left_is_left(standing(right=(0, 0, roll), at=(-0.1, 0, 0)))
    assert left_is_left(standing(at=(0, 0.1, 0))) and not left_is_left(standing(at=(0, -0.1, 0)))


@pytest.mark.parametrize("tilt", [(0, 0, 0), (20, 0, 0), (0, -30, 0), (15, 25, 0)])
@pytest.mark.parametrize("roll", [0, 30, -90, 135, 180])
def test_turn_about_the_view_leaves_out_where_a_camera_looks(tilt, roll):
    R = rotation(*tilt) @ rotation(0, 0, roll)
    assert abs(turn_about_view(R)) == pytest.approx(abs(roll), abs=1e-9)


def test_the_axis_is_the_one_that_opencv_takes():
    rig = embedded()
    for x, y in ((-1, 0.9), (1, -0.9), (0.9, -1), (-0.2, 1)):
        P2 = cv2.stereoRectify(
            rig.left.K, None, rig.right.K, None, (640, 480), np.eye(3), np.array([[x], [y], [0.1]]),
            flags=cv2.CALIB_ZERO_DISPARITY,
        )[3]  # fmt: skip
        assert along(np.array([x, y, 0.1])) == int(abs(P2[1, 3]) > abs(P2[0, 3]))


def turning(rig, degrees):
    """A rectification as some programs write it: the computed one, its images turned, so that rows agree."""
    views = rectify(rig, RectificationOptions(focal=0.8 * rig.width, center=(79.5, 59.5)), lens=True)
    turn, given = rotation(0, 0, degrees), {}
    for side, view in views.items():
        K, place = view.P[:, :3], np.linalg.solve(view.P[:, :3], view.P[:, 3])
        given[side] = turn @ view.R, np.column_stack([K, K @ turn @ place])
    return given


@pytest.mark.parametrize("at, degrees, remedy", [
    ((-0.1, 0.001, 0), 180, " or exchanged cameras do without"),
    ((0.1, 0.001, 0), 180, "--alpha 0 or --fov 63 do without"),
    ((0.001, 0.1, 0), -90, "--alpha 0 or --fov 63 do without"),
    ((0.001, 0.1, 0), 90, "--alpha 0 or --fov 63 do without"),
], ids=str)  # fmt: skip
def test_a_rectification_in_the_file_that_turns_the_images_is_named_and_the_advice_does_without(at, degrees, remedy):
    rig = load(write(standing(at=at), rectification=turning(standing(at=at), degrees)))
    views = rectify(rig, lens=True)
    assert row_disagreement(rig, views) < 1e-9 and views["left"].aligned == "rows"
    (line,) = [line for line in warnings(rig, views) if "turns" in line]
    assert line.startswith("rig.yml: R1 = [[") or line.startswith("rig.yml: R2 = [[")
    said = (
        f"the rectification in the file turns the images by {abs(degrees)} degrees, which costs two frames of memory; "
    )
    assert said in line and line.endswith(remedy)
    assert not any("disparities are negative" in line for line in warnings(rig, views))
    for choice in (RectificationOptions(alpha=0), RectificationOptions(fov=63)):
        anew = rectify(rig, choice, lens=True)
        assert f"{choice.spelled} or " in line or f" or {choice.spelled}" in line
        assert not any("turns" in line for line in warnings(rig, anew, choice))
        assert max(view.window.rows for view in anew.values()) < 40
        assert anew["left"].aligned == ("rows" if abs(at[0]) > 0.05 else "columns")
    if "exchanged" in remedy:
        assert_rectified(replace(rig, rectification=None).exchanged())


def test_disparities_that_become_negative_by_an_option_are_told_of():
    """The file's own rectification made them positive, by turning the images."""
    rig = standing(at=(-0.1, 0.001, 0))
    rig = load(write(rig, rectification=turning(rig, 180)))
    options = RectificationOptions(alpha=0)
    assert rig.warnings == ()
    (line,) = warnings(rig, rectify(rig, options, lens=True), options)
    assert "the camera called left is on the right" in line and "so disparities are negative" in line
