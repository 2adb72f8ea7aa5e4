"""Lenses that a file gives four coefficients of and no name: what they are taken for, what is said, what settles it."""

import cv2
import numpy as np
import pytest
from calibration_files import RIG, as_yaml, refusal, write
from format_files import bouguet_camera, ros
from rig_numbers import ASL, BOUGUET, KITTI, MYNT, ROS, TUM_VI

from hdl.calibration import load

RADTAN = "taken for radtan (k1, k2, p1, p2), as "
EQUIDISTANT = "taken for equidistant (k1 to k4 of cv::fisheye), as "
ZEROS = [0.0, 0.0, 0.0, 0.0]


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def matrix(values):
    values = np.atleast_2d(np.asarray(values, dtype=float))
    return *values.shape, list(map(repr, values.ravel().tolist()))


def K(fx, fy, cx, cy):
    return [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]


def unnamed(D1, D2, size=(640, 480), K1=None, K2=None, **more):
    """A file of OpenCV without a word about the lens; ``more``: matrices."""
    width, height = size
    K1 = K1 or K(0.6 * width, 0.6 * width, 0.49 * width, 0.52 * height)
    matrices = {"K1": K1, "D1": D1, "K2": K2 or K1, "D2": D2, "R": np.eye(3), "T": [[-0.1], [0.001], [0.002]]} | more
    fields = {name: matrix(values) for name, values in matrices.items()}
    return write(as_yaml({"image_width": width, "image_height": height} | fields))


def _cameras(rig, count=4):
    return [(K(*camera["intrinsics"]), camera["D"][:count]) for camera in rig["cameras"]], rig["size"]


def _kitti(*names):
    return [(np.reshape(KITTI[f"K_{name}"], (3, 3)).astype(float).tolist(), [float(d) for d in KITTI[f"D_{name}"][:4]])
            for name in names], (1392, 512)  # fmt: skip


def _ros(name):
    rig = ROS[name]
    return [(np.reshape(rig[side]["K"], (3, 3)).tolist(), rig[side]["D"][:4]) for side in ("left", "right")], rig[
        "size"
    ]


RIGS = {
    "tum_vi": ("equidistant", *_cameras(TUM_VI)),
    "mynteye_s_jpl": ("equidistant", *_cameras(ASL["mynteye_s_jpl"])),
    "mynteye_s1030": ("equidistant", [(K(*numbers[4:]), numbers[:4]) for numbers in MYNT["equidistant"]], (752, 480)),
    "mynteye_s1030_pinhole": ("radtan", [(K(*numbers[:4]), numbers[4:8]) for numbers in MYNT["pinhole"]], (752, 480)),
    "euroc": ("radtan", *_cameras(ASL["euroc"])),
    "realsense_d455": ("radtan", *_cameras(ASL["realsense_d455"])),
    "kitti_gray": ("radtan", *_kitti("00", "01")),
    "kitti_colour": ("radtan", *_kitti("02", "03")),
    "ps4eye": ("radtan", *_ros("ps4eye")),
    "concave_640": ("radtan", *_ros("concave_640")),
    "bouguet": ("radtan", [(bouguet_camera(side)[0], BOUGUET[f"kc_{side}"][:4]) for side in ("left", "right")],
                (640, 480)),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGS)
def test_numbers_of_real_lenses_are_told_apart_and_it_is_said(name):
    model, ((K1, D1), (K2, D2)), size = RIGS[name]
    rig = load(unnamed(D1, D2, size, K1, K2))
    assert (rig.left.model, rig.right.model) == (model, model)
    assert rig.left.D.tolist() == D1 and rig.right.D.tolist() == D2
    (warning,) = [warning for warning in rig.warnings if "--lens-model" in warning]
    assert warning.startswith("rig.yml: D1 = [")
    assert (EQUIDISTANT if model == "equidistant" else RADTAN) in warning


@pytest.mark.parametrize(
    "D1, D2, focal, said",
    [
        (ZEROS, ZEROS, 400, RADTAN + "p1 and p2 are often zero, and k3 and k4 are not"),
        ([-0.21, 0.09, 0, 0], [-0.2, 0.08, 0, 0], 400, RADTAN + "p1 and p2 are often zero, and k3 and k4 are not"),
        ([0.1, -0.2, 0.15, 0.04], [0.1, -0.2, 0.01, 0.004], 400, EQUIDISTANT + "p1 and p2 of a lens are thousandths"),
        ([-0.28, 0.03, 0.001, -0.0004], [-0.12, 0.03, 0.001, -0.0004], 400,
         RADTAN + "an equidistant lens with these coefficients would fold its image back"),
        ([-0.28, 0.08, 0.001, -0.0004], [-0.27, 0.07, 0.001, -0.0004], 400, RADTAN + "no fisheye has so small a k1"),
        ([-0.12, 0.0, 0.012, 0.0008], [-0.12, 0.0, 0.011, 0.0008], 246,
         EQUIDISTANT + "a radtan lens with these coefficients would fold its image back"),
        ([0.17, -0.03, 0.0004, -0.0007], [0.168, -0.031, 0.0005, -0.0006], 200,
         EQUIDISTANT + "a radtan lens of so wide a view does not magnify outwards"),
        ([-0.02, -0.01, 0.004, -0.002], [-0.02, -0.01, -0.005, 0.001], 400,
         EQUIDISTANT + "the last two have opposite signs in both cameras, as k3 and k4 do"),
        ([-0.02, -0.01, 0.004, -0.002], [-0.02, -0.01, 0.005, 0.001], 400,
         RADTAN + "the last two are thousandths, as p1 and p2 are"),
    ],
)  # fmt: skip
def test_reason_of_the_guess_is_said(D1, D2, focal, said):
    (warning,) = [line for line in load(unnamed(D1, D2, K1=K(focal, focal, 320, 240))).warnings if "lens" in line]
    equidistant = said.startswith(EQUIDISTANT)
    other = "radtan if they are k1, k2, p1, p2" if equidistant else "equidistant if they are k1 to k4 of cv::fisheye"
    start = f"rig.yml: D1 = {[float(d) for d in D1]}: four coefficients and no name of the lens: "
    assert warning == f"{start}{said}; --lens-model {other}"


class TestRectification:
    """Coefficients of which the numbers alone tell the wrong lens."""

    FISHEYE = [-0.02, -0.01, 0.0008, 0.0003], [-0.015, -0.012, 0.0007, 0.0004]
    RADTAN = [-0.02, -0.01, 0.004, -0.002], [-0.03, 0.02, -0.005, 0.001]
    SIZE, K1, K2 = (960, 800), K(602.0, 601.5, 478.0, 399.0), K(603.0, 603.2, 486.0, 407.0)
    R, T = cv2.Rodrigues(np.array([0.003, -0.004, 0.002]))[0], np.array([[-0.21], [0.0006], [0.0002]])

    def read(self, lenses, rectify, **options):
        D1, D2 = (np.array(D) for D in lenses)
        K1, K2 = np.array(self.K1), np.array(self.K2)
        R1, R2, P1, P2 = rectify(K1, D1, K2, D2, self.SIZE, self.R, self.T, **options)[:4]
        return load(unnamed(*lenses, self.SIZE, self.K1, self.K2, R=self.R, T=self.T, R1=R1, R2=R2, P1=P1, P2=P2))

    def test_numbers_alone_mislead_here(self):
        for lenses, misled in ((self.FISHEYE, "radtan"), (self.RADTAN, "equidistant")):
            assert load(unnamed(*lenses, self.SIZE, self.K1, self.K2, R=self.R, T=self.T)).left.model == misled

    @pytest.mark.parametrize("flags", [0, cv2.CALIB_ZERO_DISPARITY])
    @pytest.mark.parametrize("balance, fov_scale", [(0.0, 1.0), (0.5, 1.0), (1.0, 1.0), (0.0, 1.3)])
    def test_that_of_cv2_fisheye_has_a_fisheye(self, flags, balance, fov_scale):
        rig = self.read(self.FISHEYE, cv2.fisheye.stereoRectify, flags=flags, balance=balance, fov_scale=fov_scale)
        assert (rig.left.model, rig.right.model) == ("equidistant", "equidistant")
        assert EQUIDISTANT + "P1 and P2 are those of cv2.fisheye.stereoRectify; --lens-model radtan" in rig.warnings[0]

    @pytest.mark.parametrize("flags", [0, cv2.CALIB_ZERO_DISPARITY])
    @pytest.mark.parametrize("alpha", [-1, 0, 0.3, 1])
    def test_that_of_cv2_has_a_polynomial_lens(self, flags, alpha):
        rig = self.read(self.RADTAN, cv2.stereoRectify, flags=flags, alpha=alpha)
        assert (rig.left.model, rig.right.model) == ("radtan", "radtan")
        assert RADTAN + "P1 and P2 are those of cv2.stereoRectify; --lens-model equidistant" in rig.warnings[0]

    def test_another_one_leaves_it_to_the_numbers(self):
        def own(*setting):
            R1, R2, P1, P2 = cv2.stereoRectify(*setting)[:4]
            P1[0, 2] = P2[0, 2] = P1[1, 2] = P2[1, 2] = 350.0
            return R1, R2, P1, P2

        rig = self.read(self.FISHEYE, own)
        assert rig.left.model == "radtan" and rig.rectification


def test_other_camera_tells_which_lens_it_is():
    rig = load(unnamed([-0.02, -0.01, 0.004, -0.002], [-0.02, -0.01, 0.004, -0.002, 0.001]))
    assert rig.left.model == "radtan" and RADTAN + "the lens of the right camera is one" in rig.warnings[0]


@pytest.mark.parametrize("count", [0, 5, 8, 12, 14])
def test_other_counts_leave_no_doubt(count):
    D = [-0.02, -0.01, 0.004, -0.002, 0.001, 0.01, 0.02, 0.03][:count] + [0.0] * (count - 8)
    assert not [line for line in load(unnamed(D, D)).warnings if "lens" in line]


class TestOption:
    def test_settles_it_for_both_cameras_and_nothing_is_said(self):
        path = unnamed([-0.02, -0.01, 0.004, -0.002], [-0.02, -0.01, 0.005, -0.001])
        for model in ("radtan", "equidistant"):
            rig = load(path, lens_model=model)
            assert (rig.left.model, rig.right.model, rig.warnings) == (model, model, ())

    def test_may_name_more_terms_than_are_in_use_and_not_fewer(self):
        rational = [0.3, 0.05, 0.0002, 0.0001, 0.002, 0.33, 0.09, 0.009]
        assert load(unnamed(rational, rational[:5]), lens_model="rational").right.model == "radtan"
        assert refusal("rig.yml", lens_model="radtan") == (
            "--lens-model: radtan: rig.yml: D1 has coefficients of rational"
        )

    @pytest.mark.parametrize("change, model, message", [
        ({}, "equidistant", "equidistant: rig.yml: D1 has 5 coefficients, and such a lens 4"),
        ({"model": "plumb_bob"}, "equidistant", "equidistant: rig.yml: D1 is of a lens that the file calls radtan"),
        ({"fisheye_model": 0}, "equidistant", "equidistant: rig.yml: D1 is of a lens that the file calls radtan"),
        ({}, "telecentric", "telecentric: the lens models known are radtan, rational, thin_prism, "),
    ])  # fmt: skip
    def test_contradictions_are_refused_in_one_line(self, change, model, message):
        assert refusal(write(as_yaml(RIG | change)), lens_model=model).startswith(f"--lens-model: {message}")

    def test_of_a_fisheye_that_the_file_names_is_refused_too(self):
        four = (1, 4, ["-0.01", "0.02", "-0.003", "0.004"])
        path = write(as_yaml(RIG | {"D1": four, "D2": four, "model": "fisheye"}))
        message = "--lens-model: radtan: rig.yml: D1 is of a lens that the file calls equidistant"
        assert refusal(path, lens_model="radtan") == message
        assert load(path, lens_model="equidistant").warnings == ()


def test_ros_files_without_a_model_and_with_four_coefficients_are_guessed_at_too():
    """Older than distortion_model, or made from cv2.fisheye by hand."""
    for side, camera in zip(("left", "right"), TUM_VI["cameras"]):
        P = [190.0, 0, 256, 0 if side == "left" else -19.0, 0, 190.0, 256, 0, 0, 0, 1, 0]
        intrinsics = np.ravel(K(*camera["intrinsics"])).tolist()
        text = ros(TUM_VI["size"], intrinsics, camera["D"], [1, 0, 0, 0, 1, 0, 0, 0, 1], P, name=side)
        write(text.replace("distortion_model: plumb_bob\n", ""), f"{side}.yaml")
    rig = load("left.yaml", "right.yaml")
    assert rig.left.model == "equidistant" and "--lens-model radtan" in rig.warnings[0]
    assert load("left.yaml", "right.yaml", lens_model="radtan").left.model == "radtan"
