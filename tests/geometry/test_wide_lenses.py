"""Rectified views through the lens models that cv2.stereoRectify does not know."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_files import turn
from rig_numbers import KITTI_360, OCAM

from hdl.calibration import Camera, Rig, lenses
from hdl.errors import InputError
from hdl.geometry.notes import row_disagreement, warnings
from hdl.geometry.rectification import RectificationOptions, rectify
from sim import reference

K = np.array([[120.0, 0, 80], [0, 121, 58], [0, 0, 1]])
CAMERAS = {
    "double_sphere": Camera("double_sphere", K, np.array([-0.2, 0.6])),
    "eucm": Camera("eucm", K, np.array([0.6, 1.1])),
    "mei": Camera("mei", K, np.array([0.7, -0.3, 0.1, 0.001, 0.0005])),
    "fov": Camera("fov", K, np.array([0.95])),
    "scaramuzza": lenses.scaramuzza_camera(OCAM["inverse"], OCAM["affine"], OCAM["centre"]),
}


def rig(camera, width=160, height=120):
    return Rig("wide.yml", width, height, camera, camera, turn(0.01, -0.04, 0.02), np.array([-0.12, 0.003, -0.004]))


def chosen(name, lens=True, **options):
    whole = rig(CAMERAS[name], *OCAM["size"]) if name == "scaramuzza" else rig(CAMERAS[name])
    return rectify(whole, RectificationOptions(**options), lens=lens)


@pytest.mark.parametrize("name, magnification", [
    ("double_sphere", 1 / 0.8), ("eucm", 1), ("mei", 1 / 1.7), ("fov", 2 * np.tan(0.475) / 0.95),
])  # fmt: skip
def test_the_focal_length_is_kept_as_it_is_next_to_the_optical_axis(name, magnification):
    for view in chosen(name).values():
        assert view.P[0, 0] == view.P[1, 1] == pytest.approx(120.5 * magnification, rel=1e-12)
        assert view.P[:2, 2].tolist() == [79.5, 59.5]


@pytest.mark.parametrize("name", CAMERAS)
def test_maps_are_those_of_the_float_reference_and_rows_agree(name):
    views = chosen(name)
    for view in views.values():
        np.testing.assert_allclose(view.map(), reference.coordinate_map(view), rtol=0, atol=1e-9)
        plain = replace(view, lens=False)
        np.testing.assert_allclose(plain.map(), reference.coordinate_map(plain), rtol=0, atol=1e-9)
    whole = rig(CAMERAS[name], views["left"].width, views["left"].height)
    assert row_disagreement(whole, views) < 1e-9 and warnings(whole, views) == []


@pytest.mark.parametrize("name", CAMERAS)
def test_with_and_without_the_lens_the_map_is_the_same_next_to_the_optical_axis(name):
    with_lens, without = chosen(name)["left"], chosen(name, lens=False)["left"]
    x, y, z = with_lens.P[:, :3] @ with_lens.R[:, 2]  # where the source's axis is seen
    at = x / z + np.array([-0.05, 0.05, 0.1]), y / z + np.array([0.05, -0.1, 0.1])
    np.testing.assert_allclose(with_lens.project(*at), without.project(*at), rtol=0, atol=0.02)
    away = x / z + 40, y / z
    assert abs(with_lens.project(*away)[0] - without.project(*away)[0]) > 0.1


@pytest.mark.parametrize("name", CAMERAS)
def test_they_have_no_alpha(name):
    with pytest.raises(InputError) as caught:
        chosen(name, alpha=0.0)
    assert str(caught.value) == f"--alpha: 0.0: a lens of model {name} has none; choose --focal or --fov"


@pytest.mark.parametrize("D, model, named", [
    ([-0.6, 0.2], "double_sphere", "[-0.6, 0.2]"),
    ([-0.5, 0.0, 0.0, 0.0, 0.0], "mei", "[-0.5, 0.0, 0.0, 0.0, 0.0]"),
])  # fmt: skip
def test_a_frame_with_rays_that_the_model_is_not_defined_for_is_refused_and_the_advice_helps(D, model, named):
    whole = rig(Camera(model, K, np.array(D)))
    view = rectify(whole, RectificationOptions(focal=20), lens=True)["right"]
    with pytest.raises(InputError) as caught:
        view.map()
    assert str(caught.value) == (
        f"wide.yml: D2 = {named}: the rectified right frame shows rays that the lens model {model} is not defined for; "
        "a larger --focal or a smaller --fov leaves them out"
    )
    for options in ({"focal": 100}, {"fov": 70}):
        assert np.isfinite(rectify(whole, RectificationOptions(**options), lens=True)["right"].map()).all()


def test_a_frame_wider_than_half_of_space_is_a_matter_of_its_size():
    """KITTI-360's fisheye sees 185 degrees; of what a flat image can hold of them the map knows every ray."""
    xi, *pinhole = KITTI_360["intrinsics"]
    fu, fv, pu, pv = (value / 8 for value in pinhole)
    camera = Camera("mei", np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]]), np.array([xi, *KITTI_360["D"]]))
    view = rectify(rig(camera, 175, 175), RectificationOptions(fov=150), lens=True)["left"]
    np.testing.assert_allclose(view.map(), reference.coordinate_map(view), rtol=0, atol=1e-9)
    assert view.inside.all() and view.folded() == 0
