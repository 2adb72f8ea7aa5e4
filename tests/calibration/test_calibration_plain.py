"""Plain matrices under the names that people give them, in JSON, YAML and .npz, in one file or one a camera."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from calibration_files import as_xml, as_yaml, refusal, turn, write
from loose_files import NAMES, RIG, is_the_rig, nested, npz, renamed

from hdl.calibration import load, sides, spellings

CAMERAS = {"left": {"K": RIG["K1"], "D": RIG["D1"]}, "right": {"K": RIG["K2"], "D": RIG["D2"]}}
MOTION = {"R": RIG["R"], "T": RIG["T"]}


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def as_json(content, name="rig.json"):
    return write(json.dumps(content), name)


def opencv_matrices(content):
    """Every list as as_yaml and as_xml take matrices."""
    return {
        key: (*np.array(value).reshape(len(value), -1).shape, list(map(repr, map(float, np.ravel(value)))))
        if isinstance(value, list) and key != "image_size" else value
        for key, value in content.items()
    }  # fmt: skip


def as_opencv_json(content):
    matrices = {
        key: {"type_id": "opencv-matrix", "rows": value[0], "cols": value[1], "dt": "d",
              "data": [*map(float, value[2])]}
        if isinstance(value, tuple) else value
        for key, value in content.items()
    }  # fmt: skip
    return json.dumps(matrices, indent=4)


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("form", [as_json, npz, lambda content: write(yaml.safe_dump(content))])
def test_names_in_use_are_understood_in_every_form(names, form):
    rig = load(form(renamed(RIG, NAMES[names])))
    is_the_rig(rig)
    assert rig.format == "plain"


@pytest.mark.parametrize("name", ["sides first", "tutorial"])
@pytest.mark.parametrize("form", [as_yaml, as_xml, as_opencv_json])
def test_opencvs_files_with_other_names_than_its_samples_are_understood(name, form):
    matrices = opencv_matrices(renamed(RIG, NAMES[name]))
    del matrices["image_size"]
    is_the_rig(load(write(form(matrices | {"image_width": 640, "image_height": 480}))))


@pytest.mark.parametrize("content", [
    nested(RIG), {"cameras": {"cam1": CAMERAS["left"], "cam2": CAMERAS["right"]}, **MOTION, "size": [640, 480]},
    {"cam0": CAMERAS["left"] | {"resolution": [640, 480]}, "cam1": CAMERAS["right"] | {"resolution": [640, 480]},
     "extrinsics": MOTION},
])  # fmt: skip
def test_cameras_may_be_objects_of_their_own(content):
    is_the_rig(load(as_json(content)))


def test_numbers_in_a_flat_list_are_a_matrix_row_by_row():
    flat = {key: np.ravel(value).tolist() for key, value in RIG.items()}
    is_the_rig(load(as_json(flat)))


def test_scalars_of_the_same_names_are_no_matrices():
    """k1 and p1 are lens coefficients to others."""
    is_the_rig(load(as_json(RIG | {"k1": -0.25, "k2": 0.06, "p1": 0.001, "t": 12.5})))


class TestWhatTheFileStates:
    @pytest.mark.parametrize("change, unit, x", [
        ({"unit": "mm"}, "m", -1e-4), ({"units": "m"}, "m", -0.1), ({"unit": "cm"}, "m", -1e-3), ({}, None, -0.1),
    ])  # fmt: skip
    def test_unit_of_lengths(self, change, unit, x):
        rig = load(as_json(RIG | change))
        assert (rig.unit, rig.T[0]) == (unit, pytest.approx(x))

    def test_unit_in_the_name(self):
        rig = load(as_json(renamed(RIG, {"T": "translation_mm"})))
        assert (rig.unit, rig.T[0]) == ("m", pytest.approx(-1e-4))

    def test_unknown_unit_is_warned_of(self):
        rig = load(as_json(RIG | {"unit": "squares"}))
        assert rig.unit is None and len(rig.warnings) == 1
        assert rig.warnings[0].startswith("rig.json: unit = squares: not one of mm, millimeters, ")

    @pytest.mark.parametrize("change", [
        {"model": "fisheye"}, {"distortion_model": "equidistant"}, {"fisheye": True}, {"is_fisheye": 1},
    ])  # fmt: skip
    def test_lens(self, change):
        four = {"D1": [0.01, -0.02, 0.003, -0.001], "D2": [0.011, -0.021, 0.002, -0.002]}
        rig = load(as_json(RIG | four | change))
        assert (rig.left.model, rig.left.D.tolist(), rig.warnings) == ("equidistant", four["D1"], ())

    def test_lens_that_is_not_named_is_guessed_and_that_is_said(self):
        four = {"D1": [-0.25, 0.06, 0.001, 0.002], "D2": [-0.26, 0.07, 0.0015, -0.0003]}
        path = npz(RIG | four)
        rig = load(path)
        assert rig.left.model == "radtan"
        assert "four coefficients and no name of the lens: taken for radtan" in rig.warnings[0]
        assert load(path, lens_model="equidistant").left.model == "equidistant"

    @pytest.mark.parametrize("size", [
        {"imageSize": [640, 480]}, {"img_size": [[640], [480]]}, {"width": 640, "height": 480},
        {"image_width": 640, "image_height": 480}, {"left_image_size": [640, 480], "right_image_size": [640, 480]},
    ])  # fmt: skip
    def test_size(self, size):
        content = {key: value for key, value in RIG.items() if key != "image_size"}
        is_the_rig(load(as_json(content | size)))
        assert load(as_json(content), size=(640, 480)).width == 640
        problem = "missing: the calibration does not state the size of its images; give it with --size"
        assert refusal(as_json(content)) == f"rig.json: image_size: {problem}"

    def test_rectification(self):
        R = turn(0, 0.01, 0)
        P = [[450.0, 0, 300, 0], [0, 450, 250, 0], [0, 0, 1, 0]]
        rectified = {"R": np.eye(3).tolist(), "T": (R.T @ [-0.1, 0, 0]).tolist(), "R1": R.tolist(), "R2": R.tolist(),
                     "P1": P, "P2": [[450, 0, 300, -45], *P[1:]]}  # fmt: skip
        rig = load(as_json(RIG | rectified))
        assert rig.rectification["left"][1].tolist() == P and not rig.warnings
        assert load(npz(RIG | renamed(rectified, {"R1": "RL", "R2": "RR", "P1": "PL", "P2": "PR"}))).rectification
        del rectified["P2"]
        rig = load(as_json(RIG | rectified))
        assert rig.rectification is None
        assert rig.warnings == ("rig.json: R1: not used: R1, R2, P1 and P2 belong together, and there is no P2",)

    def test_numbers_that_begin_with_0_say_nothing_of_sides(self):
        names = {"K1": "K0", "D1": "D0", "K2": "K1", "D2": "D1"}
        is_the_rig(load(as_json(renamed(RIG, names))))
        other = {"K1": RIG["K2"], "D1": RIG["D2"], "K2": RIG["K1"], "D2": RIG["D1"],
                 "R": np.transpose(RIG["R"]).tolist(), "T": (-np.transpose(RIG["R"]) @ RIG["T"]).tolist()}  # fmt: skip
        rig = load(as_json(renamed(RIG | other, names)))
        assert rig.left.K.tolist() == RIG["K1"] and rig.T == pytest.approx([-0.1, 0.0015, -0.0005])
        assert rig.notes == (
            "rig.json: as the cameras stand, the left one is K1 of rig.json, the right one K0 of rig.json",
        )
        assert "the camera called left is on the right" in load(as_json(RIG | other)).warnings[0]


class TestOneFilePerCamera:
    """As OpenCV's calibration sample writes them, R and T beside or with one of them."""

    def camera(self, side, name=None, motion=False, form=as_yaml, lens=None):
        fields = {
            "camera_matrix": CAMERAS[side]["K"],
            "distortion_coefficients": [lens] if lens else CAMERAS[side]["D"],
        }
        fields = opencv_matrices(fields | (MOTION if motion else {}))
        stated = {"calibration_time": '"Mon Jan 12 2026"', "nframes": 20, "image_width": 640, "image_height": 480,
                  "board_width": 9, "flags": 2, "fisheye_model": 0, "avg_reprojection_error": 0.25}  # fmt: skip
        return write(form(stated | fields), name or f"{side}.yml")

    def motion(self):
        return write(as_yaml(opencv_matrices(MOTION)), "extrinsics.yml")

    @pytest.mark.parametrize("names", [
        ("left.yml", "right.yml"), ("right/calib.yml", "left/calib.yml"), ("cam_L.xml", "cam_R.xml"),
        ("camera1.yml", "camera2.yml"), ("cam0.yml", "cam1.yml"), ("intrinsics_Left.yml", "intrinsics_Right.yml"),
    ])  # fmt: skip
    @pytest.mark.parametrize("with_one", [False, True])
    def test_names_of_the_files_tell_the_sides(self, names, with_one):
        sides = ("right", "left") if names[0].startswith("right") else ("left", "right")
        for name in names:
            Path(name).parent.mkdir(exist_ok=True)
        form = as_xml if names[0].endswith("xml") else as_yaml
        paths = [self.camera(side, name, with_one and side == "right", form) for side, name in zip(sides, names)]
        paths += [] if with_one else [self.motion()]
        rig = load(*reversed(paths))
        is_the_rig(rig)
        found = dict(zip(sides, names))
        assert rig.origins == {"left": found["left"], "right": found["right"]}

    def test_a_folder_of_them_is_read(self):
        Path("rig").mkdir()
        for side in ("left", "right"):
            self.camera(side, f"rig/{side}.yml")
        Path(self.motion()).rename("rig/stereo.yml")
        is_the_rig(load("rig"))

    def test_r_may_be_a_rotation_vector(self):
        vector = {"R": [[0.01], [-0.02], [0.005]], "T": RIG["T"]}
        path = write(as_yaml(opencv_matrices(vector)), "extrinsics.yml")
        is_the_rig(load(self.camera("left"), self.camera("right"), path))

    def test_no_fisheye_is_said_by_a_zero(self):
        four = {"D": [-0.25, 0.06, 0.001, 0.002]}
        paths = [self.camera(side, lens=four["D"]) for side in CAMERAS]
        rig = load(*paths, self.motion())
        assert (rig.left.model, rig.left.D.tolist(), rig.warnings) == ("radtan", four["D"], ())

    def test_names_that_do_not_tell_leave_the_order_and_that_is_said(self):
        paths = [self.camera("left", "a.yml"), self.camera("right", "b.yml"), self.motion()]
        rig = load(*paths)
        assert rig.left.K.tolist() == RIG["K1"]
        assert rig.warnings == (
            "a.yml: taken for the left camera, as it was named first: the names of the files do not tell",
        )

    def test_numbered_cameras_are_called_by_where_they_stand(self):
        paths = [self.camera("right", "cam0.yml"), self.camera("left", "cam1.yml")]
        R = np.transpose(RIG["R"])
        back = {"R": R.tolist(), "T": (-R @ RIG["T"]).tolist()}
        rig = load(*paths, write(as_yaml(opencv_matrices(back)), "extrinsics.yml"))
        assert rig.left.K.tolist() == RIG["K1"] and rig.T == pytest.approx([-0.1, 0.0015, -0.0005])
        assert rig.origins == {"left": "cam1.yml", "right": "cam0.yml"} and len(rig.notes) == 1

    def test_archives_of_numpy_may_be_of_a_camera_each(self):
        paths = [npz({"mtx": CAMERAS[side]["K"], "dist": CAMERAS[side]["D"]}, f"{side}.npz") for side in CAMERAS]
        is_the_rig(load(*paths, npz(MOTION | {"img_size": [640, 480]}, "stereo.npz")))

    def test_what_is_missing_is_named(self):
        left, right, motion = self.camera("left"), self.camera("right"), self.motion()
        problem = "of one camera: name the other camera's file too, and the one that has R and T"
        assert refusal(left) == refusal(left, motion) == f"left.yml: {problem}"
        assert refusal(left, right) == (
            "left.yml, right.yml: R: missing; Rotation, rotation_matrix are understood too, and the like"
        )


class TestRefusals:
    @pytest.mark.parametrize("change, message", [
        ({"K2": [[1, 2], [3, 4]]}, "K2 = 2x2: a 3x3 matrix is needed"),
        ({"K2": [[1, 2, 3], [4, 5], [6]]}, "K2 = 3 values: 9 numbers are needed"),
        ({"K2": [1, 2, 3]}, "K2 = 3 values: 9 numbers are needed"),
        ({"D1": [[1, 2], [3, 4]]}, "D1 = 2x2: 0 or "),
        ({"D1": ["a"] * 5}, "D1[0] = a: not a finite number"),
        ({"D1": [0.1] * 3}, "D1 = 3 values: "),
        ({"T": [1, 2]}, "T = 2 values: 3 numbers in one row or column are needed"),
        ({"R": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]},
         "R = [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: not a rotation"),
        ({"image_size": [640]}, "image_size = 1 values: 2 numbers in one row or column are needed"),
        ({"image_size": "VGA"}, "image_size = VGA: a matrix with rows, cols, dt and data, or a sequence, is needed"),
        ({"fisheye": "perhaps"}, "fisheye = perhaps: true or false is needed"),
        ({"model": "magic"}, "model = magic: the lens models known are "),
        ({"camera_matrix_left": np.eye(3).tolist()}, "camera_matrix_left: also given as K1; keep one of them"),
        ({"width": 320, "height": 240}, "width, height = 320x240: not the image_size in rig.json, 640x480"),
    ])  # fmt: skip
    def test_bad_entries_are_named(self, change, message):
        assert refusal(as_json(RIG | change)).startswith(f"rig.json: {message}")

    @pytest.mark.parametrize("role, others", [
        ("D1", "dist1, distCoeffs1, dist_coeffs_left, distL"), ("R", "Rotation, rotation_matrix"),
        ("K2", "M1, cameraMatrix1, camera_matrix_left, mtxL"), ("T", "Translation, translation_vector"),
    ])  # fmt: skip
    def test_missing_matrix_is_named_and_names_are_given(self, role, others):
        content = {key: value for key, value in RIG.items() if key != role}
        assert refusal(as_json(content)) == f"rig.json: {role}: missing; {others} are understood too, and the like"

    def test_files_that_contradict_each_other_are_refused(self):
        as_json(RIG, "a.json")
        as_json(RIG | {"T": [-0.2, 0, 0]}, "b.json")
        assert refusal("a.json", "b.json") == "b.json: T: differs from the T in a.json; keep one of them"

    def test_mc_calib_is_refused_by_its_name(self):
        text = (
            "%YAML:1.0\n---\nnb_camera: 2\ncamera_0:\n   camera_matrix: !!opencv-matrix\n      rows: 3\n      cols: 3\n"
        )
        text += "      dt: d\n      data: [ 1. ]\n   camera_pose_matrix: !!opencv-matrix\n      rows: 4\n"
        for options in ({}, {"format": "opencv"}):
            assert refusal(write(text), **options) == (
                "rig.yml: camera_pose_matrix: a calibration of MC-Calib, which does not document whether its poses "
                "lead to the camera or from it; convert the pair to OpenCV's M1, D1, M2, D2, R and T with "
                "x_2 = R x_1 + T: T[0] < 0 if 2 is on the right"
            )


@pytest.mark.parametrize("names, told", [
    (("left.yml", "right.yml"), (0, True)), (("a_Right.yml", "a_Left.yml"), (1, True)),
    (("camL.yml", "camR.yml"), (0, True)), (("cam0.yml", "cam1.yml"), (0, False)),
    (("cam2.yml", "cam1.yml"), (1, False)), (("rig2_cam01", "rig2_cam00"), (1, False)),
    (("right/cam.yml", "left/cam.yml"), (1, True)), (("a.yml", "b.yml"), None), (("cam.yml", "cam.yml"), None),
    (("cam1.yml", "cam3.yml"), None),
])  # fmt: skip
def test_names_of_files_tell_sides_or_count_or_say_nothing(names, told):
    assert sides.by_name(*names) == told


def test_a_word_for_a_side_is_not_found_within_another():
    assert spellings.role("K_left") == ("K", "left") and spellings.role("leftovers") is None
    assert spellings.role("T") == ("T", "") and spellings.role("kit") is None
