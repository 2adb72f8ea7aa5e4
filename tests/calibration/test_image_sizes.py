"""Cameras of two image sizes, as a colour one beside a mono one: read, shown and rectified, each by its own size."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from calibration_files import refusal, transform, turn, write
from commands import ended
from format_files import bouguet_camera, depthai, euroc, kalibr, kitti, matlab, orbslam, ros
from rig_numbers import ASL, KITTI, OAKD, ORBSLAM, ROS
from ros_files import message
from scipy.io import savemat
from slam_files import EUROC, aslam, basalt, camodocal, okvis, ov2slam, vins

from hdl.calibration import SIDES, convert, embedded, load
from hdl.calibration.__main__ import describe
from hdl.core.build import Options, build
from hdl.errors import InputError
from hdl.generate import generate
from hdl.geometry.notes import row_disagreement
from hdl.geometry.rectification import RectificationOptions, rectify
from sim.run import simulate

SMALL, LARGE = (752, 480), (1504, 960)


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def two_sizes(right=(320, 160)):
    """The embedded rig at 160x120, its right camera's images resampled."""
    rig = embedded((160, 120))
    return replace(rig, right=rig.right.scaled(right))


def chain(lens="radtan", size="[320, 240]"):
    """A Kalibr camchain of a 160x120 camera and, 60 mm to the right, one of ``size``."""
    cameras = [
        {"intrinsics": [130.0, 131.0, 79.0, 60.0], "D": [-0.1, 0.02, 0.001, 0.0005]},
        {"intrinsics": [262.0, 261.0, 161.0, 118.5], "D": [-0.12, 0.03, 0.0, 0.001],
         "T_cn_cnm1": transform(turn(0.01, -0.02, 0.03), [-0.06, 0.001, 0.002])},
    ]  # fmt: skip
    text = kalibr((160, 120), cameras, lens)
    head, tail = text.rsplit("resolution: [160, 120]", 1)
    return write(f"{head}resolution: {size}{tail}", "chain.yaml")


def _kalibr():
    return chain(), (160, 120), (320, 240), "cam1.resolution"


def _euroc():
    sizes = [752, 480], [1504, 960]
    for index, (camera, size) in enumerate(zip(ASL["euroc"]["cameras"], sizes)):
        scale = size[0] // 752
        write(euroc(size, camera["T_BS"], [scale * x for x in camera["intrinsics"]], camera["D"]), f"cam{index}.yaml")
    return ("cam0.yaml", "cam1.yaml"), *map(tuple, sizes), "resolution"


def _ros():
    rig = ROS["ps4eye"]
    write(ros(rig["size"], **rig["left"]), "left.yaml")
    right = rig["right"] | {"K": [2.0 * x for x in rig["right"]["K"][:8]] + [1.0]}
    write(ros([1280, 800], **right), "right.yaml")
    return ("left.yaml", "right.yaml"), tuple(rig["size"]), (1280, 800), "image_width, image_height"


def _kitti():
    K = [repr(2 * float(x)) for x in KITTI["K_01"][:8]] + ["1.0"]
    entries = {key: value for key, value in KITTI.items() if "rect" not in key}
    return write(kitti(entries | {"S_01": ["2784", "1024"], "K_01": K})), (1392, 512), (2784, 1024), "S_01"


def _depthai():
    content = json.loads(depthai({socket: OAKD[socket] for socket in (0, 1, 2)}))
    content["stereoRectificationData"] = {"leftCameraSocket": 1, "rightCameraSocket": 0}
    return write(json.dumps(content), "oak.json"), (1280, 800), (1920, 1080), "cameraData[0].width, height"


def _orbslam():
    rows, cols, K = ORBSLAM["RIGHT.K"]
    changes = {"RIGHT.width": 1504, "RIGHT.height": 960, "RIGHT.K": [rows, cols, [2 * x for x in K[:8]] + [1.0]]}
    return write(orbslam(ORBSLAM | changes)), (752, 480), (1504, 960), "RIGHT.width, RIGHT.height"


def _matlab():
    (K, *lens), right = bouguet_camera("left"), bouguet_camera("right")
    content = matlab(turn(0.02, -0.03, 0.01), [-60.0, 1, 2], [((2 * np.array(K)).tolist(), *lens), right], (640, 480))
    content["CameraParameters1"]["ImageSize"] = [[960, 1280]]
    content["CameraParameters1"]["IntrinsicMatrix"][2, 2] = 1
    savemat("rig.mat", {"s": content})
    return "rig.mat", (1280, 960), (640, 480), "s.CameraParameters2.ImageSize"


@pytest.mark.parametrize("make", [_kalibr, _euroc, _ros, _kitti, _depthai, _orbslam, _matlab])
def test_each_camera_has_the_size_that_its_file_states(make):
    paths, left, right, field = make()
    rig = load(*(paths if isinstance(paths, tuple) else (paths,)))
    assert (rig.left.size, rig.right.size) == (left, right)
    assert (rig.width, rig.height) == left
    assert rig.spelling("size2")[1] == field
    views = rectify(rig, lens=True)
    assert [(view.width, view.height) for view in views.values()] == [left, left]
    assert [view.source_size for view in views.values()] == [left, right]


def _doubled():
    """A pair of 752x480 and 1504x960."""
    left, right = (dict(camera) for camera in EUROC)
    return [left, right | {"intrinsics": [2 * value for value in right["intrinsics"]]}]


def _second(text, old, new):
    """``text``, ``old`` replaced where it stands the second time."""
    head, tail = text.rsplit(old, 1)
    return head + new + tail


def _basalt():
    content = json.loads(basalt(SMALL, _doubled()))
    content["value0"]["resolution"][1] = list(LARGE)
    return write(json.dumps(content)), "value0.resolution[1]"


def _okvis():
    text = _second(okvis(SMALL, _doubled()), "image_dimension: [752, 480]", "image_dimension: [1504, 960]")
    return write(text), "cameras[1].image_dimension"


def _aslam():
    text = _second(
        aslam(SMALL, _doubled()), "image_height: 480\n    image_width: 752", "image_height: 960\n    image_width: 1504"
    )
    return write(text), "cameras[1].camera.image_width, image_height"


def _ov2slam():
    changes = {"Camera.right_nwidth": 1504, "Camera.right_nheight": 960}
    return write(ov2slam(SMALL, _doubled(), changes=changes)), "Camera.right_nwidth, Camera.right_nheight"


def _vins():
    for name, size, camera in zip(("left", "right"), (SMALL, LARGE), _doubled()):
        write(camodocal(size, camera), f"{name}.yaml")
    return write(vins(SMALL, _doubled()), "vins.yaml"), "image_width, image_height"


def _plain():
    left, right = _doubled()
    motion = np.linalg.inv(np.reshape(right["T_BS"], (4, 4))) @ np.reshape(left["T_BS"], (4, 4))
    content = {"R": motion[:3, :3].tolist(), "T": motion[:3, 3].tolist()}
    for side, size, camera in (("left", SMALL, left), ("right", LARGE, right)):
        fx, fy, cx, cy = camera["intrinsics"]
        content |= {f"{side}_K": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], f"{side}_D": camera["D"], f"{side}_size": size}
    return write(json.dumps(content), "rig.json"), "right_size"


def _messages():
    rig = ROS["ps4eye"]
    right = rig["right"] | {"K": [2.0 * x for x in rig["right"]["K"][:8]] + [1.0]}
    texts = message(rig["size"], **rig["left"]), message((1280, 800), **right)
    return write("".join(texts)), "message 2.width, height"


@pytest.mark.parametrize("make", [_basalt, _okvis, _aslam, _ov2slam, _vins, _plain, _messages])
def test_other_forms_state_two_sizes_too(make):
    path, field = make()
    rig = load(path)
    assert rig.right.size == tuple(2 * extent for extent in rig.left.size) and rig.spelling("size2")[1] == field
    views = rectify(rig, lens=True)
    assert row_disagreement(rig, views) < 1e-6
    assert all(view.inside.mean() > 0.95 for view in views.values())


def test_a_camera_that_states_no_size_has_the_rigs():
    rig = embedded((160, 120))
    assert (rig.left.size, rig.right.size, rig.sizes) == ((160, 120), (160, 120), {(160, 120)})


def test_each_camera_is_checked_against_its_own_size():
    assert refusal(chain(size="[160, 120]")) == (
        "chain.yaml: cam1.intrinsics = cx 161: the principal point lies outside the 160x120 image: of another size?"
    )
    (warning,) = load(chain(size="[380, 244]")).warnings
    assert warning == (
        "chain.yaml: cam1.intrinsics = cx 161: far from the middle of a 380x244 image: calibrated at another size?"
    )


def test_exchanged_cameras_take_their_sizes_along():
    rig = two_sizes().exchanged()
    assert (rig.width, rig.height, rig.left.size, rig.right.size) == (320, 160, (320, 160), (160, 120))


def test_both_cameras_are_scaled_to_one_size_and_each_stretch_is_warned_of():
    rig = load(chain(), size=(400, 300))
    assert rig.sizes == {(400, 300)} and not rig.warnings
    assert rig.left.K[0, 0] == pytest.approx(130 * 2.5) and rig.right.K[0, 0] == pytest.approx(262 * 1.25)
    assert rig.right.K[0, 2] == pytest.approx(161.5 * 1.25 - 0.5)
    (warning,) = load(chain(size="[320, 224]"), size=(320, 224)).warnings
    assert warning.startswith("--size: 320x224: stretches the 160x120 images by 7 %; ")


@pytest.mark.parametrize("lens", [True, False])
def test_map_is_opencvs_into_the_cameras_own_image(lens):
    rig = two_sizes()
    for side, view in rectify(rig, lens=lens).items():
        D = rig.camera(side).D if lens else None
        theirs = cv2.initUndistortRectifyMap(rig.camera(side).K, D, view.R, view.P, (160, 120), cv2.CV_32FC1)
        for ours, other in zip(view.map(), theirs):
            assert ours.shape == (120, 160) and np.abs(ours - other).max() < 1e-4


def test_pixels_of_a_larger_image_are_the_same_points():
    """With the same rectification: (u + 0.5) s - 0.5, and inside at the same pixels but for the edge."""
    given = {side: (view.R, view.P) for side, view in rectify(embedded((160, 120)), lens=True).items()}
    rigs = (replace(rig, rectification=given) for rig in (embedded((160, 120)), two_sizes()))
    one, two = (rectify(rig, lens=True)["right"] for rig in rigs)
    (u, v), (wide, high) = one.map(), two.map()
    assert np.abs(wide - ((u + 0.5) * 2 - 0.5)).max() < 1e-9
    assert np.abs(high - ((v + 0.5) * 160 / 120 - 0.5)).max() < 1e-9
    assert (one.inside == two.inside).mean() > 0.98 and two.inside.mean() > 0.98


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_alpha_means_the_same_for_both_sizes(alpha):
    """0: all pixels have a source; 1: all source pixels are shown; in either camera, whatever its size."""
    options = RectificationOptions(alpha=alpha)
    one, two = (rectify(rig, options, lens=True) for rig in (embedded((160, 120)), two_sizes()))
    assert two["left"].P == pytest.approx(one["left"].P, rel=0.01, abs=0.5)
    for side in SIDES:
        assert np.array_equal(two[side].R, one[side].R)
        assert two[side].inside.mean() == pytest.approx(one[side].inside.mean(), abs=0.01)


@pytest.mark.parametrize("options", [{}, {"focal": 120.0}, {"minimise": "rows"}], ids=str)
def test_rows_of_both_cameras_agree(options):
    rig = two_sizes()
    views = rectify(rig, RectificationOptions(**options), lens=True)
    assert row_disagreement(rig, views) < 1e-9


def test_rows_are_counted_from_the_source_row_that_is_due():
    """A source of four thirds of the height needs four thirds of the rows, which --minimise rows sees as well."""
    one, two = (rectify(rig, lens=True)["right"].window for rig in (embedded((160, 120)), two_sizes()))
    assert two.rows == pytest.approx(one.rows * 4 / 3, abs=4)
    views = rectify(two_sizes(), RectificationOptions(minimise="rows"), lens=True)
    before = rectify(two_sizes(), lens=True)
    assert sum(view.window.rows for view in views.values()) < sum(view.window.rows for view in before.values())


def test_equidistant_cameras_keep_the_sources_focal_length_at_the_rectified_size():
    rig = load(chain("equidistant"))
    f = rectify(rig, lens=True)["left"].P[0, 0]
    assert f == pytest.approx((130 + 131 + 262 * 159 / 319 + 261 * 119 / 239) / 4)


def test_opencvs_format_has_no_room_for_two_sizes():
    with pytest.raises(InputError) as caught:
        convert.to_opencv(load(chain()))
    assert str(caught.value) == (
        "chain.yaml: cam1.resolution = 320x240: OpenCV's format holds one size for both cameras; "
        "--size 160x120 makes them one"
    )


def test_the_command_shows_both_sizes(capsys):
    status, out, err = ended(capsys, describe, chain())
    assert (status, err) == (0, "")
    lines = [" ".join(line.replace("│", " ").split()) for line in out.splitlines()]
    for expected in ("images of two sizes", "image 160x120 px 320x240 px", "rectified image 160x120 px 160x120 px"):
        assert expected in lines
    content = json.loads(ended(capsys, describe, "chain.yaml", "--json")[1])
    assert [(content[side]["width"], content[side]["height"]) for side in SIDES] == [(160, 120), (320, 240)]
    assert (content["width"], content["height"]) == (160, 120)


MISSING = (
    "error: chain.yaml: cam1.resolution = 320x240: a source image of another size than the rectified one, 160x120, is "
    "all that no core takes yet; --size 160x120 does for images that are resampled to it\n"
)


@pytest.mark.parametrize("command, sides", [(generate, ()), (generate, ("--camera", "right")), (simulate, ())])
def test_no_core_is_built_and_nothing_else_is_missing(command, sides, capsys, monkeypatch):
    monkeypatch.setattr("hdl.generate.rectify", None)  # refused before anything is computed
    assert ended(capsys, command, chain(), *sides) == (2, "", MISSING)


def test_what_the_refusal_names_works(capsys):
    for choice in (("--size", "160x120"), ("--camera", "left")):
        status, _, err = ended(capsys, generate, chain(), "--datapath", "proposed", "--output", "out", *choice)
        assert (status, err) == (0, "")
    status, _, err = ended(capsys, describe, chain(), "--size", "160x120", "--convert", "rig.yml")
    assert (status, err) == (0, "") and load("rig.yml").sizes == {(160, 120)}


def test_a_view_of_another_size_is_no_core_either():
    with pytest.raises(InputError) as caught:
        build(rectify(load(chain()), lens=False)["right"], Options("proposed"), "top")
    assert str(caught.value) == MISSING.strip().removeprefix("error: ")
