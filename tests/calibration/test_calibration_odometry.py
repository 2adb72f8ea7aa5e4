"""Basalt, OKVIS, ASLAM, OV2SLAM, stella_vslam and ORB-SLAM3's older settings: what they mean, and what is refused."""

import json

import numpy as np
import pytest
from calibration_files import refusal, transform, turn, write
from format_files import euroc, kalibr, orbslam
from rig_numbers import ASL, ORBSLAM, TUM_VI
from slam_files import EUROC, FISHEYE, aslam, basalt, okvis, orbslam3_old, ov2slam, stella

from hdl.calibration import load

SIZE = (640, 480)
BODY = transform(turn(1.2, -1.1, 1.3), [0.02, 0.06, 0.01])
RIGHT = transform(turn(0.01, -0.02, 0.005), [0.11, 0.002, -0.003])  # from the right camera to the left one
MOTION = np.linalg.inv(RIGHT)
PAIR = [{"intrinsics": [401.5, 402.5, 320.25, 240.75], "D": [-0.21, 0.05, 0.0004, -0.0002], "T_BS": BODY},
        {"intrinsics": [403.5, 404.5, 318.25, 241.75], "D": [-0.22, 0.06, 0.0003, 0.0001], "T_BS": BODY @ RIGHT},
        ]  # fmt: skip
LISTS = {"basalt": basalt, "okvis": okvis, "aslam": aslam}


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def same(rig, other, tolerance=1e-9):
    """The same numbers, and the same lens, up to zeros at the end of D."""
    assert (rig.width, rig.height) == (other.width, other.height)
    for side in ("left", "right"):
        camera, its = rig.camera(side), other.camera(side)
        assert camera.model == its.model and np.array_equal(camera.K, its.K)
        count = max(camera.D.size, its.D.size)
        assert np.array_equal(*(np.pad(D, (0, count - D.size)) for D in (camera.D, its.D)))
    assert np.abs(rig.R - other.R).max() < tolerance and np.abs(rig.T - other.T).max() < tolerance


@pytest.fixture
def real():
    """The rigs of EuRoC and TUM-VI, from the files of other programs."""
    pair = [write(euroc(ASL["euroc"]["size"], *camera.values()), f"cam{n}.yaml") for n, camera in enumerate(EUROC)]
    chain = write(kalibr(TUM_VI["size"], TUM_VI["cameras"], TUM_VI["lens"]), "chain.yaml")
    return load(*pair), load(chain)


@pytest.mark.parametrize("text, fisheye", [
    (basalt, {"kind": "kb4"}), (okvis, {"kind": "equidistant"}), (aslam, {"lens": "equidistant"}),
    (ov2slam, {"kind": "fisheye"}),
])  # fmt: skip
def test_real_rigs_are_the_same_in_every_form(text, fisheye, real):
    radtan, equidistant = real
    same(load(write(text(ASL["euroc"]["size"], EUROC))), radtan)
    same(load(write(text(TUM_VI["size"], FISHEYE, **fisheye))), equidistant)


@pytest.mark.parametrize("text", [*LISTS.values(), ov2slam])
def test_poses_lead_from_the_camera_to_the_body(text):
    rig = load(write(text(SIZE, PAIR)))
    assert np.abs(rig.R - MOTION[:3, :3]).max() < 1e-12 and np.abs(rig.T - MOTION[:3, 3]).max() < 1e-12
    assert rig.left.K.tolist() == [[401.5, 0, 320.25], [0, 402.5, 240.75], [0, 0, 1]]
    assert (rig.unit, rig.warnings, rig.notes) == ("m", (), ())


class TestLists:
    """Of cameras: Basalt's, OKVIS' and ASLAM's."""

    @pytest.mark.parametrize("name", LISTS)
    def test_the_camera_on_the_left_is_called_left_and_that_is_said(self, name):
        rig = load(write(LISTS[name](SIZE, PAIR[::-1])))
        assert rig.left.K[0, 0] == 401.5 and np.abs(rig.T - MOTION[:3, 3]).max() < 1e-12
        assert rig.origins == {"left": "camera 1 of rig.yml", "right": "camera 0 of rig.yml"}
        assert rig.notes == (
            "rig.yml: as the cameras stand, the left one is camera 1 of rig.yml, the right one camera 0 of rig.yml",
        )

    @pytest.mark.parametrize("name", LISTS)
    def test_two_of_several_can_be_chosen_and_stay_as_they_were_chosen(self, name):
        third = PAIR[0] | {"intrinsics": [300.0, 301, 322, 239], "T_BS": BODY @ transform(np.eye(3), [0.2, 0, 0])}
        path = write(LISTS[name](SIZE, [*PAIR, third]))
        assert load(path).right.K[0, 0] == 403.5
        rig, back = load(path, select="0,2"), load(path, select="2,0")
        assert rig.right.K[0, 0] == back.left.K[0, 0] == 300 and np.abs(rig.T - [-0.2, 0, 0]).max() < 1e-12
        assert "the camera called left is on the right" in back.warnings[0]
        assert refusal(path, select="0,3") == "--select: 0,3: two of 0, 1, 2 are needed, left first: LEFT,RIGHT"

    @pytest.mark.parametrize("name, field", [
        ("basalt", "value0.intrinsics"), ("okvis", "cameras"), ("aslam", "cameras"),
    ])  # fmt: skip
    def test_one_camera_is_no_rig(self, name, field):
        message = refusal(write(LISTS[name](SIZE, PAIR[:1])))
        assert message == f"rig.yml: {field} = 1: two cameras are needed"


class TestBasalt:
    def test_file_without_the_outer_object_is_read(self):
        same(load(write(basalt(SIZE, PAIR, whole=False))), load(write(basalt(SIZE, PAIR), "whole.json")))

    def test_pinhole_has_no_lens_and_radtan8_is_rational(self):
        assert load(write(basalt(SIZE, PAIR, "pinhole"))).left.D.size == 0
        eight = [camera | {"D": [0.1, 0.2, 0.001, 0.002, 0.03, 0.4, 0.5, 0.06]} for camera in PAIR]
        rig = load(write(basalt(SIZE, eight)))
        assert rig.left.model == "rational" and rig.left.D.tolist() == eight[0]["D"]

    @pytest.mark.parametrize("kind, D, model, expected", [
        ("ds", [-0.2, 0.6], "double_sphere", [-0.2, 0.6]), ("eucm", [0.6, 1.1], "eucm", [0.6, 1.1]),
        ("ucm", [0.6], "eucm", [0.6, 1.0]),
    ])  # fmt: skip
    def test_lenses_of_more_than_pinhole_cameras(self, kind, D, model, expected):
        rig = load(write(basalt(SIZE, [camera | {"D": D} for camera in PAIR], kind)))
        assert (rig.left.model, rig.left.D.tolist()) == (model, expected)

    @pytest.mark.parametrize("change, message", [
        (lambda value: value["intrinsics"][1].update(camera_type="bal"),
         "intrinsics[1].camera_type = bal: the camera types known are pinhole, pinhole-radtan8, kb4, ds, eucm, ucm, "
         "fov"),
        (lambda value: value["intrinsics"][1]["intrinsics"].pop("k2"), "intrinsics[1].intrinsics.k2: missing"),
        (lambda value: value["T_imu_cam"][0].update(qw=2.0),
         "T_imu_cam[0].qx, qy, qz, qw = [0.6, 0.0, 0.0, 2.0]: no rotation: the quaternion is of length 2.088, not 1"),
        (lambda value: value["T_imu_cam"][0].update(px="x"), "T_imu_cam[0].px = x: not a finite number"),
        (lambda value: value["T_imu_cam"].pop(),
         "T_imu_cam, intrinsics, resolution = 1, 2, 2: as many of each are needed"),
        (lambda value: value.update(resolution=640),
         "T_imu_cam, intrinsics, resolution = 2, 2, 640: as many of each are needed"),
        (lambda value: value["resolution"].__setitem__(1, [640]), "resolution[1] = 1 values: 2 numbers are needed"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        straight = [camera | {"T_BS": transform(np.eye(3), [x, 0, 0])} for camera, x in zip(PAIR, (0, 0.1))]
        content = json.loads(basalt(SIZE, straight))
        content["value0"]["T_imu_cam"][0] |= {"qx": 0.6, "qy": 0.0, "qz": 0.0, "qw": 0.8}
        change(content["value0"])
        assert refusal(write(json.dumps(content))) == f"rig.yml: value0.{message}"


class TestOkvis:
    def test_eight_coefficients_are_rational(self):
        eight = [camera | {"D": [0.1, 0.2, 0.001, 0.002, 0.03, 0.4, 0.5, 0.06]} for camera in PAIR]
        assert load(write(okvis(SIZE, eight, "radialtangential8"))).right.model == "rational"

    @pytest.mark.parametrize("change, message", [
        (("distortion_type: radialtangential", "distortion_type: magic"),
         "cameras[0].distortion_type = magic: the lenses known are radialtangential, radialtangential8, plumb_bob, "
         "plumb_bob8, equidistant"),
        (("focal_length: [401.5, 402.5]", "focal_length: [401.5]"),
         "cameras[0].focal_length = 1 values: 2 numbers are needed"),
        (("image_dimension: [640, 480]", "image_dimension: [640, 0]"),
         "cameras[0].image_dimension = 640x0: an image size must lie between 16 and 16384 px"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(write(okvis(SIZE, PAIR).replace(*change, 1))) == f"rig.yml: {message}"


class TestAslam:
    def test_pose_may_lead_the_other_way(self):
        same(load(write(aslam(SIZE, PAIR, inverted=True))), load(write(aslam(SIZE, PAIR), "same.yaml")))

    def test_lens_may_be_none(self):
        assert load(write(aslam(SIZE, PAIR, lens="none"))).left.D.size == 0

    @pytest.mark.parametrize("lens, kind, D, model, expected", [
        ("fisheye", "pinhole", [0.9], "fov", [0.9]),
        ("radial-tangential", "unified-projection", [-0.1, 0.02, 0.001, 0.002], "mei", [1.2, -0.1, 0.02, 0.001, 0.002]),
    ])  # fmt: skip
    def test_lenses_of_more_than_pinhole_cameras(self, lens, kind, D, model, expected):
        own = [1.2] if model == "mei" else []
        pair = [camera | {"D": D, "intrinsics": [*own, *camera["intrinsics"]]} for camera in PAIR]
        rig = load(write(aslam(SIZE, pair, lens, kind)))
        assert (rig.left.model, rig.left.D.tolist()) == (model, expected)

    @pytest.mark.parametrize("options, message", [
        ({"lens": "magic"}, "cameras[0].camera.distortion.type = magic: the lenses known are none, no-distortion, "
                            "radial-tangential, equidistant, fisheye"),
        ({"kind": "generic"},
         "cameras[0].camera.type = generic: pinhole, or unified-projection with radial-tangential, is needed"),
        ({"lens": "fisheye"}, "cameras[0].camera.distortion.parameters = 4 values: 1 numbers are needed"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, options, message):
        assert refusal(write(aslam(SIZE, PAIR, **options))) == f"rig.yml: {message}"


class TestOv2slam:
    def test_sides_stay_as_the_file_calls_them(self):
        rig = load(write(ov2slam(SIZE, PAIR[::-1])))
        assert rig.left.K[0, 0] == 403.5
        assert rig.origins["left"] == "the left camera of rig.yml" and not rig.notes
        assert rig.warnings[0].startswith("rig.yml: body_T_cam1 = [0.1")
        assert "the camera called left is on the right" in rig.warnings[0]

    @pytest.mark.parametrize("change, message", [
        ({"Camera.model_right": "mei"}, "Camera.model_right = mei: pinhole and fisheye are understood"),
        ({"Camera.k2r": None}, "Camera.k2r: missing"),
        ({"Camera.right_nwidth": 0},
         "Camera.right_nwidth, Camera.right_nheight = 0x480: an image size must lie between 16 and 16384 px"),
        ({"body_T_cam1": "[1, 2]"}, "body_T_cam1 = 2 values: 16 numbers are needed"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(write(ov2slam(SIZE, PAIR, changes=change))) == f"rig.yml: {message}"


class TestStella:
    """EuRoC as ORB-SLAM2's authors rectified it."""

    rectified = [ORBSLAM["LEFT.P"][2][0], ORBSLAM["LEFT.P"][2][5], ORBSLAM["LEFT.P"][2][2], ORBSLAM["LEFT.P"][2][6],
                 -ORBSLAM["RIGHT.P"][2][3]]  # fmt: skip
    cameras = [{key: ORBSLAM[f"{side}.{key}"][2] for key in "KDR"} for side in ("LEFT", "RIGHT")]

    def text(self, **options):
        return stella((752, 480), self.rectified, self.cameras, **options)

    @pytest.mark.parametrize("nested", [True, False])
    def test_rig_follows_from_the_rectification(self, nested):
        rig, other = load(write(self.text(nested=nested))), load(write(orbslam(), "orbslam.yaml"))
        same(rig, other, 1e-12)
        for side in ("left", "right"):
            for ours, theirs in zip(rig.rectification[side], other.rectification[side]):
                assert np.array_equal(ours, theirs)
        assert rig.unit is None and not rig.warnings
        assert rig.origins["right"] == "StereoRectifier.K_right of rig.yml"

    def test_fisheye_is_equidistant(self):
        cameras = [{"K": camera["K"], "D": [0.01, -0.02, 0.003, -0.001], "R": camera["R"]} for camera in self.cameras]
        rig = load(write(stella((752, 480), self.rectified, cameras, model="fisheye")))
        assert (rig.left.model, rig.right.D.tolist()) == ("equidistant", [0.01, -0.02, 0.003, -0.001])

    @pytest.mark.parametrize("change, message", [
        (("  cols: 752", "  columns: 752"), "Camera.cols: missing"),
        (("  K_right: [", "  K_right: [1, "), "StereoRectifier.K_right = 10 values: 9 numbers are needed"),
        (("Mapping:", "  model: equirectangular\nMapping:"),
         "StereoRectifier.model = equirectangular: perspective and fisheye are understood"),
        (("  R_left: [0.9", "  R_left: [1.9"), "StereoRectifier.R_left = [[1.999966347530033, "),
        (("  fx: 435", "  fx: -435"), "Camera.fx, fy, focal_x_baseline = [[-435.2046959714599, "),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(write(self.text().replace(*change, 1))).startswith(f"rig.yml: {message}")


class TestOrbslam3sOlderSettings:
    @pytest.mark.parametrize("rows", [3, 4, "3 of 4"])
    def test_tlr_takes_points_of_the_right_camera_to_the_left_one(self, rows, real):
        same(load(write(orbslam3_old(TUM_VI["size"], FISHEYE, rows=rows))), real[1], 1e-12)
        rig = load(write(orbslam3_old(SIZE, PAIR, "PinHole", rows)))
        assert np.abs(rig.R - MOTION[:3, :3]).max() < 1e-12 and np.abs(rig.T - MOTION[:3, 3]).max() < 1e-12
        assert rig.left.model == "radtan" and rig.right.D.tolist() == PAIR[1]["D"]
        assert rig.origins == {"left": "Camera of rig.yml", "right": "Camera2 of rig.yml"}

    @pytest.mark.parametrize("change, message", [
        ({"Tlr": None}, "Tlr: missing"),
        ({"Tlr": "!!opencv-matrix\n  rows: 3\n  cols: 4\n  data: [ 1., 0. ]"}, "Tlr = 3x4: a 4x4 matrix is needed"),
        ({"Camera.k3": None}, "Camera.k3: missing"),
        ({"Camera.type": '"Fisheye"'}, "Camera.type = Fisheye: PinHole, KannalaBrandt8, Rectified are understood"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(write(orbslam3_old(TUM_VI["size"], FISHEYE, changes=change))) == f"rig.yml: {message}"

    def test_rectified_images_are_of_two_equal_cameras_without_a_lens(self):
        text = (
            '%YAML:1.0\nFile.version: "1.0"\nCamera.type: "Rectified"\nCamera1.fx: 382.5\nCamera1.fy: 382.25\n'
            "Camera1.cx: 320.5\nCamera1.cy: 236.5\nStereo.b: 0.05\nCamera.width: 640\nCamera.height: 480\n"
        )
        rig = load(write(text))
        assert rig.left.K.tolist() == rig.right.K.tolist() == [[382.5, 0, 320.5], [0, 382.25, 236.5], [0, 0, 1]]
        assert rig.T.tolist() == [-0.05, 0, 0] and np.array_equal(rig.R, np.eye(3)) and rig.left.D.size == 0
        assert rig.warnings == (
            "rig.yml: Camera1.fx, fy, cx, cy: these are cameras of images that are rectified already, which a core "
            "would leave as they are",
        )
        assert refusal(write(text.replace("Stereo.b", "b"))) == "rig.yml: Stereo.b: missing"
