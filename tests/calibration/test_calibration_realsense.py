"""What rs-enumerate-devices -c prints: which streams make the pair, at which size, and with which lens."""

import numpy as np
import pytest
from calibration_files import refusal, turn, write
from loose_files import realsense

from hdl.calibration import load

R, T = turn(0.01, -0.02, 0.005), [-0.0502, 0.0001, -0.0002]
NONE = ("Brown Conrady", [0] * 5)
LENS = ("Brown Conrady", [-0.05, 0.06, 0.0002, -0.0004, -0.02])
SIZES = {(424, 240): (214.5, 214.25, 212.5, 118.5), (848, 480): (428.5, 428.25, 425.25, 237.5),
         (640, 480): (390.5, 390.25, 320.25, 237.5)}  # fmt: skip
PAIR = [("Infrared 1", "Infrared 2", R, T), ("Infrared 2", "Infrared 1", R.T, (-R.T @ T).tolist())]


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def blocks(lens=LENS, sizes=SIZES, streams=("Infrared 1", "Infrared 2"), formats="Y8"):
    """The second stream's focal lengths are half a pixel longer."""
    return [
        (stream, size, formats, np.add(numbers, [half, half, 0, 0]).tolist(), *lens)
        for stream, half in zip(streams, (0, 0.5)) for size, numbers in sizes.items()
    ]  # fmt: skip


def text(
    *arguments, extrinsics=PAIR, before=(("Depth", (640, 480), "Z16", (390.5, 390.5, 320, 240), *NONE),), **options
):
    return realsense([*before, *blocks(*arguments, **options)], extrinsics)


ONE = {(640, 480): SIZES[640, 480]}


def test_motion_leads_from_the_first_stream_to_the_second_row_by_row():
    rig = load(write(text(sizes=ONE)))
    assert np.abs(rig.R - R).max() < 1e-6 and rig.T.tolist() == T
    assert rig.left.K.tolist() == [[390.5, 0, 320.25], [0, 390.25, 237.5], [0, 0, 1]]
    assert rig.right.K[0, 0] == 391 and rig.left.D.tolist() == LENS[1]
    assert (rig.width, rig.height, rig.unit, rig.format, rig.warnings) == (640, 480, "m", "realsense", ())
    assert rig.origins == {"left": '"Infrared 1" of rig.yml', "right": '"Infrared 2" of rig.yml'}


class TestSizes:
    def test_the_largest_is_taken_and_that_is_said(self):
        rig = load(write(text()))
        assert (rig.width, rig.height, rig.left.K[0, 0]) == (848, 480, 428.5)
        assert rig.warnings == (
            'rig.yml: Intrinsic of "Infrared 1" / 848x480: the largest of 424x240, 848x480, 640x480; choose another '
            "with --select or --size",
        )

    @pytest.mark.parametrize("options", [{"select": "424x240"}, {"size": (424, 240)}, {"select": "424X240"}])
    def test_another_can_be_chosen(self, options):
        rig = load(write(text()), **options)
        assert (rig.width, rig.left.K[0, 0], rig.warnings) == (424, 214.5, ())

    def test_chosen_numbers_can_be_scaled(self):
        assert load(write(text()), select="424x240", size=(848, 480)).left.K[0, 0] == 429

    def test_size_that_is_not_there_is_refused(self):
        path = write(text())
        assert refusal(path, size=(1280, 720)) == (
            "--size: 1280x720: no intrinsics for it in rig.yml: 424x240, 848x480, 640x480; name the one to be scaled "
            "with --select"
        )
        assert refusal(path, select="VGA") == "--select: VGA: the choice is between 424x240, 848x480, 640x480"

    def test_numbers_that_depend_on_the_format_are_told_apart(self):
        raw = blocks(sizes={(640, 480): (380.0, 380.0, 318.0, 238.0)}, formats="Y16")
        path = write(text(sizes=ONE, before=raw))
        assert "the largest of 640x480 {Y16}, 640x480 {Y8}; choose" in load(path).warnings[0]
        assert load(path, select="640x480 {Y8}").left.K[0, 0] == 390.5

    def test_what_is_not_available_is_left_out(self):
        rig = load(
            write(text(sizes=ONE, before=[("Infrared 1", (1280, 800), "Y16"), ("Infrared 2", (1280, 800), "Y16")]))
        )
        assert rig.width == 640


class TestLenses:
    @pytest.mark.parametrize("name", ["None", "Brown Conrady", "Inverse Brown Conrady", "Modified Brown Conrady"])
    def test_no_coefficients_are_no_lens(self, name):
        rig = load(write(text((name, [0] * 5), ONE)))
        assert (rig.left.model, rig.left.D.size) == ("radtan", 0)

    def test_rectified_images_are_warned_of(self):
        pair = [
            (stream, (640, 480), "Y8", (390.5, 390.5, 320.25, 237.5), *NONE) for stream in ("Infrared 1", "Infrared 2")
        ]
        rig = load(write(realsense(pair, [("Infrared 1", "Infrared 2", np.eye(3), [-0.05, 0, 0])])))
        assert rig.warnings == (
            'rig.yml: Intrinsic of "Infrared 2" / 640x480: these are cameras of images that are rectified already, '
            "which a core would leave as they are",
        )

    def test_modified_model_without_tangential_terms_is_opencvs(self):
        assert load(write(text(("Modified Brown Conrady", [-0.05, 0.06, 0, 0, -0.02]), ONE))).left.model == "radtan"

    def test_fisheyes_of_a_t265_are_equidistant(self):
        lens = "Kannala Brandt4", [-0.005, 0.04, -0.038, 0.006, 0]
        streams = "Fisheye 1", "Fisheye 2"
        rig = load(write(text(lens, ONE, streams, extrinsics=[(*streams, R, T)])))
        assert (rig.left.model, rig.right.D.tolist()) == ("equidistant", lens[1][:4])

    def test_ftheta_is_the_fov_model(self):
        rig = load(write(text(("Ftheta", [0.9, 0, 0, 0, 0]), ONE)))
        assert (rig.left.model, rig.left.D.tolist()) == ("fov", [0.9])

    @pytest.mark.parametrize("name, D, problem", [
        ("Inverse Brown Conrady", LENS[1],
         "its coefficients lead from the image to the ray; a rectifier needs those from the ray to the image"),
        ("Modified Brown Conrady", LENS[1], "with tangential terms it is not OpenCV's model"),
        ("Kannala Brandt4", LENS[1], "has 4 coefficients that are not zero"),
        ("Brown", LENS[1], "the models known are None, Brown Conrady, Modified Brown Conrady, Kannala Brandt4, Ftheta"),
    ])  # fmt: skip
    def test_other_models_are_refused_by_name(self, name, D, problem):
        title = 'rig.yml: Intrinsic of "Infrared 1" / 640x480: Distortion'
        assert refusal(write(text((name, D), ONE))) == f"{title} = {name}: {problem}"


@pytest.mark.parametrize("change, message", [
    (("Fx:", "F:"), 'Intrinsic of "Infrared 1" / 640x480: Fx = 0 values: 1 numbers are needed'),
    (("\t390.5\n", "\tmany\n"), 'Intrinsic of "Infrared 1" / 640x480: Fx[0] = many: not a finite number'),
    (("\t-0.02  \n", "\n"), 'Intrinsic of "Infrared 1" / 640x480: Coeffs = 4 values: 5 numbers are needed'),
    (("Width:    \t640", "Width:    \t320"),
     'Intrinsic of "Infrared 1" / 640x480: Width, Height = 320x480: not the size in the line above'),
    (('Extrinsic from "Infrared 1"', 'Extrinsic from "Infrared"'),
     'Extrinsic from "Infrared 1" To "Infrared 2": missing; rs-enumerate-devices prints it with -c'),
    (("Vector: -0.0502", "Vector: x"),
     'Extrinsic from "Infrared 1" To "Infrared 2": Translation Vector[0] = x: not a finite number'),
    (('Intrinsic of "Infrared 2"', 'Intrinsic of "Color"'),
     "Intrinsic of = Infrared 1, Color: two streams of a pair are needed, Infrared 1 and 2 or Fisheye 1 and 2"),
])  # fmt: skip
def test_bad_text_is_refused(change, message):
    content = text(sizes=ONE, before=())
    assert change[0] in content
    assert refusal(write(content.replace(*change, 1))) == f"rig.yml: {message}"


def test_text_of_two_devices_is_refused():
    assert refusal(write(text(sizes=ONE) + text(sizes=ONE))) == (
        'rig.yml: Extrinsic from "Infrared 1": given twice: the text of one device is needed'
    )


def test_lines_may_end_as_windows_ends_them():
    assert load(write(text(sizes=ONE).replace("\n", "\r\n").encode())).left.D.tolist() == LENS[1]
