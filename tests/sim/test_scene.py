"""The rendered pair is a photograph by the rig: judged by its geometry, by its pixels, and by image matching."""

from functools import cache
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from format_files import RIGS as FILES

from hdl.calibration import embedded, load
from hdl.geometry.rectification import rectify
from sim import patterns
from sim.alignment import row_difference
from sim.reference import project
from sim.room import Room
from sim.scene import render, visible_points

SIDES = ("left", "right")


def _fisheye():
    def camera(f, cx, cy):
        K = np.array([[f, 0, cx], [0, f, cy], [0, 0, 1.0]])
        return SimpleNamespace(model="equidistant", K=K, D=np.array([0.0034, 0.0007, -0.0021, 0.0002]))

    R = cv2.Rodrigues(np.radians([2.7, -0.04, 0.05]))[0]
    T = np.array([-0.101, -0.002, -0.001])
    return SimpleNamespace(
        source="fisheye", width=384, height=384, left=camera(143, 191, 193), right=camera(142.8, 189, 191), R=R, T=T
    )


RIGS = {"lens": (embedded(), True), "no lens": (embedded(), False), "fisheye": (_fisheye(), True)}


@cache
def pair(name):
    return render(*RIGS[name])


@cache
def points(name, count=2000):
    return visible_points(*RIGS[name], count)


@cache
def opencv_maps(name):
    """Rectifying float32 maps by OpenCV, from the rig's numbers alone."""
    rig, lens = RIGS[name]
    size, T = (rig.width, rig.height), np.reshape(rig.T, (3, 1))
    fisheye = rig.left.model == "equidistant"
    D = {side: getattr(rig, side).D if lens and not fisheye else None for side in SIDES}
    result = cv2.stereoRectify(
        rig.left.K, D["left"], rig.right.K, D["right"], size, rig.R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0
    )
    maps = {}
    for side, R, P in zip(SIDES, result[:2], result[2:4]):
        camera = getattr(rig, side)
        if fisheye:
            P = np.array([[143.0, 0, 191.5], [0, 143, 191.5], [0, 0, 1]])
            maps[side] = cv2.fisheye.initUndistortRectifyMap(camera.K, camera.D, R, P, size, cv2.CV_32FC1)
        else:
            maps[side] = cv2.initUndistortRectifyMap(camera.K, D[side], R, P, size, cv2.CV_32FC1)
    return maps


@cache
def rectified(name):
    return {side: cv2.remap(pair(name)[side], *opencv_maps(name)[side], cv2.INTER_CUBIC) for side in SIDES}


def matched_rows(left, right):
    """Row differences of ORB matches, with no knowledge of the geometry."""
    orb = cv2.ORB_create(1500)
    (at_left, left), (at_right, right) = (orb.detectAndCompute(image, None) for image in (left, right))
    matches = sorted(cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(left, right), key=lambda m: m.distance)
    best = matches[: len(matches) // 3]
    return np.array([at_left[m.queryIdx].pt[1] - at_right[m.trainIdx].pt[1] for m in best])


def sampled(image, at):
    at = at.astype(np.float32)
    values = cv2.remap(image, at[None, :, 0], at[None, :, 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return values.ravel().astype(float)


@pytest.mark.parametrize("name", RIGS)
def test_known_points_lie_in_one_row_after_rectification_only(name):
    before, after = row_difference(None, points(name)[1]), row_difference(opencv_maps(name), points(name)[1])
    assert before.n == 2000 and before.mean > 5
    assert after.n > 800 and after.mean < 1e-3 and after.max < 1e-2


@pytest.mark.parametrize("name", RIGS)
def test_matched_features_lie_in_one_row_after_rectification_only(name):
    before, after = matched_rows(**pair(name)), matched_rows(**rectified(name))
    assert len(after) > 50
    assert abs(np.median(before)) > 5
    # Bricks and squares repeat, so that some matches are wrong.
    assert np.mean(np.abs(before) < 1.5) < 0.2 and np.mean(np.abs(after) < 1.5) > 0.6
    assert abs(np.median(after)) < 0.2


@pytest.mark.parametrize("name", RIGS)
def test_optical_flow_finds_no_row_offset_after_rectification(name):
    images = rectified(name)
    corners = cv2.goodFeaturesToTrack(images["left"], 600, 0.01, 8)
    flow = {"winSize": (15, 15), "maxLevel": 5}
    found, ok, _ = cv2.calcOpticalFlowPyrLK(images["left"], images["right"], corners, None, **flow)
    back, _, _ = cv2.calcOpticalFlowPyrLK(images["right"], images["left"], found, None, **flow)
    good = (ok.ravel() == 1) & (np.linalg.norm((back - corners).reshape(-1, 2), axis=1) < 0.2)
    rows = (found - corners).reshape(-1, 2)[good, 1]
    assert good.sum() > 60
    assert abs(np.median(rows)) < 0.05
    assert np.percentile(np.abs(rows), 75) < 0.25


@pytest.mark.parametrize("name", RIGS)
def test_both_images_show_the_known_points_where_they_are_said_to_be(name):
    at = points(name, 20000)[1]
    left = sampled(pair(name)["left"], at["left"])

    def mismatch(shift):
        return np.abs(left - sampled(pair(name)["right"], at["right"] + shift))

    assert np.mean(mismatch([0, 0]) < 8) > 0.9
    for direction in np.eye(2):
        before, here, after = (np.mean(mismatch(k * direction) ** 2) for k in (-0.5, 0, 0.5))
        assert max(before, after) > 3 * here
        assert abs((before - after) / (before - 2 * here + after) / 4) < 0.02  # px, the least of a parabola


@pytest.mark.parametrize("name", RIGS)
def test_known_points_project_to_their_positions_inside_both_images(name):
    rig, lens = RIGS[name]
    X, at = points(name)
    np.testing.assert_allclose(project(rig.left, X, lens), at["left"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(project(rig.right, X @ rig.R.T + rig.T, lens), at["right"], rtol=0, atol=1e-9)
    for positions in at.values():
        assert (positions >= 0).all() and (positions <= [rig.width - 1, rig.height - 1]).all()


def test_points_hidden_from_one_camera_are_left_out():
    # The nearest thing in a direction is what is seen: among points that share a pixel, depths agree.
    X, at = visible_points(*RIGS["lens"], 20000)
    for side, depth in (("left", X[:, 2]), ("right", (X @ embedded().R.T + embedded().T)[:, 2])):
        cell = np.floor(at[side] / 4).astype(int) @ [1, 1000]
        order = np.lexsort((depth, cell))
        same = cell[order][1:] == cell[order][:-1]
        steps = np.abs(np.diff(depth[order]) / depth[order][1:])[same]
        assert len(steps) > 4000
        assert np.mean(steps > 0.05) < 0.02


def test_the_nearest_surface_is_seen():
    room = Room(0.6, 0.45, 1 / 500, channels=1, seed=0)
    rays = np.random.default_rng(0).normal(0, [0.3, 0.25, 0.05], (5000, 3)) + [0, 0, 1]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    origin = np.array([0.05, 0.02, -0.01])
    distance, index = room.trace(origin, rays)
    hits = np.array([surface.hit(origin, rays) for surface in room.surfaces])
    np.testing.assert_array_equal(distance, hits.min(axis=0))
    np.testing.assert_array_equal(index, hits.argmin(axis=0))
    assert len(np.unique(index)) == len(room.surfaces)


def test_rays_end_on_the_surface_they_hit():
    room = Room(0.6, 0.45, 1 / 500, channels=1, seed=0)
    rays = np.random.default_rng(1).normal(0, [0.3, 0.25, 0.05], (5000, 3)) + [0, 0, 1]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    distance, index = room.trace(np.zeros(3), rays)
    points = distance[:, None] * rays
    for number, surface in enumerate(room.surfaces):
        offset = points[index == number] - surface.centre
        if surface is room.ball:
            gap = np.linalg.norm(offset, axis=1) - surface.radius
        else:
            gap = (np.abs(offset @ surface.axes) - surface.half).max(axis=1)
        np.testing.assert_allclose(gap, 0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "pattern, mean",
    [
        (lambda s, t, w: patterns.pulse(s, w, 1.0, 0.3), 0.3),
        (lambda s, t, w: patterns.checker(s, w, t, w, 0.5), 0.5),
        (lambda s, t, w: patterns.wave(s, w, 1.0), 0.0),
        (lambda s, t, w: patterns.noise(s, w, t, w, 1.0, seed=0), 0.5),
    ],
    ids=["pulse", "checker", "wave", "noise"],
)
def test_patterns_fade_to_their_mean_where_pixels_are_larger(pattern, mean):
    s, t = np.random.default_rng(0).uniform(-50, 50, (2, 4000))
    near, far = (pattern(s, t, np.full(4000, w)) for w in (0.01, 10.3))
    assert near.std() > 0.1 and abs(near.mean() - mean) < 0.05
    assert np.abs(far - mean).max() < 0.05


def test_the_map_of_the_cores_aligns_the_rows():
    views = rectify(embedded(), lens=True)
    after = row_difference({side: views[side].map() for side in SIDES}, points("lens")[1])
    assert after.mean < 1e-3


@pytest.mark.parametrize("name", ["euroc_ds", "euroc_eucm", "kalibr_omni", "mynteye_fov"])
def test_other_lenses_picture_the_scene_and_hdls_maps_align_its_rows(name, tmp_path):
    rig = load(*FILES[name].write(tmp_path), size=(188, 120))
    images, (_, at) = render(rig, True), visible_points(rig, True, 500)
    assert all(image.std() > 35 and (image > 0).mean() > 0.98 for image in images.values())
    before = row_difference(None, at)
    after = row_difference({side: view.map() for side, view in rectify(rig, lens=True).items()}, at)
    assert before.mean > 0.5 and after.n > 200 and after.max < 0.01


def test_the_scene_scales_with_the_baseline():
    rig = RIGS["fisheye"][0]
    larger = SimpleNamespace(**{**vars(rig), "T": rig.T * 1000})
    (X, at), (X_larger, at_larger) = (visible_points(r, True, 200) for r in (rig, larger))
    np.testing.assert_allclose(X_larger, 1000 * X, rtol=1e-9)
    np.testing.assert_allclose(at_larger["right"], at["right"], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", RIGS)
def test_pictures_have_contrast_and_little_clipping(name):
    for image in pair(name).values():
        assert image.std() > 35
        assert np.mean(image == 255) < 0.05 and np.mean(image == 0) < 0.01


def test_depths_differ():
    disparity = np.subtract(*(points("no lens")[1][side][:, 0] for side in SIDES))
    assert np.ptp(disparity) > 10


def small(**changes):
    return render(embedded((160, 120)), True, **changes)


def test_the_same_seed_gives_the_same_pixels_and_another_other_ones():
    first, again, other = small(), small(), small(seed=1)
    for side in SIDES:
        np.testing.assert_array_equal(first[side], again[side])
        assert np.mean(first[side] != other[side]) > 0.2


def test_gray_is_the_luma_of_the_colours():
    gray, colour = small(), small(channels=3)
    assert colour["left"].shape == (120, 160, 3)
    luma = colour["left"] @ [0.114, 0.587, 0.299]
    assert np.mean(np.abs(luma - gray["left"])) < 0.5  # they differ where a channel is clipped


def test_wide_pixels_fill_their_range():
    eight, twelve = small()["right"], small(bits=12)["right"]
    assert twelve.dtype == np.uint16 and eight.dtype == np.uint8
    assert np.abs(twelve / 4095 - eight / 255).max() <= 0.5 / 255 + 0.5 / 4095 + 1e-9


@pytest.mark.parametrize(
    "change, message", [({"bits": 17}, "bits = 17: must be 8 to 16"), ({"channels": 2}, "channels = 2: must be 1 or 3")]
)
def test_arguments_out_of_range_are_named(change, message):
    with pytest.raises(ValueError) as caught:
        render(embedded(), True, **change)
    assert str(caught.value) == message


def test_cameras_that_look_apart_are_refused():
    rig = RIGS["no lens"][0]
    turned = SimpleNamespace(
        source="apart", width=160, height=120, left=rig.left, right=rig.right, T=rig.T,
        R=cv2.Rodrigues(np.array([0, np.pi, 0]))[0],
    )  # fmt: skip
    with pytest.raises(ValueError) as caught:
        visible_points(turned, False, 100)
    assert str(caught.value) == "apart: the cameras hardly see anything in common"
