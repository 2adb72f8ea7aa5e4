"""VINS' configurations and camodocal's cameras: which files belong together, and what they mean."""

from pathlib import Path

import numpy as np
import pytest
from calibration_files import refusal, transform, turn, write
from format_files import euroc, kalibr
from rig_numbers import ASL, OCAM, TUM_VI
from scipy.spatial.transform import Rotation
from slam_files import EUROC, FISHEYE, camodocal, vins

from hdl.calibration import lenses, load

SIZE = (640, 480)
MOTION = transform(turn(0.01, -0.02, 0.005), [-0.11, 0.002, -0.003])  # from the left camera to the right one
PAIR = [{"intrinsics": [401.5, 402.5, 320.25, 240.75], "D": [-0.21, 0.05, 0.0004, -0.0002], "T_BS": np.eye(4)},
        {"intrinsics": [403.5, 404.5, 318.25, 241.75], "D": [-0.22, 0.06, 0.0003, 0.0001],
         "T_BS": np.linalg.inv(MOTION)}]  # fmt: skip


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def files(size=SIZE, cameras=PAIR, kind="PINHOLE", names=("left.yaml", "right.yaml"), changes=(), folder="."):
    """Writes the configuration and both cameras; gives the configuration's path."""
    for name, camera in zip(names, cameras):
        path = Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write(camodocal(size, camera, kind), path)
    return str(write(vins(size, cameras, names, changes), Path(folder) / "vins.yaml"))


@pytest.mark.parametrize("size, cameras, kind, other", [
    (ASL["euroc"]["size"], EUROC, "PINHOLE",
     {f"cam{n}.yaml": euroc(ASL["euroc"]["size"], *camera.values()) for n, camera in enumerate(EUROC)}),
    (TUM_VI["size"], FISHEYE, "KANNALA_BRANDT",
     {"chain.yaml": kalibr(TUM_VI["size"], TUM_VI["cameras"], TUM_VI["lens"])}),
])  # fmt: skip
def test_real_rigs_are_the_same_as_in_other_forms(size, cameras, kind, other):
    rig = load(files(size, cameras, kind))
    known = load(*(write(text, name) for name, text in other.items()))
    assert np.abs(rig.R - known.R).max() < 1e-12 and np.abs(rig.T - known.T).max() < 1e-12
    for side in ("left", "right"):
        ours, theirs = rig.camera(side), known.camera(side)
        assert ours.model == theirs.model and np.array_equal(ours.K, theirs.K) and np.array_equal(ours.D, theirs.D)


def test_cameras_are_looked_for_beside_the_configuration():
    path = files(folder="config", names=("848x800/left.yaml", "848x800/right.yaml"))
    rig = load(path)
    assert np.abs(rig.R - MOTION[:3, :3]).max() < 1e-15 and np.abs(rig.T - MOTION[:3, 3]).max() < 1e-15
    assert rig.origins == {"left": "cam0 of vins.yaml", "right": "cam1 of vins.yaml"}
    assert (rig.unit, rig.format, rig.source) == ("m", "vins", "config/vins.yaml")
    assert rig.fields["D2"] == ("config/848x800/right.yaml", "distortion_parameters")


def test_cameras_that_are_given_are_taken_and_so_is_a_folder():
    path = files(folder="config")
    Path("elsewhere").mkdir()
    moved = [str(Path(f"config/{side}.yaml").rename(f"elsewhere/{side}.yaml")) for side in ("left", "right")]
    assert refusal(path) == "config/left.yaml: cannot be read: No such file or directory"
    assert load(path, *moved).left.K[0, 0] == load(*moved, path).left.K[0, 0] == 401.5
    files(folder="whole")
    assert load("whole").right.K[0, 0] == 403.5


def test_the_camera_on_the_left_is_called_left_and_that_is_said():
    rig = load(files(cameras=PAIR[::-1]))
    assert rig.left.K[0, 0] == 401.5 and np.abs(rig.T - MOTION[:3, 3]).max() < 1e-15
    assert rig.notes == (
        "vins.yaml: as the cameras stand, the left one is cam1 of vins.yaml, the right one cam0 of vins.yaml",
    )


def test_one_file_may_serve_for_both_cameras():
    assert load(files(names=("cam.yaml", "cam.yaml"))).left.K[0, 0] == 403.5


def test_coefficients_of_a_fisheye_may_be_with_the_distortion():
    text = camodocal(SIZE, PAIR[0], "KANNALA_BRANDT")
    moved = text.replace("projection_parameters:", "distortion_parameters:").replace(
        "   mu:", "projection_parameters:\n   mu:"
    )
    path = files(kind="KANNALA_BRANDT")
    rig = load(path)
    write(moved, "left.yaml")
    assert load(path).left.D.tolist() == rig.left.D.tolist() == PAIR[0]["D"]


@pytest.mark.parametrize("kind", ["MEI", "mei"])
def test_mirror_of_mei_is_the_first_coefficient(kind):
    path = files(cameras=[camera | {"D": [1.2, *camera["D"]]} for camera in PAIR], kind="MEI")
    for side, camera in zip(("left", "right"), PAIR):
        text = camodocal(SIZE, camera | {"D": [1.2, *camera["D"]]}, "MEI")
        write(text.replace("MEI", kind), f"{side}.yaml")
    rig = load(path)
    assert (rig.left.model, rig.left.D.tolist()) == ("mei", [1.2, *PAIR[0]["D"]])


def test_scaramuzzas_inverse_polynomial_is_read():
    D = [*OCAM["affine"], *OCAM["inverse"], 0.0, 0.0]
    pair = [{"intrinsics": [0, 0, *OCAM["centre"]], "D": D, "T_BS": camera["T_BS"]} for camera in PAIR]
    rig = load(files(OCAM["size"], pair, "SCARAMUZZA"))
    expected = lenses.scaramuzza_camera(OCAM["inverse"], OCAM["affine"], OCAM["centre"])
    assert rig.left.model == "scaramuzza" and rig.left.D.tolist() == D
    assert np.abs(rig.left.K - expected.K).max() < 1e-12
    write(camodocal(OCAM["size"], pair[1], "SCARAMUZZA").replace("   p3:", "   p99:"), "right.yaml")
    assert refusal("vins.yaml") == "right.yaml: inv_poly_parameters.p3: missing"


def test_another_size_in_the_configuration_is_warned_of():
    assert load(files(changes={"image_width": 320})).warnings == (
        "vins.yaml: image_width, image_height = 320x480: the cameras' files say 640x480, which their numbers are of: "
        "that is used",
    )


@pytest.mark.parametrize("change, message", [
    ({"cam0_calib": '"/etc/passwd"'},
     "cam0_calib = /etc/passwd: the name of a file beside the configuration is needed"),
    ({"cam0_calib": '"../left.yaml"'},
     "cam0_calib = ../left.yaml: the name of a file beside the configuration is needed"),
    ({"cam0_calib": "[1]"}, "cam0_calib = [1]: the name of a file beside the configuration is needed"),
    ({"cam1_calib": None}, "cam1_calib: missing: a configuration of one camera; a rig needs two"),
    ({"body_T_cam1": None}, "body_T_cam1: missing"),
])  # fmt: skip
def test_bad_configurations_are_refused(change, message):
    assert refusal(files(changes=change)) == f"vins.yaml: {message}"


@pytest.mark.parametrize("change, message", [
    (("   k2:", "   k9:"), "k2: missing in mirror_parameters, distortion_parameters, projection_parameters"),
    (("PINHOLE", "MAGIC"),
     "model_type = MAGIC: the models known are PINHOLE, PINHOLE_FULL, KANNALA_BRANDT, MEI, SCARAMUZZA"),
    (("image_width: 640", "image_width: 0"),
     "image_width, image_height = 0x480: an image size must lie between 16 and 16384 px"),
])  # fmt: skip
def test_bad_cameras_are_refused(change, message):
    path = files()
    write(camodocal(SIZE, PAIR[1]).replace(*change), "right.yaml")
    assert refusal(path) == f"right.yaml: {message}"


def test_two_configurations_are_one_too_many():
    first = files()
    second = write(vins(SIZE, PAIR), "other.yaml")
    assert refusal(first, second) == (
        "vins.yaml, other.yaml: several VINS configurations, each complete in itself; name one"
    )


class TestCamodocalByItself:
    def test_cameras_without_extrinsics_are_refused_with_what_is_missing(self):
        paths = [write(camodocal(SIZE, camera), f"{side}.yaml") for side, camera in zip(("left", "right"), PAIR)]
        problem = (
            "camodocal's files hold a camera each, and nothing of how the two stand: name the VINS configuration with "
            "body_T_cam0 and body_T_cam1, or camodocal's extrinsics.yaml and both cameras"
        )
        assert refusal(*paths) == f"left.yaml, right.yaml: {problem}"
        assert refusal(paths[0]) == f"left.yaml: {problem}"

    @pytest.mark.parametrize("names", [("camera_left.yaml", "camera_right.yaml"), ("cam0.yaml", "cam1.yaml")])
    def test_extrinsics_take_points_of_the_left_camera_to_the_right_one(self, names):
        paths = [write(camodocal(SIZE, camera), name) for name, camera in zip(names, PAIR)]
        rig = load(write(self.extrinsics(), "extrinsics.yaml"), *reversed(paths))
        assert np.abs(rig.R - MOTION[:3, :3]).max() < 1e-15 and rig.T.tolist() == MOTION[:3, 3].tolist()
        assert rig.left.K[0, 0] == 401.5 and rig.unit is None
        assert rig.origins == dict(zip(("left", "right"), names))

    def test_names_that_do_not_tell_are_refused(self):
        paths = [write(camodocal(SIZE, camera), name) for name, camera in zip(("a.yaml", "b.yaml"), PAIR)]
        assert refusal(write(self.extrinsics(), "extrinsics.yaml"), *paths) == (
            "a.yaml, b.yaml: which is of the left camera? call one left, the other right"
        )

    def extrinsics(self):
        numbers = [*Rotation.from_matrix(MOTION[:3, :3]).as_quat(), *MOTION[:3, 3]]
        names = ("q_x", "q_y", "q_z", "q_w", "t_x", "t_y", "t_z")
        lines = [f"   {name}: {float(number)!r}" for name, number in zip(names, numbers)]
        return "\n".join(["%YAML:1.0", "transform:", *lines]) + "\n"
