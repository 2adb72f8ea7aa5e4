"""The float64 map: against OpenCV's own maps and projections, and what a rig is refused for."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from format_files import SHARED, needs_shared_data

from hdl.calibration import Camera, Rig, embedded, load
from hdl.errors import InputError
from hdl.geometry.rectification import RectificationOptions, View, rectify

K = np.array([[361.0, 0, 301.5], [0, 363.5, 251.25], [0, 0, 1]])
EIGHT = [0.12, -0.08, 0.0012, -0.0007, 0.03, 0.31, -0.11, 0.02]
LENSES = {
    "radtan": [-0.29, 0.095, 0.0012, -0.0004],
    "radtan with k3": [-0.29, 0.095, 0.0012, -0.0004, -0.02],
    "rational": EIGHT,
    "thin_prism": [*EIGHT, 0.004, -0.002, 0.003, 0.001],
    "tilted": [*EIGHT, 0.004, -0.002, 0.003, 0.001, 0.03, -0.05],
    "tilted about y": [0.0] * 13 + [0.1],
    "equidistant": [-0.0135, -0.0323, 0.0538, -0.0367],
    "none": [],
}


def turn(x, y, z):
    return cv2.Rodrigues(np.array([x, y, z], dtype=float))[0]


def view(name, *, K=K, lens=True, width=640, height=480):
    camera = Camera(name.split()[0] if LENSES[name] else "radtan", K, np.array(LENSES[name]))
    P = np.array([[340.0, 0, 318.0, -40.0], [0, 352.0, 244.5, 0], [0, 0, 1, 0]])
    scale = np.diag([width / 640, height / 480, 1])
    camera = replace(camera, K=scale @ camera.K)
    return View("left", camera, turn(0.02, -0.05, 0.015), scale @ P, width, height, lens)


def opencv_map(view):
    """(u, v) of OpenCV, float32."""
    size = view.width, view.height
    D = view.camera.D if view.lens and view.camera.D.size else None
    if view.lens and view.camera.model == "equidistant":
        return cv2.fisheye.initUndistortRectifyMap(view.camera.K, D, view.R, view.P, size, cv2.CV_32FC1)
    return cv2.initUndistortRectifyMap(view.camera.K, D, view.R, view.P, size, cv2.CV_32FC1)


def fisheye_rig():
    D = np.array(LENSES["equidistant"])
    left, right = (Camera("equidistant", matrix, D) for matrix in (K, K + [[2, 0, 3], [0, 2, -4], [0, 0, 0]]))
    return Rig("fisheye.yml", 640, 480, left, right, turn(0.01, -0.04, 0.02), np.array([-0.12, 0.003, -0.004]))


def refusal(rig, *, lens=True, **options):
    with pytest.raises(InputError) as caught:
        for side in rectify(rig, RectificationOptions(**options), lens=lens).values():
            side.map()
    return str(caught.value)


@pytest.mark.parametrize("size", [(640, 480), (33, 17), (1000, 3)])
@pytest.mark.parametrize("name", LENSES)
def test_map_agrees_with_opencv_at_every_pixel(name, size):
    tested = view(name, width=size[0], height=size[1])
    for ours, theirs in zip(tested.map(), opencv_map(tested)):
        assert ours.dtype == np.float64 and ours.shape == (size[1], size[0])
        assert np.abs(ours - theirs).max() < 1e-4  # half a unit in the last place of float32 is 3e-5


@pytest.mark.parametrize("name", LENSES)
def test_projection_agrees_with_opencv_in_float64(name):
    tested = view(name)
    rng = np.random.default_rng(2)
    xr, yr = rng.uniform(0, 639, 500), rng.uniform(0, 479, 500)
    rays = np.linalg.inv(tested.P[:, :3] @ tested.R) @ [xr, yr, np.ones(500)]
    zero = np.zeros(3)
    if tested.camera.model == "equidistant":
        points = cv2.fisheye.projectPoints(rays.T[:, None], zero, zero, tested.camera.K, tested.camera.D)[0]
    else:
        points = cv2.projectPoints(rays.T[:, None], zero, zero, tested.camera.K, tested.camera.D)[0]
    assert np.abs(np.array(tested.project(xr, yr)) - points.reshape(-1, 2).T).max() < 1e-9


@pytest.mark.parametrize("name", ["radtan", "equidistant", "none"])
def test_without_lens_the_map_is_the_homography(name):
    tested = view(name, lens=False)
    expected = tested.camera.K @ tested.R.T @ np.linalg.inv(tested.P[:, :3])
    assert np.allclose(tested.homography, expected, rtol=1e-12, atol=1e-15)
    yr, xr = np.mgrid[:480, :640]
    x, y, z = np.tensordot(expected, [xr, yr, np.ones_like(xr)], axes=1)
    assert np.abs(np.array(tested.map()) - [x / z, y / z]).max() < 1e-9


@pytest.mark.parametrize("lens", [False, True])
def test_skew_takes_part(lens):
    straight, skewed = view("radtan", lens=lens), view("radtan", K=K + [[0, 7.0, 0], [0, 0, 0], [0, 0, 0]], lens=lens)
    (u, v), (skewed_u, skewed_v) = straight.map(), skewed.map()
    assert np.allclose(skewed_u, u + 7.0 * (v - K[1, 2]) / K[1, 1], rtol=0, atol=1e-9)
    assert np.allclose(skewed_v, v, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("lens", [False, True])
def test_points_of_any_shape_are_those_of_the_map(name, lens):
    tested = view(name, lens=lens)
    whole = np.array(tested.map())
    x, y = np.array([0, 17, 639]), np.array([479, 5, 0])
    assert np.allclose(tested.project(x, y), whole[:, y, x], rtol=0, atol=1e-9)
    assert np.allclose(tested.project(x[:, None], y), whole[:, y, x[:, None]], rtol=0, atol=1e-9)
    assert np.allclose(tested.project(17, 5), whole[:, 5, 17], rtol=0, atol=1e-9)
    assert np.shape(tested.project(17, 5)[0]) == ()


def test_fisheye_centre_ray_has_no_division_by_zero():
    tested = replace(view("equidistant"), R=np.eye(3), P=np.c_[K, [0, 0, 0]])
    assert tested.project(301.5, 251.25) == (301.5, 251.25)


def test_map_is_computed_once_and_cannot_be_written():
    tested = view("radtan")
    u, v = tested.map()
    assert tested.map()[0] is u
    for coordinate in (u, v):
        with pytest.raises(ValueError, match="read-only"):
            coordinate[0, 0] = 0


@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0])
def test_rectification_is_opencvs_with_the_lens_even_where_the_map_has_none(alpha):
    rig = embedded()
    R1, R2, P1, P2 = cv2.stereoRectify(
        rig.left.K, rig.left.D, rig.right.K, rig.right.D, (640, 480), rig.R, rig.T[:, None],
        flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha,
    )[:4]  # fmt: skip
    for lens in (False, True):
        views = rectify(rig, RectificationOptions(alpha=alpha), lens=lens)
        assert list(views) == ["left", "right"]
        for side, R, P in (("left", R1, P1), ("right", R2, P2)):
            assert np.array_equal(views[side].R, R) and np.array_equal(views[side].P, P)
            assert (views[side].side, views[side].lens, views[side].camera) == (side, lens, rig.camera(side))
            assert (views[side].width, views[side].height) == (640, 480)


def test_rectification_of_the_file_goes_before_opencvs():
    rig = embedded()
    views = rectify(rig, RectificationOptions(alpha=0.7), lens=True)
    given = {side: (views[side].R, views[side].P + 1e-9) for side in views}
    for side, made in rectify(replace(rig, rectification=given), lens=True).items():
        assert made.R is given[side][0] and made.P is given[side][1]


@pytest.mark.parametrize("rig", [embedded(), fisheye_rig()], ids=["radtan", "equidistant"])
def test_a_point_in_space_lies_on_one_row_of_both_rectified_images(rig):
    left, right = rectify(rig, lens=True).values()
    points = np.linalg.norm(rig.T) * np.random.default_rng(3).uniform([-3, -2, 5], [3, 2, 20], (50, 3)).T
    xl, yl, zl = left.P[:, :3] @ left.R @ points
    xr, yr, zr = right.P[:, :3] @ right.R @ (rig.R @ points + rig.T[:, None])
    assert np.abs(yl / zl - yr / zr).max() < 1e-6
    assert np.allclose(xl / zl - xr / zr, -right.P[0, 3] / zl)  # disparity = f * baseline / depth


def test_fisheye_keeps_the_focal_length_of_the_source():
    rig = fisheye_rig()
    left, right = rectify(rig, lens=True).values()
    f = (361.0 + 363.5 + 363.0 + 365.5) / 4
    assert left.P.tolist() == [[f, 0, 319.5, 0], [0, f, 239.5, 0], [0, 0, 1, 0]]
    assert right.P[0, 3] == pytest.approx(-f * np.linalg.norm(rig.T), rel=1e-12)
    for side in (left, right):
        assert np.abs(np.array(side.map()) - opencv_map(side)).max() < 1e-4


def test_scaled_rig_has_the_scaled_map():
    """Pixel centres at integers: (u + 0.5)*s - 0.5 at (x + 0.5)*s - 0.5."""
    views = rectify(embedded(), lens=True)
    given = {side: (view.R, view.P) for side, view in views.items()}
    rig = replace(embedded(), rectification=given)
    u, v = rectify(rig, lens=True)["right"].project(100.0, 200.0)
    scaled = rectify(rig.scaled(1280, 1440), lens=True)["right"].project(100.5 * 2 - 0.5, 200.5 * 3 - 0.5)
    assert scaled == pytest.approx(((u + 0.5) * 2 - 0.5, (v + 0.5) * 3 - 0.5), abs=1e-9)


@pytest.mark.parametrize("alpha", [-0.5, 1.5, float("nan")])
def test_alpha_outside_its_range_is_refused(alpha):
    assert refusal(embedded(), alpha=alpha) == f"--alpha: {alpha}: a number from 0 to 1 is needed"


def with_rectification(change):
    rig = embedded()
    views = rectify(rig, lens=True)
    given = {side: [view.R.copy(), view.P.copy()] for side, view in views.items()}
    change(given)
    fields = {role: ("pair.yml", role) for role in ("R1", "R2", "D1", "D2")}
    return replace(rig, rectification=given, fields=fields)


def test_frame_that_reaches_behind_a_camera_names_the_rotation():
    def change(given):
        given["right"][0] = turn(0, 1.2, 0)

    message = refusal(with_rectification(change))
    assert message.startswith("pair.yml: R2 = [[0.36235775447667")
    assert message.endswith(": the rectified frame reaches behind the right camera; --alpha 0 or --fov 61 would do")


@pytest.mark.parametrize("R, T, field, why", [
    (turn(0, 0, 0), [-1.0, 0, -2.0], "T",
     "one camera stands 63 degrees in front of the other; --focal 363 --center 0,240 would do"),
    (turn(0, -2.6, 0), [-1.0, 0, 0], "R", "the cameras look 149 degrees apart"),
])  # fmt: skip
def test_frame_that_reaches_behind_a_camera_names_what_turns_it(R, T, field, why):
    message = refusal(replace(fisheye_rig(), R=R, T=np.array(T)))
    assert message.startswith(f"fisheye.yml: {field} = [")
    assert message.endswith(f": the rectified frame reaches behind the left camera, as {why}")


@pytest.mark.parametrize("lens", [False, True])
def test_map_that_misses_the_source_altogether_names_the_rotation(lens):
    def change(given):
        given["left"][1][0, 2] += 3000

    message = refusal(with_rectification(change), lens=lens)
    assert message.startswith("pair.yml: R1 = [[0.99")
    assert message.endswith(": no pixel of the rectified left image comes from inside the source image")


def test_lens_that_sends_every_pixel_out_of_the_source_is_named():
    def change(given):
        given["right"][1][0, 2] += 550

    rig = with_rectification(change)
    far = replace(rig, right=replace(rig.right, D=np.array([5.0, 0, 0, 0])))
    assert refusal(far) == (
        "pair.yml: D2 = [5.0, 0.0, 0.0, 0.0]: no pixel of the rectified right image comes from inside the source image"
    )
    assert rectify(far, lens=False)["right"].map()[0].shape == (480, 640)


def test_lens_that_leads_to_infinity_is_named():
    rig = with_rectification(lambda given: None)
    steep = replace(rig, left=replace(rig.left, D=np.array([0, 1e7, 0, 0, 0])))
    assert refusal(steep) == (
        "pair.yml: D1 = [0.0, 10000000.0, 0.0, 0.0, 0.0]: the map of the left camera leads to infinity"
    )


def test_rectification_that_opencv_cannot_find_is_refused():
    pinhole = Camera("radtan", K, np.array([]))
    behind = Rig("rig.yml", 640, 480, pinhole, pinhole, np.eye(3), np.array([-1.0, 0, -4.0]))
    message = refusal(behind)
    assert message == (
        "rig.yml: T = [-1.0, 0.0, -4.0]: with alpha 0 cv2.stereoRectify finds no view, as one camera stands 76 degrees "
        "in front of the other; --focal 362 --center 0,240 would do"
    )
    lens = np.array([50.0, 0, 0, 0])
    rig = replace(embedded(), right=replace(embedded().right, D=lens))
    assert refusal(rig).startswith("opencv_samples.yml: D2 = [50.0, 0.0, 0.0, 0.0]: with alpha 0 cv2.stereoRectify ")


@needs_shared_data
@pytest.mark.parametrize(
    "name",
    [
        "mrpt_stereo/mrpt_bumblebee.yml",
        "unlook_1456/calib_boofcv_test3.yaml",
        "opencv_samples/calibrated/opencv_left_right.yml",
    ],
)
@pytest.mark.parametrize("lens", [False, True])
def test_maps_of_real_rigs_agree_with_opencv(name, lens):
    for side in rectify(load(SHARED / "rigs" / name), lens=lens).values():
        assert np.abs(np.array(side.map()) - opencv_map(side)).max() < 1e-3
