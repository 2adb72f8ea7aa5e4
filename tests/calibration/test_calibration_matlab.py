"""What the MAT-files of Bouguet's toolbox and of MATLAB mean, and which are refused."""

import cv2
import numpy as np
import pytest
from calibration_files import refusal
from format_files import bouguet_camera, matlab
from rig_numbers import BOUGUET
from scipy.io import savemat

from hdl.calibration import load


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def turn(*vector):
    return cv2.Rodrigues(np.array(vector, dtype=float))[0]


def mat(variables, name="rig.mat", **options):
    savemat(name, variables, **options)
    return name


class TestBouguet:
    @pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"oned_as": "column"}])
    def test_rotation_vector_and_millimetres(self, options):
        rig = load(mat(BOUGUET, **options))
        assert np.abs(rig.R - turn(*BOUGUET["om"])).max() < 1e-15
        assert rig.T.tolist() == [length / 1000 for length in BOUGUET["T"]]
        assert rig.left.D.tolist() == BOUGUET["kc_left"]
        assert rig.left.K[:2, 2].tolist() == BOUGUET["cc_left"]

    def test_skew_is_a_share_of_the_focal_length(self):
        rig = load(mat(BOUGUET | {"alpha_c_left": 0.001}))
        assert rig.left.K[0, 1] == pytest.approx(0.001 * BOUGUET["fc_left"][0])

    @pytest.mark.parametrize("change, message", [
        ({"T": None}, "T: missing"),
        ({"om": [1, 2]}, "om = 2 values: 3 numbers are needed"),
        ({"om": [100.0, 0, 0]}, "om = [100.0, 0.0, 0.0]: a rotation vector in rad is needed"),
        ({"nx": 640.5}, "nx = 640.5: a whole number of pixels is needed"),
        ({"kc_right": np.zeros(3)}, "kc_right = 3 values: 4 or 5 numbers are needed"),
        ({"fc_right": [1 + 2j, 3]}, "fc_right[0] = (1+2j): not a finite number"),
    ])  # fmt: skip
    def test_bad_variables_are_named(self, change, message):
        variables = {name: value for name, value in (BOUGUET | change).items() if value is not None}
        assert refusal(mat(variables)) == f"rig.mat: {message}"


class TestMatlab:
    R = turn(0.02, -0.03, 0.01)
    cameras = [bouguet_camera("left"), bouguet_camera("right")]

    def struct(self, change=None, **options):
        content = matlab(self.R, [-60.0, 1, 2], self.cameras, (640, 480), **options)
        for path, value in (change or {}).items():
            *groups, key = path.split(".")
            target = content
            for group in groups:
                target = target[group]
            target[key] = value
            if value is None:
                del target[key]
        return content

    @pytest.mark.parametrize("nested", [True, False])
    def test_rows_become_columns_and_pixels_count_from_zero(self, nested):
        rig = load(mat({"stereoParams": self.struct()} if nested else self.struct()))
        assert np.abs(rig.R - self.R).max() < 1e-15
        assert rig.T.tolist() == [-0.06, 0.001, 0.002] and rig.unit == "m"
        K, radial, tangential = self.cameras[0]
        assert np.abs(rig.left.K - K).max() < 1e-12
        assert rig.left.D.tolist() == [*radial[:2], *tangential, radial[2]]
        assert (rig.width, rig.height) == (640, 480)

    def test_skew_is_below_the_diagonal(self):
        K = np.array(self.cameras[0][0]) + [[0, -1.5, 1], [0, 0, 1], [0, 0, 0]]
        rig = load(mat({"s": self.struct({"CameraParameters1.IntrinsicMatrix": K.T})}))
        assert rig.left.K[0, 1] == -1.5

    def test_newer_matrix_is_not_transposed(self):
        K = np.array(self.cameras[0][0]) + [[0, 0, 1], [0, 0, 1], [0, 0, 0]]
        rig = load(mat({"s": self.struct({"CameraParameters1.K": K, "CameraParameters1.IntrinsicMatrix": None})}))
        assert np.abs(rig.left.K - self.cameras[0][0]).max() < 1e-12

    @pytest.mark.parametrize("unit, length", [("mm", 0.06), ("meters", 60), ("inches", 60 * 0.0254), ("CM", 0.6)])
    def test_world_units_are_those_of_the_struct(self, unit, length):
        rig = load(mat({"s": self.struct(unit=unit)}))
        assert rig.T[0] == pytest.approx(-length) and rig.unit == "m"

    def test_unknown_world_units_are_warned_of(self):
        rig = load(mat({"s": self.struct(unit="squares")}))
        assert (rig.T[0], rig.unit) == (-60, None)
        assert rig.warnings[0].startswith("rig.mat: s.CameraParameters1.WorldUnits = squares: not one of mm, ")

    def test_missing_image_size_is_that_of_the_caller(self):
        empty = {f"CameraParameters{number}.ImageSize": np.zeros((0, 0)) for number in (1, 2)}
        path = mat({"s": self.struct(empty)})
        rig = load(path, size=(640, 480))
        assert (rig.width, rig.height, rig.left.K[0, 0]) == (640, 480, self.cameras[0][0][0][0])
        assert refusal(path) == "rig.mat: s.CameraParameters1.ImageSize: empty: give the size of the images with --size"

    def test_two_radial_coefficients_are_enough(self):
        two = {f"CameraParameters{number}.RadialDistortion": [-0.3, 0.1] for number in (1, 2)}
        assert load(mat({"s": self.struct(two)})).left.D[:2].tolist() == [-0.3, 0.1]

    @pytest.mark.parametrize("change, message", [
        ({"RotationOfCamera2": None}, "s.RotationOfCamera2: missing"),
        ({"RotationOfCamera2": np.eye(4)}, "s.RotationOfCamera2 = 4 values: 9 numbers are needed"),
        ({"CameraParameters2": 5}, "s.CameraParameters2 = 5: named fields are needed here"),
        ({"CameraParameters2.ImageSize": [0, 1280]}, "s.CameraParameters2.ImageSize = 1280x0: an image size must lie "),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(mat({"s": self.struct(change)})).startswith(f"rig.mat: {message}")
