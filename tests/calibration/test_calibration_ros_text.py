"""camera_info as ROS prints it, and camera_calibration's oST text: the same pair as in its YAML files."""

import numpy as np
import pytest
from calibration_files import refusal, write
from format_files import ros
from rig_numbers import ROS
from ros_files import message, ost

from hdl.calibration import load

SIZE, LEFT, RIGHT = (ROS["ps4eye"][key] for key in ("size", "left", "right"))
SIDES = {"left": LEFT, "right": RIGHT}


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def known():
    """The pair as camera_calibration's YAML files have it."""
    return load(*(write(ros(SIZE, **numbers, name=side), f"{side}.yml") for side, numbers in SIDES.items()))


def same(rig, known):
    assert (rig.width, rig.height, rig.unit) == (known.width, known.height, known.unit)
    for side in SIDES:
        ours, theirs = rig.camera(side), known.camera(side)
        assert ours.model == theirs.model and np.array_equal(ours.K, theirs.K) and np.array_equal(ours.D, theirs.D)
        for matrix, its in zip(rig.rectification[side], known.rectification[side]):
            assert np.array_equal(matrix, its)
    assert np.array_equal(rig.R, known.R) and np.array_equal(rig.T, known.T)
    assert not rig.warnings


def messages(left=None, right=None, **options):
    return [message(SIZE, **(numbers | (change or {})), frame=side, **options)
            for (side, numbers), change in zip(SIDES.items(), (left, right))]  # fmt: skip


def osts(left=None, right=None, **options):
    return [ost(SIZE, **(numbers | (change or {})), name=f"narrow_stereo/{side}", **options)
            for (side, numbers), change in zip(SIDES.items(), (left, right))]  # fmt: skip


class TestMessages:
    @pytest.mark.parametrize("options", [{}, {"old": True}, {"block": True}, {"old": True, "block": True}])
    def test_messages_of_both_ros_are_read_from_two_files_or_one(self, options, known):
        texts = messages(**options)
        paths = [write(text, f"{index}.txt") for index, text in enumerate(texts)]
        rig = load(*reversed(paths))
        same(rig, known)
        assert rig.format == "ros-message" and rig.origins == {"left": "0.txt", "right": "1.txt"}
        rig = load(write("".join(texts)))
        same(rig, known)
        assert rig.origins == {"left": "message 1 of rig.yml", "right": "message 2 of rig.yml"}
        assert rig.fields["K2"] == ("rig.yml", f"message 2.{'K' if options.get('old') else 'k'}")

    def test_messages_that_repeat_one_another_count_once(self, known):
        texts = [text for second in (1, 2, 3) for text in messages(seconds=second)]
        same(load(write("".join(texts))), known)

    def test_frame_that_contradicts_the_geometry_is_warned_of(self):
        texts = [message(SIZE, **LEFT, frame="right_camera"), message(SIZE, **RIGHT, frame="right_camera")]
        assert load(write("".join(texts))).warnings == (
            "rig.yml: message 1.header.frame_id = right_camera: yet by p it is not the right one",
        )

    def test_lens_is_the_models(self):
        fisheye = {"D": [0.01, -0.02, 0.003, -0.001]}
        rig = load(write("".join(messages(fisheye, fisheye, model="equidistant"))))
        assert (rig.left.model, rig.left.D.tolist()) == ("equidistant", fisheye["D"])

    def test_lens_without_a_name_is_taken_for_plumb_bob_and_that_is_said(self):
        (warning,) = load(write("".join(messages(model="")))).warnings
        assert warning.startswith("rig.yml: message 1.distortion_model: missing: taken for radtan (plumb_bob ")

    @pytest.mark.parametrize("change, message", [
        ({"K": [1.0] * 8}, "message 2.k = 8 values: 9 numbers are needed"),
        ({"D": [0.1] * 3}, "message 2.d = 3 values: "),
        ({"R": [0.0] * 9}, "message 2.r = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]: not a rotation"),
        ({"P": LEFT["P"]}, "message 2.p = [[433.812194, 0.0, 337.494003, 0.0], [0.0, 433.812194, 176.695019, 0.0], "
                           "[0.0...: no baseline in either file: the cameras were calibrated one by one"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(write("".join(messages(None, change)))).startswith(f"rig.yml: {message}")

    def test_one_message_is_not_enough(self):
        one = messages()[0]
        assert refusal(write(one + one)) == ("rig.yml: 1 camera_info messages: two are needed, one of each camera")

    def test_lines_are_counted_over_the_whole_file(self):
        left, right = messages()
        text = left + right.replace("width: 640", "width: [640")
        line = left.count("\n") + 1 + right[: right.index("width")].count("\n")
        assert refusal(write(text)).startswith(f"rig.yml: line {line + 1}: ")


class TestOst:
    def test_text_is_read_from_one_file_or_two(self, known):
        texts = osts()
        rig = load(write("".join(texts)))
        same(rig, known)
        assert rig.format == "ost"
        assert rig.origins == {"left": "narrow_stereo/left of rig.yml", "right": "narrow_stereo/right of rig.yml"}
        paths = [write(text, f"{index}.ini") for index, text in enumerate(texts)]
        same(load(*reversed(paths)), known)
        one_name = [write(ost(SIZE, **numbers, name="narrow_stereo"), f"{side}.ini") for side, numbers in SIDES.items()]
        assert load(*one_name).origins == {"left": "left.ini", "right": "right.ini"}

    @pytest.mark.parametrize("title", ["", "# Camera intrinsics\n\n"])
    def test_title_is_not_needed(self, title, known):
        same(load(write("".join(osts(title=title)))), known)

    def test_what_a_terminal_shows_around_it_is_passed_over(self, known):
        before = "mono pinhole calibration...\nLeft:\nD = [-0.3, 0.08]\nK = [425.1, 0.0]\n('P = ', [1])\nNone\n"
        left, right = osts()
        text = (
            before
            + left
            + "self.T = [-0.08]\n"
            + right
            + "('Wrote calibration data to', '/tmp/calibration.tar.gz')\n1\n"
        )
        same(load(write(text.replace("\n", "\n    "))), known)

    def test_four_coefficients_are_a_guess_that_is_said(self):
        fisheye = {"D": [-0.0138, -0.0316, 0.0518, -0.0361]}
        path = write("".join(osts(fisheye, fisheye)))
        rig = load(path)
        assert rig.left.model == "equidistant" and "--lens-model" in rig.warnings[0]
        assert rig.warnings[0].startswith("rig.yml: narrow_stereo/left.distortion = [-0.0138, ")
        assert load(path, lens_model="equidistant").warnings == ()

    def test_name_that_contradicts_the_geometry_is_warned_of(self):
        left, right = osts()
        text = left.replace("stereo/left", "stereo/right") + right.replace("stereo/right", "stereo/other")
        assert load(write(text)).warnings == (
            "rig.yml: [narrow_stereo/right]: yet by projection it is not the right one",
        )

    @pytest.mark.parametrize("change, message", [
        (("camera matrix", "camera matrices"), "narrow_stereo/left.camera matrix: missing"),
        (("projection\n433.812194", "projection\n"),
         "narrow_stereo/left.projection = 11 values: 12 numbers are needed"),
        (("projection\n433.812194", "projection\nx"),
         "narrow_stereo/left.projection = 0 values: 12 numbers are needed"),
        (("width\n640", "width\n640 480"), "narrow_stereo/left.width = [640, 480]: a whole number of pixels is needed"),
        (("height\n400", "width\n400"), "line 9 = width: given twice for one camera"),
    ])  # fmt: skip
    def test_bad_text_is_refused(self, change, message):
        text = "".join(osts())
        assert change[0] in text
        assert refusal(write(text.replace(*change, 1))) == f"rig.yml: {message}"

    def test_one_camera_is_not_enough(self):
        assert refusal(write(osts()[0])) == "rig.yml: 1 cameras: two are needed, in one file or one a file"
        assert refusal(write("".join(osts() * 2))) == "rig.yml: 4 cameras: two are needed, in one file or one a file"
