"""The float64 reference against OpenCV's maps and the paper's recurrences; the lens models inverted, against it."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from rig_numbers import OCAM

from hdl.calibration import embedded
from hdl.geometry.rectification import rectify
from sim import reference
from sim.lens import pixel_rays, unproject

K = np.array([[361.0, 0, 301.5], [0, 363.5, 251.25], [0, 0, 1]])
RATIONAL = [0.12, -0.08, 0.0012, -0.0007, 0.03, 0.31, -0.11, 0.02]
LENSES = {
    "none": ("radtan", []),
    "radtan": ("radtan", [-0.28, 0.07, 0.0002, -0.0013]),
    "k3": ("radtan", [-0.29, 0.095, 0.0012, -0.0004, -0.01]),
    "rational": ("rational", RATIONAL),
    "thin_prism": ("thin_prism", [*RATIONAL, 0.004, -0.002, 0.003, 0.001]),
    "tilted": ("tilted", [*RATIONAL, 0.004, -0.002, 0.003, 0.001, 0.03, -0.05]),
    "equidistant": ("equidistant", [-0.0135, -0.0323, 0.0538, -0.02]),
}
OPENCV = tuple(LENSES)
LENSES |= {
    "double_sphere": ("double_sphere", [-0.17, 0.59]),
    "eucm": ("eucm", [0.59, 1.13]),
    "mei": ("mei", [0.67, -0.05, 0.01, 0.0004, 0.001]),
    "fov": ("fov", [0.93]),
    "scaramuzza": ("scaramuzza", [*OCAM["affine"], *OCAM["inverse"]]),
}
WIDTH, HEIGHT = 640, 480


def camera(name, K=K):
    model, D = LENSES[name]
    return SimpleNamespace(model=model, K=K, D=np.array(D, float))


def view(name, lens=True):
    R = cv2.Rodrigues(np.array([0.02, -0.05, 0.015]))[0]
    P = np.array([[390.0, 0, 318.0, -40.0], [0, 392.0, 244.5, 0], [0, 0, 1, 0]])
    return SimpleNamespace(camera=camera(name), R=R, P=P, width=WIDTH, height=HEIGHT, lens=lens)


def positions(seed=0, count=3000):
    return np.random.default_rng(seed).uniform([0, 0], [WIDTH - 1, HEIGHT - 1], (count, 2))


@pytest.mark.parametrize("name", OPENCV)
def test_map_is_that_of_opencv(name):
    v = view(name)
    fisheye = v.camera.model == "equidistant"
    function = cv2.fisheye.initUndistortRectifyMap if fisheye else cv2.initUndistortRectifyMap
    expected = function(v.camera.K, v.camera.D, v.R, v.P[:, :3], (WIDTH, HEIGHT), cv2.CV_32FC1)
    np.testing.assert_allclose(reference.coordinate_map(v), expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize("lens", [False, True], ids=["no lens", "lens"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_map_of_the_cores_agrees(side, lens):
    v = rectify(embedded(), lens=lens)[side]
    np.testing.assert_allclose(v.map(), reference.coordinate_map(v), rtol=0, atol=1e-9)


def test_source_positions_take_any_shape():
    v = view("radtan")
    u, w = reference.coordinate_map(v)
    single = reference.source_positions(v, 17, 30)
    assert [np.shape(x) for x in single] == [(), ()]
    np.testing.assert_allclose(single, (u[30, 17], w[30, 17]), rtol=0, atol=1e-12)
    column = reference.source_positions(v, 17.0, np.arange(HEIGHT)[:, None])
    np.testing.assert_allclose(column[1][:, 0], w[:, 17], rtol=0, atol=1e-12)


def test_skew_takes_part():
    skewed = K + [[0, 5.0, 0], [0, 0, 0], [0, 0, 0]]
    plain, with_skew = (reference.project(camera("radtan", k), [0.2, -0.3, 2.0], True) for k in (K, skewed))
    y = (plain[1] - K[1, 2]) / K[1, 1]
    np.testing.assert_allclose(with_skew - plain, [5 * y, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["radtan", "equidistant"])
def test_points_behind_the_camera_have_no_position(name):
    pixels = reference.project(camera(name), [[0.1, 0.2, 1], [0.1, 0.2, 0], [0.1, 0.2, -1]], True)
    assert np.isnan(pixels).all(axis=1).tolist() == [False, True, True]


def test_equation_3_is_the_map_without_lens():
    v = view("radtan", lens=False)
    C = v.camera.K @ v.R.T @ np.linalg.inv(v.P[:, :3])
    np.testing.assert_allclose(reference.projective(C, WIDTH, HEIGHT), reference.coordinate_map(v), rtol=0, atol=1e-9)


def test_equation_6_accumulates_the_first_two_rows_of_c():
    C = np.array([[0.98, 0.01, 12.5], [-0.02, 1.03, -7.25], [2e-4, -1e-4, 0.97]])
    w, h = 40, 30
    x, y = C[0, 2], C[1, 2]
    expected = []
    for n in range(w * h):
        expected.append((x, y))
        last = n % w == w - 1
        x += C[0, 1] - (w - 1) * C[0, 0] if last else C[0, 0]
        y += C[1, 1] - (w - 1) * C[1, 0] if last else C[1, 0]
    u, v = reference.proposed(C, w, h)
    np.testing.assert_allclose(np.column_stack([u.ravel(), v.ravel()]), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_rays_lead_back_to_their_pixels(name):
    rays = unproject(camera(name), positions(), True)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(reference.project(camera(name), rays, True), positions(), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["radtan", "tilted", "equidistant", "double_sphere", "mei"])
def test_rays_of_a_whole_image_are_those_of_its_pixels(name):
    rays = pixel_rays(camera(name), 64, 48, True)
    x, y = np.meshgrid(np.arange(64), np.arange(48))
    pixels = reference.project(camera(name), rays, True)
    np.testing.assert_allclose(pixels, np.stack([x, y], axis=-1), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_without_lens_the_camera_is_the_pinhole_that_shows_the_same_next_to_the_axis(name):
    ray = [[3e-4, 2e-4, 1.0]]
    at = [reference.project(camera(name), ray, lens) for lens in (False, True)]
    np.testing.assert_allclose(*at, rtol=0, atol=0.01 if name == "scaramuzza" else 1e-3)
    np.testing.assert_allclose(unproject(camera(name), at[0], False), ray / np.linalg.norm(ray), rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["radtan", "equidistant"])
def test_rays_without_lens_are_those_of_a_pinhole(name):
    rays = unproject(camera(name), positions(), False)
    pinhole = np.column_stack([positions(), np.ones(3000)]) @ np.linalg.inv(K).T
    np.testing.assert_allclose(rays / rays[:, 2:], pinhole, rtol=0, atol=1e-12)


def test_a_lens_that_folds_back_has_no_rays_beyond():
    # r (1 - 0.5 r^2) rises up to r = 0.816, where it is 0.544.
    folding = SimpleNamespace(model="radtan", K=np.eye(3), D=np.array([-0.5, 0, 0, 0]))
    radius = np.array([0.1, 0.4, 0.54, 0.55, 0.7])
    rays = unproject(folding, np.column_stack([radius, 0 * radius]), True)
    assert np.isnan(rays[:, 0]).tolist() == [False, False, False, True, True]
    undistorted = rays[:3, 0] / rays[:3, 2]
    np.testing.assert_allclose(undistorted - 0.5 * undistorted**3, radius[:3], rtol=0, atol=1e-9)
    assert (undistorted < 0.8165).all()


def test_a_fisheye_that_folds_back_has_no_rays_beyond():
    # theta (1 - 0.2 theta^2) rises up to theta = 1.291, where it is 0.861.
    folding = SimpleNamespace(model="equidistant", K=np.eye(3), D=np.array([-0.2, 0, 0, 0]))
    rays = unproject(folding, [[0.5, 0], [0, 0.86], [0, 0.87], [2, 0]], True)
    assert np.isnan(rays[:, 2]).tolist() == [False, False, True, True]


def test_an_image_that_folds_back_in_its_corners_keeps_its_middle():
    folding = SimpleNamespace(model="radtan", K=np.array([[50.0, 0, 40], [0, 50, 30], [0, 0, 1]]), D=np.array([-0.5]))
    rays = pixel_rays(folding, 81, 61, True)
    x, y = np.meshgrid(np.arange(81), np.arange(61))
    radius = np.hypot(x - 40, y - 30) / 50
    np.testing.assert_array_equal(np.isnan(rays[..., 0]), radius > np.sqrt(8 / 27))


def test_a_fisheye_sees_behind_itself():
    ideal = SimpleNamespace(model="equidistant", K=np.diag([100.0, 100.0, 1.0]), D=np.zeros(4))
    theta = np.array([0.0, 0.5, np.pi / 2, 2.0])
    rays = unproject(ideal, np.column_stack([0 * theta, 100 * theta]), True)
    np.testing.assert_allclose(rays, np.column_stack([0 * theta, np.sin(theta), np.cos(theta)]), rtol=0, atol=1e-12)
