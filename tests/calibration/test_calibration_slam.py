"""What the files of ROS, Kalibr, EuRoC, KITTI and ORB-SLAM mean: directions, units, choices, and what is refused."""

import numpy as np
import pytest
from calibration_files import refusal, transform, turn, write
from format_files import RIGS, TUM_VI_C1_C2, euroc, kalibr, kitti, orbslam, orbslam3, ros
from rig_numbers import ASL, KITTI, ORBSLAM, ROS, TUM_VI

from hdl.calibration import load

LEFT, RIGHT = (ROS["ps4eye"][side] for side in ("left", "right"))
EYE = np.eye(4).tolist()


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def ros_pair(left=None, right=None, **options):
    """left.yaml and right.yaml; ``left`` and ``right`` change matrices, ``options`` are those of ros()."""
    size = options.pop("size", ROS["ps4eye"]["size"])
    for side, entries, change in (("left", LEFT, left), ("right", RIGHT, right)):
        write(ros(size, **(entries | (change or {})), name=f"narrow_stereo/{side}", **options), f"{side}.yaml")
    return "left.yaml", "right.yaml"


class TestRos:
    def test_r_and_t_are_recovered(self):
        rig = load(*ros_pair())
        (R1, P1), (R2, P2) = rig.rectification.values()
        assert P2.ravel().tolist() == RIGHT["P"] and R1.ravel().tolist() == LEFT["R"]
        assert np.abs(R2 @ rig.R - R1).max() < 1e-15
        assert R2 @ rig.T == pytest.approx([-34.083392 / 433.812194, 0, 0], abs=1e-15)
        assert rig.fields["T"] == ("right.yaml", "projection_matrix")

    def test_order_of_the_files_does_not_matter(self):
        paths = ros_pair()
        ordered, reversed_ = load(*paths), load(*reversed(paths))
        assert np.array_equal(ordered.left.K, reversed_.left.K) and np.array_equal(ordered.T, reversed_.T)

    def test_one_file_is_not_enough(self):
        assert refusal(ros_pair()[0]) == "left.yaml: two camera_info files are needed, one of each camera"

    @pytest.mark.parametrize("size, message", [((0, 0), "0x0"), ((0, 400), "0x400")])
    def test_uncalibrated_size_is_refused(self, size, message):
        assert refusal(*ros_pair(size=size), size=(640, 400)) == (
            f"left.yaml: image_width, image_height = {message}: an image size must lie between 16 and 16384 px"
        )

    def test_vertical_pair_has_its_baseline_in_the_second_row(self):
        """camera_calibration writes -fy B there, and the upper camera is the left one."""
        P = [*LEFT["P"][:7], -34.08, *LEFT["P"][8:]]
        change = {"R": np.eye(3).ravel().tolist()}
        for paths in (ros_pair(change, change | {"P": P}), ("right.yaml", "left.yaml")):
            rig = load(*paths)
            assert rig.T == pytest.approx([0, -34.08 / LEFT["P"][5], 0]) and not rig.warnings
            assert rig.right.K[0, 0] == RIGHT["K"][0]

    @pytest.mark.parametrize("model, count, expected", [
        ("plumb_bob", 5, "radtan"), ("plumb_bob", 4, "radtan"), ("rational_polynomial", 8, "rational"),
        ("rational_polynomial", 12, "thin_prism"), ("rational_polynomial", 14, "tilted"),
        ("equidistant", 4, "equidistant"), ("fisheye", 4, "equidistant"),
    ])  # fmt: skip
    def test_lens_models(self, model, count, expected):
        lens = {"D": [0.001] * count}
        assert load(*ros_pair(lens, lens, model=model)).left.model == expected

    def test_names_that_contradict_the_geometry_are_warned_of(self):
        size = ROS["ps4eye"]["size"]
        write(ros(size, **LEFT, name="my_right_camera"), "left.yaml")
        write(ros(size, **RIGHT), "right.yaml")
        assert load("left.yaml", "right.yaml").warnings == (
            "left.yaml: camera_name = my_right_camera: yet by projection_matrix it is not the right one",
            "right.yaml: camera_name = narrow_stereo/left: yet by projection_matrix it is not the left one",
        )

    def test_binning_and_region_of_interest_are_warned_of(self):
        left, _ = ros_pair()
        with open(left, "a") as file:
            file.write("binning_x: 2\nroi:\n  x_offset: 0\n  y_offset: 8\n  height: 384\n  width: 640\n")
        assert load("left.yaml", "right.yaml").warnings == (
            "left.yaml: binning_x = 2: ignored: taken for full resolution",
            "left.yaml: roi = [0, 8, 640, 384]: ignored: taken for the whole image",
        )


class TestKalibr:
    cameras = [
        {"intrinsics": [400.0, 401, 320, 240], "D": [0.1, 0.2, 0.01, -0.01]},
        {"intrinsics": [402.0, 403, 322, 242], "D": [0.1, 0.2, 0.01, -0.02],
         "T_cn_cnm1": transform(turn(0.01, 0.02, 0.03), [-0.2, 0.01, 0.02])},
        {"intrinsics": [404.0, 405, 324, 238], "D": [0.1, 0.2, 0.01, -0.03],
         "T_cn_cnm1": transform(turn(-0.02, 0, 0.01), [-0.3, 0.01, 0.0])},
    ]  # fmt: skip

    def file(self, cameras=None, **options):
        return write(kalibr((640, 480), cameras or self.cameras, **options), "chain.yaml")

    def test_motion_from_the_camera_before(self):
        rig = load(self.file())
        assert rig.R == pytest.approx(turn(0.01, 0.02, 0.03), abs=1e-15)
        assert rig.T.tolist() == [-0.2, 0.01, 0.02]
        assert rig.left.K.tolist() == [[400, 0, 320], [0, 401, 240], [0, 0, 1]]

    def test_chain_is_followed_in_either_direction(self):
        path = self.file()
        rig, back = load(path, select="cam0,cam2"), load(path, select="2,0")
        expected = self.cameras[2]["T_cn_cnm1"] @ self.cameras[1]["T_cn_cnm1"]
        assert np.abs(rig.R - expected[:3, :3]).max() < 1e-15 and np.abs(rig.T - expected[:3, 3]).max() < 1e-15
        assert np.abs(back.R - rig.R.T).max() < 1e-15 and np.abs(back.T + rig.R.T @ rig.T).max() < 1e-15
        assert back.left.K[0, 0] == 404
        assert "the camera called left is on the right" in back.warnings[0]

    @pytest.mark.parametrize("inverted", [False, True])
    def test_imu_serves_where_cameras_are_not_chained(self, inverted):
        imu = [transform(turn(1, 2, 0.5), [0.1, 0.2, 0.3])]
        imu.append(self.cameras[1]["T_cn_cnm1"] @ imu[0])
        key, values = ("T_imu_cam", [np.linalg.inv(pose) for pose in imu]) if inverted else ("T_cam_imu", imu)
        cameras = [{"intrinsics": camera["intrinsics"], "D": camera["D"], key: pose}
                   for camera, pose in zip(self.cameras, values)]  # fmt: skip
        rig = load(self.file(cameras))
        assert np.abs(rig.R - turn(0.01, 0.02, 0.03)).max() < 1e-14
        assert np.abs(rig.T - [-0.2, 0.01, 0.02]).max() < 1e-14

    def test_chain_goes_before_the_imu_and_a_contradiction_is_warned_of(self):
        cameras = [camera | {"T_cam_imu": EYE} for camera in self.cameras]
        (warning,) = load(self.file(cameras)).warnings
        assert warning == (
            "chain.yaml: cam1.T_cn_cnm1 = [-0.2, 0.01, 0.02]: over the IMU it is [0.0, 0.0, 0.0]; this one is used"
        )

    def test_left_camera_is_the_one_on_the_left(self):
        cameras = [dict(camera) for camera in self.cameras[:2]]
        cameras[1]["T_cn_cnm1"] = np.linalg.inv(cameras[1]["T_cn_cnm1"])
        rig = load(self.file(cameras))
        assert rig.left.K[0, 0] == 402 and rig.T == pytest.approx([-0.2, 0.01, 0.02], abs=1e-15)
        assert rig.fields["K1"] == ("chain.yaml", "cam1.intrinsics") and not rig.warnings
        assert load("chain.yaml", select="0,1").T[0] > 0

    @pytest.mark.parametrize("change, message", [
        ({"model": "fisheye"}, "cam0.camera_model = fisheye: the camera models known are pinhole, omni, ds, eucm"),
        ({"lens": "ftheta"}, "cam0.distortion_model = ftheta: the lens models known are radtan, "),
    ])  # fmt: skip
    def test_lenses_that_cannot_be_read_are_named(self, change, message):
        assert refusal(self.file(**change)).startswith(f"chain.yaml: {message}")

    def test_lens_may_be_none(self):
        rig = load(self.file([camera | {"D": []} for camera in self.cameras], lens="none"))
        assert (rig.left.model, rig.left.D.size) == ("radtan", 0)

    def test_missing_motion_is_named(self):
        cameras = [{key: camera[key] for key in ("intrinsics", "D")} for camera in self.cameras]
        missing = "missing, and T_cam_imu or T_imu_cam of both cameras as well"
        assert refusal(self.file(cameras)) == f"chain.yaml: cam1.T_cn_cnm1: {missing}"
        assert refusal(self.file(cameras[:1])) == "chain.yaml: two cameras are needed, cam0 and cam1"

    @pytest.mark.parametrize("select", ["cam0", "cam0,cam0", "cam0,cam7", "a,b", "", ",", "0,1,2", "0,１"])
    def test_cameras_that_are_not_there_cannot_be_chosen(self, select):
        message = refusal(self.file(), select=select)
        assert message.startswith("--select: ")
        assert message.endswith("two of cam0, cam1, cam2 are needed, left first: LEFT,RIGHT")

    def test_wide_lens_of_tum_vi_is_equidistant(self):
        rig = load(*RIGS["tum_vi"].write())
        assert rig.left.D.tolist() == TUM_VI["cameras"][0]["D"]


class TestKitti:
    @pytest.mark.parametrize(
        "select, K", [(None, "00"), ("00,01", "00"), ("0,1", "00"), ("02,03", "02"), ("2, 3", "02")]
    )
    def test_pair_of_cameras_can_be_chosen(self, select, K):
        rig = load(write(kitti()), select=select)
        assert rig.left.K.ravel().tolist() == [float(number) for number in KITTI[f"K_{K}"]]
        assert rig.fields["K1"] == ("rig.yml", f"K_{K}")

    def test_motion_is_between_the_pair(self):
        rig = load(write(kitti()), select="01,03")
        matrices = {}
        for name in ("01", "03"):
            R, T = (np.array(KITTI[f"{role}_{name}"], dtype=float) for role in "RT")
            matrices[name] = transform(R.reshape(3, 3), T)
        expected = matrices["03"] @ np.linalg.inv(matrices["01"])
        assert np.abs(rig.R - expected[:3, :3]).max() < 1e-6 and np.abs(rig.T - expected[:3, 3]).max() < 1e-6
        assert "the camera called left is on the right" in " ".join(rig.warnings)

    def test_rectification_of_the_file_is_used_in_a_frame_as_large_as_the_source(self):
        rig = load(write(kitti()))
        R, P = rig.rectification["right"]
        assert P.ravel().tolist() == [float(number) for number in KITTI["P_rect_01"]]
        assert R.ravel().tolist() == [float(number) for number in KITTI["R_rect_01"]]
        assert (rig.width, rig.height) == (1392, 512)
        assert rig.rectification_warnings == (
            "rig.yml: S_rect_00 = 1242x375: KITTI's rectified images are the upper left corner, of this size, of the "
            "1392x512 here; with --alpha 0 the rectification is another one, which fills the frame",
        )

    def test_file_without_rectification_is_read(self):
        entries = {key: value for key, value in KITTI.items() if "rect" not in key}
        rig = load(write(kitti(entries)))
        assert rig.rectification is None and not rig.warnings

    @pytest.mark.parametrize("change, message", [
        ({"K_01": ["1"]}, "K_01 = 1 values: 9 numbers are needed"),
        ({"D_00": ["1", "x", "0", "0", "0"]}, "D_00[1] = x: not a finite number"),
        ({"S_01": ["640", "0"]}, "S_01 = 640x0: an image size must lie between"),
        ({"R_01": ["2"] * 9}, "R_01 = [[2.0, 2.0, 2.0], [2.0, 2.0, 2.0], [2.0, 2.0, 2.0]]: not a rotation: "),
        ({"P_rect_00": None}, "P_rect_00: missing"),
    ])  # fmt: skip
    def test_bad_entries_are_named(self, change, message):
        entries = {key: value for key, value in (KITTI | change).items() if value is not None}
        assert refusal(write(kitti(entries))).startswith(f"rig.yml: {message}")

    def test_repeated_and_shapeless_lines_are_refused(self):
        assert refusal(write(kitti() + "K_00: 1\n")) == "rig.yml: K_00: given twice, again in line 35"
        assert refusal(write(kitti() + "oops\n")) == "rig.yml: line 35 = oops: not of the form NAME: VALUES"


class TestEuroc:
    def files(self, **change):
        rig = ASL["euroc"]
        for index, camera in enumerate(rig["cameras"]):
            arguments = {"size": rig["size"]} | camera | (change if index else {})
            write(euroc(**arguments), f"cam{index}.yaml")
        return "cam0.yaml", "cam1.yaml"

    def test_order_of_the_files_does_not_matter(self):
        paths = self.files()
        assert load(*paths).left.K[0, 0] == load(*reversed(paths)).left.K[0, 0] == 458.654
        assert np.abs(load(*paths).T - load(*reversed(paths)).T).max() < 1e-14

    def test_t_bs_takes_points_to_the_body(self):
        left, right = (np.reshape(camera["T_BS"], (4, 4)) for camera in ASL["euroc"]["cameras"])
        expected = np.linalg.inv(right) @ left
        rig = load(*self.files())
        assert np.abs(rig.R - expected[:3, :3]).max() < 1e-9 and np.abs(rig.T - expected[:3, 3]).max() < 1e-9

    @pytest.mark.parametrize("change, message", [
        ({"camera": "orthographic"}, "camera_model = orthographic: the camera models known are pinhole, "),
        ({"lens": "ftheta"}, "distortion_model = ftheta: the lens models known are "),
        ({"size": [640, 0]}, "resolution = 640x0: an image size must lie between"),
        ({"T_BS": [1] * 16}, "T_BS = [1.0, 1.0, 1.0, 1.0]: the last row of a transformation must be 0 0 0 1"),
        ({"T_BS": [1] * 12}, "T_BS = 12 values: 16 numbers are needed"),
        ({"intrinsics": [1, 2, 3]}, "intrinsics = 3 values: 4 numbers are needed"),
        ({"D": [1, 2, 3]}, "distortion_coefficients = 3 values: 0 or 1 or 4 or 5 or 8 numbers are needed"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(*self.files(**change)).startswith(f"cam1.yaml: {message}")

    def test_more_or_fewer_than_two_files_are_refused(self):
        paths = self.files()
        assert refusal(paths[0]) == "cam0.yaml: two sensor.yaml files are needed, one of each camera"
        assert refusal(*paths, paths[0]).endswith(": two sensor.yaml files are needed, one of each camera")


class TestOrbslam:
    def test_r_and_t_are_recovered(self):
        rig = load(write(orbslam()))
        assert rig.T[0] == pytest.approx(-0.110073, abs=1e-5) and rig.unit is None
        assert rig.rectification["right"][1].ravel().tolist() == ORBSLAM["RIGHT.P"][2]

    @pytest.mark.parametrize("change, message", [
        ({"RIGHT.width": 0}, "RIGHT.width, RIGHT.height = 0x480: an image size must lie between"),
        ({"RIGHT.K": [2, 3, [1.0] * 6]}, "RIGHT.K = 2x3: a 3x3 matrix is needed"),
        ({"LEFT.R": [3, 3, [1.0] * 9]}, "LEFT.R = [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]: not a rotation"),
        ({"LEFT.P": [3, 4, [0.0] * 12]}, "LEFT.P = [[0.0, 0.0, 0.0], "),
        ({"RIGHT.P": [3, 4, [0.0, 0.0, 0.0, -47.9] * 3]}, "RIGHT.P = [[0.0, 0.0, 0.0, -47.9], "),
        ({"Camera.type": '"KannalaBrandt8"'}, "Camera.type = KannalaBrandt8: LEFT and RIGHT are understood"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        assert refusal(write(orbslam(ORBSLAM | change))).startswith(f"rig.yml: {message}")


class TestOrbslam3:
    def test_t_c1_c2_is_where_the_right_camera_stands(self):
        rig = load(write(orbslam3(TUM_VI["size"], TUM_VI["cameras"], TUM_VI_C1_C2)))
        chain = load(write(kalibr(TUM_VI["size"], TUM_VI["cameras"], TUM_VI["lens"])))
        assert np.abs(rig.R - chain.R).max() < 1e-12 and np.abs(rig.T - chain.T).max() < 1e-12
        assert rig.right.D.tolist() == TUM_VI["cameras"][1]["D"]

    @pytest.mark.parametrize("count", [0, 4, 5])
    def test_pinhole_cameras_have_no_four_or_five_coefficients(self, count):
        cameras = [{**camera, "D": camera["D"][:count]} for camera in ASL["euroc"]["cameras"]]
        cameras[0]["D"] = [*cameras[0]["D"], 0.01][:count]
        cameras[1]["D"] = [*cameras[1]["D"], 0.01][:count]
        rig = load(write(orbslam3(ASL["euroc"]["size"], cameras, TUM_VI_C1_C2, "PinHole")))
        assert rig.left.model == "radtan" and rig.left.D.tolist() == cameras[0]["D"]
        assert rig.right.K[0].tolist() == [cameras[1]["intrinsics"][0], 0, cameras[1]["intrinsics"][2]]

    @pytest.mark.parametrize("change, message", [
        ({"Camera.type": '"Fisheye"'}, "Camera.type = Fisheye: PinHole, KannalaBrandt8, Rectified are understood"),
        ({"Camera2.k4": "many"}, "Camera2.k4 = many: not a finite number"),
        ({"Camera.width": 0}, "Camera.width, Camera.height = 0x512: an image size must lie between"),
        ({"Stereo.T_c1_c2": [1, 2]}, "Stereo.T_c1_c2 = 2 values: 16 numbers are needed"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        text = orbslam3(TUM_VI["size"], TUM_VI["cameras"], TUM_VI_C1_C2, changes=change)
        assert refusal(write(text)).startswith(f"rig.yml: {message}")
