"""Lens models against the float reference, which has them from other equations, and against each other."""

from types import SimpleNamespace

import numpy as np
import pytest
from rig_numbers import KITTI_360, OCAM, WIDE

from hdl.lens import LENS_MODELS
from sim import reference
from sim.lens import unproject

FOCAL = 400.0  # px; what is compared is then in px
K = np.diag([FOCAL, FOCAL, 1.0])
EQUIDISTANT_AS_OCAM = [1, 0, 0, FOCAL * np.pi / 2, FOCAL]


def _own(name):
    """xi, alpha, beta and the distortion of the left camera of a rig in Kalibr's form."""
    camera = WIDE[name]["cameras"][0]
    return [*camera["intrinsics"][:-4], *camera["D"]]


LENSES = {
    "tum_vi_ds": ("double_sphere", _own("tum_vi_ds")),
    "euroc_ds": ("double_sphere", _own("euroc_ds")),
    "ds, second sphere in front": ("double_sphere", [0.5, 0.3]),
    "ds, pinhole infinitely far": ("double_sphere", [0.2, 1.0]),
    "ds, first sphere alone": ("double_sphere", [-0.1, 0.0]),
    "euroc_eucm": ("eucm", _own("euroc_eucm")),
    "eucm, orthographic": ("eucm", [1.0, 1.3]),
    "eucm, flat": ("eucm", [0.3, 0.4]),
    "kalibr_omni": ("mei", _own("kalibr_omni")),
    "kitti_360": ("mei", [KITTI_360["intrinsics"][0], *KITTI_360["D"]]),
    "mei without radial and tangential terms": ("mei", [1.2]),
    "mynteye_fov": ("fov", _own("mynteye_fov")),
    "fov, wide": ("fov", [2.4]),
    "ocam": ("scaramuzza", [*OCAM["affine"], *OCAM["inverse"]]),
}


def camera(name):
    model, D = LENSES[name]
    return SimpleNamespace(model=model, K=K, D=np.array(D, float))


def points(count=4000, widest=1.4, seed=0):
    """(n, 2) on the plane z = 1, up to ``widest`` rad off the axis in every direction, the axis itself among them."""
    rng = np.random.default_rng(seed)
    angle, turn = rng.uniform(0, widest, count), rng.uniform(0, 2 * np.pi, count)
    angle[0] = 0
    return np.tan(angle)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])


def distorted(model, D, plane):
    return np.column_stack(LENS_MODELS[model].distort(*plane.T.copy(), np.array(D, float)))


def in_space(plane, seed=1):
    """Points of space, at many distances, that are seen at ``plane``."""
    return np.column_stack([plane, np.ones(len(plane))]) * np.random.default_rng(seed).uniform(0.1, 50, (len(plane), 1))


@pytest.mark.parametrize("name", LENSES)
def test_points_are_where_the_papers_equations_have_them(name):
    plane = points()
    expected = reference.project(camera(name), in_space(plane), True)
    assert not np.isnan(expected).any()
    np.testing.assert_allclose(FOCAL * distorted(*LENSES[name], plane), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_the_way_back_leads_to_the_same_point(name):
    plane = points()
    rays = unproject(camera(name), FOCAL * distorted(*LENSES[name], plane), True)
    np.testing.assert_allclose(rays, in_space(plane) / np.linalg.norm(in_space(plane), axis=1)[:, None], atol=1e-9)
    again = FOCAL * distorted(*LENSES[name], rays[:, :2] / rays[:, 2:])
    np.testing.assert_allclose(again, FOCAL * distorted(*LENSES[name], plane), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_the_magnification_is_that_next_to_the_optical_axis(name):
    model, D = LENSES[name]
    D = np.array(D, float)
    step = 1e-4 * np.array([[1, 0], [2, 0]])  # of which the difference does not know where the axis itself is
    slope = np.diff(distorted(model, D, step)[:, 0])[0] / 1e-4
    assert LENS_MODELS[model].magnification(D) == pytest.approx(slope, rel=1e-3 if model == "scaramuzza" else 1e-6)


def test_names_and_counts_of_coefficients_agree():
    for lens in LENS_MODELS.values():
        assert max(lens.counts) == len(lens.coefficients) and set(lens.limits) <= set(lens.coefficients)


@pytest.mark.parametrize(
    "one, other, scale",
    [
        (("double_sphere", [0, 0]), ("radtan", []), 1),
        (("double_sphere", [0, 0.6]), ("eucm", [0.6, 1]), 1),  # both are the unified model then
        (("mei", [1.5]), ("eucm", [0.6, 1]), 2.5),
        (("double_sphere", [1.5, 0]), ("mei", [1.5]), 1),
        (("mei", [0, -0.28, 0.07, 0.002, -0.001]), ("radtan", [-0.28, 0.07, 0.002, -0.001]), 1),
        (("eucm", [0, 3]), ("radtan", []), 1),
        (("fov", [0]), ("radtan", []), 1),
        (("fov", [1e-5]), ("radtan", []), 1),
        (("scaramuzza", EQUIDISTANT_AS_OCAM), ("equidistant", [0, 0, 0, 0]), 1),
    ],
    ids=str,
)
def test_models_agree_where_one_is_the_other(one, other, scale):
    plane = points(widest=1.2)
    np.testing.assert_allclose(distorted(*one, plane), distorted(*other, plane) / scale, rtol=0, atol=1e-9)


# The second sphere is left where its point is as high as the pinhole sees; mei's first one where z = -xi.
DS_LIMIT = np.arccos(0.6 - 0.25 * (0.15 + np.sqrt(1 - 0.36 * (1 - 0.25**2))))


@pytest.mark.parametrize(
    "model, D, limit",
    [
        ("double_sphere", [-0.6, 0.2], DS_LIMIT),  # the image goes to infinity there
        ("double_sphere", [-0.6, 0.8], DS_LIMIT),  # it ends, and would turn back
        ("mei", [-0.3, 0, 0, 0, 0], np.arccos(0.3)),
    ],
)
def test_rays_that_the_model_is_not_defined_for_have_no_position(model, D, limit):
    angles = limit + np.array([-0.5, -1e-6, 1e-6, 0.1, 0.2])
    plane = np.column_stack([np.tan(angles), 0 * angles])
    with np.errstate(all="raise"):
        assert np.isnan(distorted(model, D, plane)[:, 0]).tolist() == [False, False, True, True, True]
    pixels = reference.project(SimpleNamespace(model=model, K=K, D=np.array(D)), in_space(plane), True)
    assert np.isnan(pixels[:, 0]).tolist() == [False, False, True, True, True]
