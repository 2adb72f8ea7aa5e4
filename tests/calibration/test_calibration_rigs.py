"""Every real rig: read from its own file and from a file that is written here with the same numbers, and rectified."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from calibration_files import refusal
from format_files import RIGS, SHARED, needs_shared_data

from hdl.calibration import convert, embedded, load
from hdl.geometry.rectification import rectify
from hdl.geometry.view import View
from sim.lens_models import LENS_MODELS
from sim.reference import source_positions

# Format, size, lens of the left camera, unit, baseline in that unit.
EXPECTED = {
    "bouguet": ("bouguet", (640, 480), "radtan", "m", 0.099808),
    "concave_640": ("ros", (640, 480), "radtan", "m", 0.099797),
    "ps4eye": ("ros", (640, 400), "radtan", "m", 0.078567),
    "euroc": ("euroc", (752, 480), "radtan", "m", 0.110078),
    "euroc_kalibr": ("kalibr", (752, 480), "radtan", "m", 0.110078),
    "euroc_orbslam": ("orbslam", (752, 480), "radtan", None, 0.110078),
    "kitti": ("kitti", (1392, 512), "radtan", "m", 0.537168),
    "mrpt": ("opencv", (1024, 768), "radtan", None, 3.511806),
    "mynteye_s1030_equidistant": ("mynt", (752, 480), "equidistant", "m", 0.120144),
    "mynteye_s1030_pinhole": ("mynt", (752, 480), "radtan", "m", 0.120144),
    "mynteye_s_jpl": ("euroc", (752, 480), "equidistant", "m", 0.120319),
    "oakd": ("depthai", (1280, 800), "rational", "m", 0.073789),
    "realsense_d455": ("euroc", (640, 480), "radtan", "m", 0.094942),
    "euroc_ds": ("kalibr", (752, 480), "double_sphere", "m", 0.110078),
    "euroc_eucm": ("kalibr", (752, 480), "eucm", "m", 0.110078),
    "kalibr_omni": ("kalibr", (752, 480), "mei", "m", 0.109989),
    "mynteye_fov": ("kalibr", (752, 480), "fov", "m", 0.117230),
    "tum_vi_ds": ("kalibr", (512, 512), "double_sphere", "m", 0.101000),
    "tum_vi": ("kalibr", (512, 512), "equidistant", "m", 0.101087),
    "tum_vi_orbslam3": ("orbslam3", (512, 512), "equidistant", "m", 0.101087),
    "unlook_1280": ("opencv", (1280, 720), "radtan", None, 69.829548),
    "unlook_1456": ("opencv", (1456, 1088), "radtan", None, 70.017229),
    "zed": ("zed", (2208, 1242), "radtan", "m", 0.12),
    "zed_tool": ("zed-opencv", (960, 600), "rational", "m", 0.119901),
    "zed_vga": ("zed", (672, 376), "radtan", "m", 0.12),
}
CARRIED = {"concave_640", "ps4eye", "euroc_orbslam", "kitti", "unlook_1456"}


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    """Name to rig, each loaded once from the files that are written here."""
    folder = tmp_path_factory.mktemp("rigs")
    return {name: load(*files.write(folder / name), **files.options) for name, files in RIGS.items()}


def opencv_map(view: View, step: int):
    """(u, v) of OpenCV at every ``step``-th pixel; the skew, which OpenCV leaves out, is added. Of lenses that OpenCV
    does not know, that of the float reference."""
    camera, size = view.camera, (view.width, view.height)
    if camera.model in LENS_MODELS:
        return source_positions(view, *np.meshgrid(*(np.arange(0, extent, step) for extent in size)))
    if camera.model == "equidistant":
        make, D = cv2.fisheye.initUndistortRectifyMap, camera.D
    else:
        make, D = cv2.initUndistortRectifyMap, camera.D if camera.D.size else None
    u, v = (part[::step, ::step].astype(float) for part in make(camera.K, D, view.R, view.P, size, cv2.CV_32FC1))
    return u + camera.K[0, 1] * (v - camera.K[1, 2]) / camera.K[1, 1], v


def row_differences(rig, views, count=400):
    """Of random points, up to infinitely far away, seen by the right camera and in the rectified views."""
    left, right = views["left"], views["right"]
    rng = np.random.default_rng(5)
    pixels = np.array([rng.uniform(0, rig.width, count), rng.uniform(0, rig.height, count), np.ones(count)])
    depths = np.linalg.norm(rig.T) * 10 ** rng.uniform(1, 8, count)
    points = np.linalg.inv(left.P[:, :3] @ left.R) @ pixels * depths
    _, y, z = right.P[:, :3] @ right.R @ (rig.R @ points + rig.T[:, None])
    return y / z - pixels[1]


@needs_shared_data
@pytest.mark.parametrize("name", [name for name, files in RIGS.items() if files.real])
def test_file_of_the_tool_gives_the_same_rig_as_the_one_written_here(name, rigs):
    files = RIGS[name]
    real, written = load(*files.shared, **files.options), rigs[name]
    for member in ("width", "height", "unit", "format"):
        assert getattr(real, member) == getattr(written, member)
    for side in ("left", "right"):
        assert real.camera(side).model == written.camera(side).model
        assert np.array_equal(real.camera(side).K, written.camera(side).K)
        assert np.array_equal(real.camera(side).D, written.camera(side).D)
    assert np.array_equal(real.R, written.R) and np.array_equal(real.T, written.T)
    assert (real.rectification is None) == (written.rectification is None)
    for side in real.rectification or ():
        for ours, theirs in zip(real.rectification[side], written.rectification[side]):
            assert np.array_equal(ours, theirs)
    assert len(real.warnings) == len(written.warnings)


@pytest.mark.parametrize("name", RIGS)
def test_rig_is_what_its_maker_says(name, rigs):
    rig = rigs[name]
    model, size, lens, unit, baseline = EXPECTED[name]
    assert (rig.format, (rig.width, rig.height), rig.left.model, rig.unit) == (model, size, lens, unit)
    assert np.linalg.norm(rig.T) == pytest.approx(baseline, rel=1e-5)
    assert rig.T[0] < 0
    assert (rig.rectification is not None) == (name in CARRIED)


@pytest.mark.parametrize("lens", [True, False])
@pytest.mark.parametrize("name", RIGS)
def test_maps_agree_with_opencv_to_a_thousandth_of_a_pixel(name, lens, rigs):
    for view in rectify(rigs[name], lens=lens).values():
        if not lens:
            view = replace(view, camera=replace(view.camera, model="radtan", D=np.zeros(0)))
        step = 1 if view.width * view.height < 400_000 else 3
        ours = np.array(view.map())[:, ::step, ::step]
        theirs = np.array(opencv_map(view, step))
        near = (np.abs(theirs) < 2 * view.width).all(axis=0)  # float32 is coarse further out
        assert near.mean() > 0.9
        assert np.abs(ours - theirs)[:, near].max() < 1e-3


@pytest.mark.parametrize("name", RIGS)
def test_rectified_rows_of_random_points_agree(name, rigs):
    assert np.abs(row_differences(rigs[name], rectify(rigs[name], lens=True))).max() < 1e-6


@pytest.mark.parametrize("name", RIGS)
def test_opencv_rectifies_the_rig_alike_from_its_r_and_t(name, rigs):
    """R and T mean what cv2.stereoRectify means by them, whatever the file has of a rectification."""
    rig = replace(rigs[name], rectification=None)
    assert np.abs(row_differences(rig, rectify(rig, lens=True))).max() < 1e-3  # R to the six digits of ROS files


@pytest.mark.parametrize("name", RIGS)
def test_rig_survives_opencvs_format(name, rigs, tmp_path):
    rig = rigs[name]
    path = tmp_path / "rig.yml"
    path.write_text(convert.to_opencv(rig, rig.rectification))
    again = load(path)
    assert (again.width, again.height, again.unit) == (rig.width, rig.height, rig.unit)
    for side in ("left", "right"):
        assert again.camera(side).model == rig.camera(side).model
        assert np.array_equal(again.camera(side).K, rig.camera(side).K)
        assert np.array_equal(again.camera(side).D, rig.camera(side).D)
    assert np.abs(again.R - rig.R).max() < 1e-14 and np.array_equal(again.T, rig.T)
    for side in rig.rectification or ():
        assert np.array_equal(again.rectification[side][1], rig.rectification[side][1])


def test_one_rig_in_three_formats_is_one_rig(rigs):
    """EuRoC: sensor.yaml, Kalibr's chain, and ORB-SLAM's, whose authors rectified it with OpenCV."""
    asl, kalibr, orbslam = (rigs[name] for name in ("euroc", "euroc_kalibr", "euroc_orbslam"))
    for other, tolerance in ((kalibr, 1e-12), (orbslam, 1e-5)):
        assert np.array_equal(asl.left.K, other.left.K) and np.array_equal(asl.right.D, other.right.D[:4])
        assert np.abs(asl.R - other.R).max() < tolerance
        assert np.abs(asl.T - other.T).max() < tolerance
    rectified = rectify(replace(orbslam, rectification=None), lens=True)
    assert np.abs(rectified["left"].R - orbslam.rectification["left"][0]).max() < 1e-6


def test_bouguet_and_opencv_agree_on_the_same_pictures(rigs):
    """Both calibrated the sample pairs; Bouguet states errors of 0.14, 0.11 and 0.5 mm, and of 3 mrad."""
    ours, theirs = rigs["bouguet"], embedded()
    assert np.abs(ours.T * 1000 - theirs.T).max() < 0.5
    assert np.abs(ours.R - theirs.R).max() < 3e-3
    assert np.abs(ours.left.K - theirs.left.K).max() < 2


def test_kitti_colour_pair_keeps_the_files_rectification_and_says_that_its_rows_differ(tmp_path):
    rig = load(*RIGS["kitti"].write(tmp_path), select="02,03")
    assert rig.T == pytest.approx([-0.532601, 0.006586, -0.009002], abs=1e-6)
    assert rig.rectification["left"][1][0, 3] == 44.85728
    differences = np.abs(row_differences(rig, rectify(rig, lens=True)))
    assert 0.3 < differences.max() < 0.4
    assert rig.rectification_warnings[1].endswith(
        "rows of the rectification in the file differ by up to 0.37 px, 10 baselines away"
    )


def test_rectification_of_the_transposed_rotation_is_left_out(rigs):
    """unlook_1280: its R1 and R2 rectify R^T. A rig of the same make, unlook_1456, has R the way R is given here."""
    rig, sister = rigs["unlook_1280"], rigs["unlook_1456"]
    (warning,) = rig.warnings
    assert "rectification_transform_right = [[0.99993" in warning
    assert "rows would differ by 42.2 px, as they belong to the transpose of R; rectified anew" in warning
    turn, other = (cv2.Rodrigues(each.R)[0].ravel() for each in (rig, sister))
    assert turn @ other / np.linalg.norm(turn) / np.linalg.norm(other) > 0.8


@needs_shared_data
def test_malformed_pair_of_ros_is_refused():
    message = refusal(SHARED / "malformed" / "stereopi_ros_bad")
    assert "no baseline in either file: the cameras were calibrated one by one" in message


@needs_shared_data
@pytest.mark.parametrize(
    "model, options, copied_from",
    [
        ("pinhole", {"select": "1280x800"}, "640x400"),
        ("pinhole", {"size": (1280, 800)}, "640x400"),
        ("equidistant", {}, "1280x800"),
        ("equidistant", {"select": "1280x800"}, "640x400"),
    ],
)
def test_cameras_copied_from_another_resolution_are_refused(model, options, copied_from):
    message = refusal(SHARED / "malformed" / "mynteye_s210a" / f"img.params.{model}", **options)
    assert f"in_left = centre {374.15 if model == 'equidistant' else 326.12:g}" in message
    assert message.endswith(f"copied: the same numbers stand for {copied_from}, and do not fit here")


@needs_shared_data
def test_good_block_beside_a_copied_one_is_read():
    rig = load(SHARED / "malformed" / "mynteye_s210a" / "img.params.pinhole", size=(640, 400))
    assert (rig.width, rig.height, rig.warnings) == (640, 400, ())
    assert rig.left.K[0, 2] == 326.11983633916327
