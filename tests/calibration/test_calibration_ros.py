"""camera_info files as they lie about: without the lens's name or with another field for it, with a P that is wrong."""

import numpy as np
import pytest
from calibration_files import refusal, write
from format_files import ros
from rig_numbers import ROS, TUM_VI

from hdl.calibration import load
from hdl.geometry.rectification import RectificationOptions, rectify

EYE = [1, 0, 0, 0, 1, 0, 0, 0, 1]
SIZE = ROS["ps4eye"]["size"]
LENS = "distortion_model: plumb_bob\n"


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def pair(old="", new="", left=None, right=None):
    """left.yaml and right.yaml of the ps4eye; ``left``, ``right``: other matrices; ``old`` becomes ``new`` in both."""
    for side, change in (("left", left), ("right", right)):
        text = ros(SIZE, **(ROS["ps4eye"][side] | (change or {})), name=side)
        assert old in text or change is not None
        write(text.replace(old, new), f"{side}.yaml")
    return "left.yaml", "right.yaml"


def fisheye(*P, lens="distortion_model: equidistant\n"):
    """left.yaml and right.yaml of a fisheye pair, turned against each other not at all."""
    for side, camera, p in zip(("left", "right"), TUM_VI["cameras"], P):
        fx, fy, cx, cy = camera["intrinsics"]
        text = ros(TUM_VI["size"], [fx, 0, cx, 0, fy, cy, 0, 0, 1], camera["D"], EYE, p, name=side)
        write(text.replace(LENS, lens), f"{side}.yaml")
    return "left.yaml", "right.yaml"


def own(camera, offset=0.0):
    """A projection matrix of a camera's own intrinsics."""
    fx, fy, cx, cy = TUM_VI["cameras"][camera]["intrinsics"]
    return [fx, 0, cx, offset, 0, fy, cy, 0, 0, 0, 1, 0]


@pytest.mark.parametrize("new", ["", "distortion_model:\n", 'distortion_model: ""\n', "camera_model: pinhole\n"])
def test_without_a_lens_model_it_is_plumb_bob_and_it_is_said(new):
    expected = load(*pair())
    rig = load(*pair(LENS, new))
    assert (rig.left.model, rig.right.model) == ("radtan", "radtan")
    assert np.array_equal(rig.left.D, expected.left.D) and np.array_equal(rig.T, expected.T)
    assert rig.warnings == (
        "left.yaml: distortion_model: missing: taken for radtan (plumb_bob and its extensions) by its 5 coefficients; "
        "--lens-model settles it",
    )
    assert load("left.yaml", "right.yaml", lens_model="radtan").warnings == ()


def test_without_a_lens_model_eight_coefficients_are_rational():
    more = {"D": [0.3, 0.05, 2e-4, -1e-4, 0.002, 0.33, 0.09, 0.009]}
    rig = load(*pair(LENS, "", more, more))
    assert rig.left.model == "rational" and "taken for rational (plumb_bob" in rig.warnings[0]


@pytest.mark.parametrize("lens", ["camera_model: fisheye\n", "camera_model: equidistant\n",
                                  "camera_model: pinhole\ndistortion_model: fisheye\n"])  # fmt: skip
def test_lens_may_be_named_in_camera_model(lens):
    P = [190.0, 0, 256, 0, 0, 190.0, 256, 0, 0, 0, 1, 0]
    rig = load(*fisheye(P, P[:3] + [-19.0] + P[4:], lens=lens))
    assert (rig.left.model, rig.right.model, rig.warnings) == ("equidistant", "equidistant", ())
    assert rig.T == pytest.approx([-0.1, 0, 0])


def test_unknown_lens_is_named_with_its_field():
    assert refusal(*pair(LENS, "camera_model: ftheta\n")).startswith("left.yaml: camera_model = ftheta: ")


@pytest.mark.parametrize("old, new", [
    ("image_width: 640\nimage_height: 400", "image_width: '640'\nimage_height: \"400\""),
    ("rows: 3", 'rows: "3"'), ("0, 0, 1]", "0, '0', \"1\"]"), ("0]", "\"0\"]"),
])  # fmt: skip
def test_numbers_in_quotes_are_numbers(old, new):
    expected, rig = load(*pair()), load(*pair(old, new))
    assert (rig.width, rig.height) == (640, 400) and rig.warnings == expected.warnings
    assert np.array_equal(rig.right.K, expected.right.K) and np.array_equal(rig.T, expected.T)
    assert np.array_equal(rig.right.D, expected.right.D)


class TestProjectionOfEachCamerasOwn:
    def test_is_not_used_but_for_the_baseline_and_it_is_said(self):
        rig = load(*fisheye(own(0), own(1, -19.2)))
        assert rig.rectification is None
        assert rig.T == pytest.approx([-19.2 / TUM_VI["cameras"][1]["intrinsics"][0], 0, 0])
        (warning,) = rig.warnings
        assert warning.startswith("right.yaml: projection_matrix = [[190.44236969414825, 0.0, ")
        assert warning.endswith(
            "P1 and P2 are not used: rows would differ by 2.7 px, as each is of its own camera; "
            "rectified anew from R and T"
        )
        views = rectify(rig, RectificationOptions(fov=80), lens=True)
        assert np.array_equal(views["left"].P[:, :3], views["right"].P[:, :3])

    @pytest.mark.parametrize("place", [0, 5, 6])
    def test_is_not_used_either_where_it_differs_little(self, place):
        P = own(0, -19.2)
        P[place] += 0.3
        assert load(*fisheye(own(0), P)).rectification is None

    def test_may_have_a_centre_to_the_side_of_the_other(self):
        P = own(0, -19.2)
        P[2] += 9.5
        assert load(*fisheye(own(0), P)).rectification


@pytest.mark.parametrize("place, value", [(0, -433.8), (2, np.nan), (5, np.nan), (6, 1e9), (10, 7)])
def test_fault_in_the_left_p_is_refused_only_where_it_is_used(place, value):
    P = list(ROS["ps4eye"]["left"]["P"])
    P[place] = value
    paths = pair("nan", ".nan", {"P": P}, {})
    assert refusal(*paths).endswith("; --alpha 0 or --fov 75 would do")
    views = rectify(load(*paths), RectificationOptions(alpha=0), lens=True)
    expected = rectify(load(*pair()), RectificationOptions(alpha=0), lens=True)
    assert all(np.abs(view.P - expected[side].P).max() < 1e-9 for side, view in views.items())


@pytest.mark.parametrize("place, value", [(0, 0.0), (0, -433.8), (3, 1e300)])
def test_fault_in_what_the_baseline_follows_from_is_refused_always(place, value):
    P = list(ROS["ps4eye"]["right"]["P"])
    P[place] = value
    assert refusal(*pair(right={"P": P})).startswith("right.yaml: projection_matrix = ")
