"""The forms that values take in OpenCV's files: matrices, plain sequences, rotation vectors, numbers in quotes."""

import json

import cv2
import numpy as np
import pytest
from calibration_files import RECTIFICATION, RIG, UNUSED, as_xml, as_yaml, refusal, turn, write

from hdl.calibration import load
from hdl.geometry.rectification import RectificationOptions, rectify

MATRICES = [name for name, value in (RIG | RECTIFICATION).items() if isinstance(value, tuple)]


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def same(rig, other):
    for side in ("left", "right"):
        assert rig.camera(side).model == other.camera(side).model
        assert np.array_equal(rig.camera(side).K, other.camera(side).K)
        assert np.array_equal(rig.camera(side).D, other.camera(side).D)
    assert np.array_equal(rig.R, other.R) and np.array_equal(rig.T, other.T)
    assert (rig.width, rig.height) == (other.width, other.height)
    assert (rig.rectification is None) == (other.rectification is None)
    for side in rig.rectification or ():
        for ours, theirs in zip(rig.rectification[side], other.rectification[side]):
            assert np.array_equal(ours, theirs)


def sequence(value, nested):
    """A matrix as [a, b, ...], or as [[a, b], [c, d]]."""
    rows, cols, data = value
    parts = [f"[ {', '.join(data[cols * row : cols * row + cols])} ]" for row in range(rows)] if nested else data
    return f"[ {', '.join(parts)} ]"


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("name", MATRICES)
def test_each_may_be_a_sequence_of_numbers_or_of_rows(name, nested):
    fields = RIG | RECTIFICATION
    whole = load(write(as_yaml(fields)))
    same(load(write(as_yaml(fields | {name: sequence(fields[name], nested)}))), whole)


def test_all_may_be_nested_lists_in_json():
    fields = RIG | RECTIFICATION
    content = {
        name: np.reshape(value[2], value[:2]).astype(float).tolist() if isinstance(value, tuple) else value
        for name, value in fields.items()
    }
    same(load(write(json.dumps(content, indent=1), "rig.json"), format="opencv"), load(write(as_yaml(fields))))


def test_all_may_be_sequences_in_xml():
    fields = RIG | RECTIFICATION
    flat = {name: " ".join(value[2]) if isinstance(value, tuple) else value for name, value in fields.items()}
    same(load(write(as_xml(flat), "rig.xml")), load(write(as_yaml(fields))))


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_vectors_that_opencv_writes_as_sequences_are_read(suffix):
    """As it writes cv::Vec3d, cv::Vec4d, std::vector and cv::Size."""
    name = f"written.{suffix}"
    storage = cv2.FileStorage(name, cv2.FILE_STORAGE_WRITE)
    for key, values in (("image_size", [640, 480]), ("T", RIG["T"][2]), ("D1", RIG["D1"][2]), ("D2", RIG["D2"][2])):
        storage.startWriteStruct(key, cv2.FileNode_SEQ | cv2.FileNode_FLOW)
        for value in values:
            storage.write("", value if isinstance(value, int) else float(value))
        storage.endWriteStruct()
    for key in ("M1", "M2", "R"):
        storage.write(key, np.reshape(RIG[key][2], (3, 3)).astype(float))
    storage.release()
    same(load(name), load(write(as_yaml(RIG))))


def test_vector_may_be_one_element_of_several_channels():
    T = '!!opencv-matrix\n   rows: 1\n   cols: 1\n   dt: "3d"\n   data: [ -100., 1.5, -0.5 ]'
    same(load(write(as_yaml(RIG | {"T": T}))), load(write(as_yaml(RIG))))
    assert refusal(write(as_yaml(RIG | {"T": T.replace("3d", "2d")}))) == (
        "rig.yml: T = 1x2: 3 numbers in one row or column are needed"
    )
    assert refusal(write(as_yaml(RIG | {"T": T.replace("3d", "3x")}))) == (
        "rig.yml: T.dt = 3x: a matrix of numbers is needed"
    )


@pytest.mark.parametrize("R", [(3, 1, ["0.01", "-0.02", "0.03"]), (1, 3, ["0.01", "-0.02", "0.03"]),
                               "[ 0.01, -0.02, 0.03 ]", "[ [ 0.01 ], [ -0.02 ], [ 0.03 ] ]"])  # fmt: skip
def test_three_numbers_for_r_are_a_rotation_vector(R):
    assert load(write(as_yaml(RIG | {"R": R}))).R == pytest.approx(turn(0.01, -0.02, 0.03), abs=1e-15)


@pytest.mark.parametrize("name", ["image_size", "imageSize", "img_size", "Size", "size"])
@pytest.mark.parametrize("value", ["[ 640, 480 ]", (1, 2, ["640", "480"]), (2, 1, ["640.", "480."])])
def test_size_may_be_a_sequence_or_a_matrix(name, value):
    fields = {key: given for key, given in RIG.items() if not key.startswith("image_")}
    same(load(write(as_yaml(fields | {name: value}))), load(write(as_yaml(RIG))))


@pytest.mark.parametrize("names", [("img_width", "img_height"), ("width", "height")])
def test_size_may_be_two_numbers_of_other_names(names):
    fields = {key: given for key, given in RIG.items() if not key.startswith("image_")}
    same(load(write(as_yaml(fields | dict(zip(names, (640, 480)))))), load(write(as_yaml(RIG))))


@pytest.mark.parametrize("form", [as_yaml, as_xml])
def test_numbers_may_be_in_quotes(form):
    quoted = {"image_width": '"640"', "image_height": '"480"'}
    same(load(write(form(RIG | quoted))), load(write(form(RIG))))
    text = as_yaml(RIG).replace("-100., 1.5, -0.5", "\"-100.\", '1.5', -0.5").replace("rows: 1", "rows: '1'")
    assert "'1.5'" in text and "rows: '1'" in text
    same(load(write(text)), load(write(as_yaml(RIG))))


class TestFaultInWhatAnOptionLeavesUnused:
    BROKEN = [
        {"P2": (3, 4, ["-1."] * 12)},
        {"P1": (3, 4, [".Nan"] * 12)},
        {"P1": (3, 3, RIG["M1"][2])},
        {"R1": (3, 3, ["5."] * 9)},
        {"R2": 7},
        {"P2": (3, 4, [*RECTIFICATION["P2"][2][:3], "45000.", *RECTIFICATION["P2"][2][4:]])},
    ]

    @pytest.mark.parametrize("change", BROKEN)
    @pytest.mark.parametrize("options", [{"alpha": 0.5}, {"focal": 400}, {"fov": 60}, {"center": (300, 250)}])
    def test_is_refused_only_where_it_is_used(self, change, options):
        fields = RIG | RECTIFICATION
        rig = load(write(as_yaml(fields | change)))
        views = rectify(rig, RectificationOptions(**options), lens=True)
        without = {name: value for name, value in fields.items() if name not in ("R1", "R2", "P1", "P2")}
        expected = rectify(load(write(as_yaml(without))), RectificationOptions(**options), lens=True)
        for side, view in views.items():
            assert np.array_equal(view.P, expected[side].P) and np.array_equal(view.R, expected[side].R)
        assert refusal(write(as_yaml(fields | change))).endswith(UNUSED)

    def test_is_refused_with_the_advice_that_suits_a_fisheye(self):
        four = (1, 4, ["-0.01", "0.02", "-0.003", "0.004"])
        fisheye = RIG | {"D1": four, "D2": four, "model": "equidistant", "P1": 5}
        assert refusal(write(as_yaml(fisheye))).endswith("; --fov 65 would do")
        assert rectify(load("rig.yml"), RectificationOptions(fov=80), lens=True)

    def test_survives_a_change_of_size(self):
        assert refusal(write(as_yaml(RIG | RECTIFICATION | self.BROKEN[0])), size=(320, 240)).endswith(UNUSED)
