"""What a user chooses of a rectification does what it says and keeps rows aligned; --minimise rows never costs rows."""

import re
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from hdl.calibration import SIDES, Camera, Rig, embedded
from hdl.errors import InputError
from hdl.geometry.notes import notes, row_disagreement, warnings
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.geometry.row_minimisation import loss
from scripts import reference_rigs

needs_rigs = pytest.mark.skipif(
    not reference_rigs.FOLDER.is_dir(), reason="the reference data, ../shared/data, is not here"
)


def turn(x, y, z):
    return cv2.Rodrigues(np.array([x, y, z], dtype=float))[0]


@cache
def rig(name):
    """Rigs of 160 px width or so, which take little time: the embedded one, a fisheye, one that brings P and R."""
    if name == "radtan":
        return embedded((160, 120))
    if name == "fisheye":
        K = np.array([[92.0, 0, 93.5], [0, 92, 58], [0, 0, 1]])
        D = np.array([-0.0135, -0.0323, 0.0538, -0.0367])
        cameras = Camera("equidistant", K, D), Camera("equidistant", K + [[0, 0, 1.5], [0, 0, -3], [0, 0, 0]], D)
        return Rig("fisheye.yml", 188, 120, *cameras, turn(0.01, -0.04, 0.02), np.array([-0.12, 0.003, -0.004]))
    given = {side: (view.R, view.P) for side, view in rectify(rig("radtan"), lens=True).items()}
    R, P = given["left"]
    pitch = turn(0.05, 0, 0)
    pitched = {side: (pitch @ R, P + [[0, 0, 2, 0], [0, 0, 5, 0], [0, 0, 0, 0]]) for side, (R, P) in given.items()}
    return replace(rig("radtan"), source="own.yml", rectification=pitched)


RIGS = ("radtan", "fisheye", "own")


def chosen(name, lens=True, **options):
    return rectify(rig(name), RectificationOptions(**options), lens=lens)


@cache
def minimised(name, lens, **options):
    return chosen(name, lens, minimise="rows", **options)


def brute_rows(view):
    """DESIGN section 5, tap by tap: rows between the extremes, one being written, one being released, made even."""
    u, v = view.map()
    y, _ = np.mgrid[: view.height, : view.width]
    offsets = []
    for down in (0, 1):
        for along in (0, 1):
            row, column = np.floor(v) + down, np.floor(u) + along
            inside = (0 <= row) & (row < view.height) & (0 <= column) & (column < view.width)
            offsets.append((row - y)[inside])
    offsets = np.concatenate(offsets)
    rows = max(offsets.max(), 0) - offsets.min() + 3
    return int(rows + rows % 2)


def rows(views):
    return [view.window.rows for view in views.values()]


@pytest.mark.parametrize("lens", [False, True])
@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize(
    "options",
    [{}, {"focal": 130.0}, {"center": (70.0, 64.5)}, {"fov": 50.0}, {"center": (90.0, 50.0), "fov": 100.0}],
    ids=str,
)
def test_rows_agree_and_are_counted_at_every_pixel(name, options, lens):
    views = chosen(name, lens, **options)
    assert row_disagreement(rig(name), views) < 1e-6
    assert rows(views) == [brute_rows(view) for view in views.values()]


@pytest.mark.parametrize("name", RIGS)
def test_focal_and_center_are_those_of_both_views(name):
    for view in chosen(name, focal=123.25, center=(70.5, 61.0)).values():
        assert view.P[:, :3].tolist() == [[123.25, 0, 70.5], [0, 123.25, 61], [0, 0, 1]]
    right = chosen(name, focal=123.25)["right"]
    assert right.P[0, 3] == pytest.approx(-123.25 * np.linalg.norm(rig(name).T))


def test_focal_keeps_the_center_that_opencv_finds():
    default, near = chosen("radtan")["left"], chosen("radtan", focal=200.0)["left"]
    assert np.array_equal(near.P[:2, 2], default.P[:2, 2])
    assert np.array_equal(near.R, default.R)


@pytest.mark.parametrize("center", [None, (40.0, 60.0)])
@pytest.mark.parametrize("fov", [20.0, 90.0, 130.0])
def test_fov_is_the_angle_between_the_outer_edges_of_the_frame(fov, center):
    view = chosen("fisheye", fov=fov, center=center)["left"]
    first, last = (np.linalg.inv(view.P[:, :3]) @ [x, view.P[1, 2], 1] for x in (-0.5, view.width - 0.5))
    cosine = first @ last / np.linalg.norm(first) / np.linalg.norm(last)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(fov)


@pytest.mark.parametrize("center", [(79.5, 59.5), (70.0, 66.0)])
def test_alpha_means_the_same_with_a_center_of_ones_own(center):
    whole, outer = (chosen("radtan", alpha=alpha, center=center) for alpha in (0.0, 1.0))
    assert all(view.inside.all() for view in whole.values())
    f = whole["left"].P[0, 0]
    assert not all(view.inside.all() for view in chosen("radtan", focal=f - 0.5, center=center).values())
    border = np.ones((120, 160), bool)
    border[1:-1, 1:-1] = False
    f = outer["left"].P[0, 0]
    assert not any((view.inside & border).any() for view in chosen("radtan", focal=f - 0.01, center=center).values())
    assert any((view.inside & border).any() for view in chosen("radtan", focal=f + 0.5, center=center).values())
    between = chosen("radtan", alpha=0.25, center=center)["left"].P[0, 0]
    assert between == pytest.approx(0.75 * whole["left"].P[0, 0] + 0.25 * f)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_opencvs_own_center_gives_about_opencvs_focal_length(alpha):
    default = chosen("radtan", alpha=alpha)["left"].P
    ours = chosen("radtan", alpha=alpha, center=tuple(default[:2, 2]))["left"].P
    assert ours[0, 0] == pytest.approx(default[0, 0], rel=0.02)


def test_any_choice_but_minimise_puts_the_files_rectification_aside():
    own = rig("own")
    assert np.array_equal(chosen("own")["left"].R, own.rectification["left"][0])
    for options in ({"alpha": 0.0}, {"focal": 130.0}, {"center": (80.0, 60.0)}, {"fov": 60.0}):
        made, expected = chosen("own", **options), chosen("radtan", **options)
        for side in SIDES:
            assert np.allclose(made[side].R, expected[side].R, rtol=0, atol=1e-12)
            assert np.array_equal(made[side].P, expected[side].P)


def test_notes_say_what_became_of_the_files_rectification():
    options = RectificationOptions(focal=130.0, center=(80.0, 60.0))
    assert notes(rig("own"), options, chosen("own", focal=130.0, center=(80.0, 60.0))) == [
        "own.yml: the rectification in the file is not used as it stands, because of --focal, --center"
    ]
    assert notes(rig("own"), RectificationOptions(), chosen("own")) == []
    assert notes(rig("radtan"), options, chosen("radtan", focal=130.0)) == []
    for name, given, origin in (
        ("own", RectificationOptions(), "the file's own"),
        ("own", options, "computed, --focal, --center"),
        ("radtan", RectificationOptions(), "computed, default"),
    ):
        assert {view.origin for view in rectify(rig(name), given, lens=True).values()} == {origin}


def test_frames_that_are_empty_for_the_most_part_are_warned_of():
    wide = rectify(rig("radtan"), RectificationOptions(focal=20.0), lens=True)
    first, second = warnings(rig("radtan"), wide)
    said = r"opencv_samples.yml: P1 = \[\[20\.0, .*: only 3 % of the rectified left frame has a source in the image"
    assert re.fullmatch(said, first)
    assert "P2" in second and "right" in second
    assert warnings(rig("radtan"), rectify(rig("radtan"), lens=True)) == []


def test_notes_tell_rows_before_and_after():
    options = RectificationOptions(minimise="rows")
    before, after = chosen("radtan"), minimised("radtan", True)
    lost = 100 * loss(before, after)
    assert notes(rig("radtan"), options, after) == [
        f"--minimise rows: line buffers of {before['left'].window.rows} + {before['right'].window.rows} rows, left + "
        f"right, become {after['left'].window.rows} + {after['right'].window.rows}; {lost:.1f} % of the view is lost, "
        + " and ".join(f"{100 * after[side].inside.mean():.1f} %" for side in SIDES)
        + " of the frames have a source"
    ]


@pytest.mark.parametrize("lens", [False, True])
@pytest.mark.parametrize("name", RIGS)
def test_minimised_rows_are_fewer_aligned_and_cost_no_more_than_allowed(name, lens):
    before, after = chosen(name, lens), minimised(name, lens)
    assert sum(rows(after)) < sum(rows(before)) or ((name, lens) == ("fisheye", False) and rows(after) == rows(before))
    assert rows(after) == [brute_rows(view) for view in after.values()]
    assert 0 <= loss(before, after) <= 0.05
    assert row_disagreement(rig(name), after) < 1e-6
    turns = [after[side].R @ before[side].R.T for side in SIDES]
    assert np.allclose(turns[0], turns[1], rtol=0, atol=1e-12)
    assert np.allclose(turns[0] @ [1, 0, 0], [1, 0, 0], rtol=0, atol=1e-12)
    assert np.array_equal(after["left"].P[1], after["right"].P[1])
    for side in SIDES:
        assert after[side].P[0, 2] == before[side].P[0, 2]
        assert after[side].P[0, 0] >= 0.95 * before[side].P[0, 0]
        assert after[side].inside.mean() >= 0.95 * before[side].inside.mean()


@pytest.mark.parametrize("change", [{"focal": 1.1}, {"pitch": 0.06}], ids=str)
def test_lost_field_of_view_is_the_solid_angle_of_what_was_shown_and_is_no_more(change):
    """Against pixels as pairs of spherical triangles, sent from one frame into the other one by one."""
    before = chosen("radtan")
    turned = turn(change.get("pitch", 0), 0, 0)
    growth = np.diag([change.get("focal", 1), change.get("focal", 1), 1])
    after = {side: replace(view, R=turned @ view.R, P=about(view.P, growth)) for side, view in before.items()}
    kept = []
    for side, view in before.items():
        y, x = (w.ravel() for w in np.mgrid[: view.height, : view.width])
        corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
        pixels = np.stack([x, y], axis=1)[:, None] + corners
        rays = np.concatenate([(pixels - view.P[:2, 2]) / view.P[[0, 1], [0, 1]], np.ones(pixels.shape[:2] + (1,))], -1)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        angle = sum(triangle(rays[:, 0], rays[:, i], rays[:, i + 1]) for i in (1, 2)) * view.inside.ravel()
        towards = after[side].P[:, :3] @ turned @ np.linalg.inv(view.P[:, :3]) @ [x, y, np.ones(x.size)]
        column, row = towards[:2] / towards[2]
        seen = (-0.5 <= column) & (column <= view.width - 0.5) & (-0.5 <= row) & (row <= view.height - 0.5)
        kept.append((angle * seen).sum() / angle.sum())
        assert after[side].inside.mean() > kept[-1]
    assert min(kept) < 0.95
    assert loss(before, after) == pytest.approx(1 - min(kept), abs=1e-4)


def about(P, growth):
    """``P`` with its focal length times ``growth``, its principal point as it was."""
    scaled = P.copy()
    scaled[:, :2] = growth @ P[:, :2]
    return scaled


def triangle(a, b, c):
    """Solid angle, sr, of the triangles between unit vectors (Van Oosterom and Strackee 1983)."""
    dots = 1 + (a * b).sum(-1) + (b * c).sum(-1) + (c * a).sum(-1)
    return 2 * np.arctan2(np.abs((a * np.cross(b, c)).sum(-1)), dots)


@pytest.mark.parametrize("fixed", [{"center": (79.5, 59.5)}, {"focal": 120.0}, {"fov": 60.0}], ids=str)
def test_minimise_leaves_alone_what_was_chosen(fixed):
    before, after = chosen("radtan", **fixed), chosen("radtan", minimise="rows", **fixed)
    assert sum(rows(after)) <= sum(rows(before))
    if "center" in fixed:
        assert after["left"].P[:2, 2].tolist() == [79.5, 59.5]
    else:
        assert after["left"].P[0, 0] == before["left"].P[0, 0]


def test_minimise_alone_starts_from_the_files_rectification():
    assert loss(chosen("own"), minimised("own", True)) <= 0.05
    assert loss(chosen("radtan"), minimised("own", True)) > 0.05  # which looks 3 degrees away
    assert minimised("own", True)["left"].P[0, 2] == rig("own").rectification["left"][1][0, 2]


def test_a_larger_allowed_loss_saves_more_rows_and_none_loses_nothing():
    before = chosen("radtan")
    nothing, much = (chosen("radtan", minimise="rows", max_fov_loss=share) for share in (0.0, 0.2))
    assert loss(before, nothing) == 0
    assert sum(rows(much)) < sum(rows(minimised("radtan", True))) < sum(rows(nothing)) <= sum(rows(before))


def test_minimise_finds_the_same_every_time():
    again = chosen("radtan", minimise="rows")
    for side in SIDES:
        assert np.array_equal(again[side].R, minimised("radtan", True)[side].R)
        assert np.array_equal(again[side].P, minimised("radtan", True)[side].P)


def test_row_disagreement_sees_a_rectification_of_other_cameras():
    transposed = replace(rig("own"), R=rig("own").R.T)
    assert row_disagreement(transposed, chosen("own")) > 1


@pytest.mark.parametrize(
    "options, message",
    [
        ({"alpha": 1.5}, "--alpha: 1.5: a number from 0 to 1 is needed"),
        ({"focal": 0.0}, "--focal: 0.0: a positive number of pixels is needed"),
        ({"focal": float("inf")}, "--focal: inf: a positive number of pixels is needed"),
        ({"fov": 180.0}, "--fov: 180.0: an angle between 0 and 180 degrees is needed"),
        ({"fov": float("nan")}, "--fov: nan: an angle between 0 and 180 degrees is needed"),
        ({"max_fov_loss": 0.6}, "--max-fov-loss: 0.6: a share from 0 to 0.5 is needed"),
        (
            {"max_fov_loss": 0.05},
            "--max-fov-loss: 0.05: what --minimise rows may lose of the view; nothing is minimised without it",
        ),
        ({"minimise": "columns"}, "--minimise: columns: rows is what can be minimised"),
        ({"alpha": 0.0, "focal": 500.0}, "--focal: 500.0: --alpha chooses the focal length already; keep one of them"),
        ({"focal": 500.0, "fov": 60.0}, "--fov: 60.0: --focal chooses the focal length already; keep one of them"),
    ],
    ids=str,
)
def test_options_outside_their_range_are_refused(options, message):
    with pytest.raises(InputError) as caught:
        RectificationOptions(**options)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    "name, options, message",
    [
        ("fisheye", {"alpha": 0.5}, "--alpha: 0.5: a lens of model equidistant has none; choose --focal or --fov"),
        (
            "radtan",
            {"center": (160.0, 6.0)},
            "--center: x = 160.0: the principal point lies outside the 160x120 frame; "
            "--center 159,6 is the nearest inside",
        ),
        (
            "radtan",
            {"center": (80.0, -1.0)},
            "--center: y = -1.0: the principal point lies outside the 160x120 frame; "
            "--center 80,0 is the nearest inside",
        ),
        ("radtan", {"focal": 2.0}, "--focal: 2.0: a focal length of 2 px suits no 160x120 frame"),
        ("radtan", {"fov": 179.0}, "--fov: 179.0: a focal length of 0.6955 px suits no 160x120 frame"),
    ],
    ids=str,
)
def test_options_that_do_not_fit_the_rig_are_refused(name, options, message):
    with pytest.raises(InputError) as caught:
        chosen(name, **options)
    assert str(caught.value) == message


@needs_rigs
@pytest.mark.parametrize("name", reference_rigs.CALIBRATIONS)
def test_real_rigs_have_aligned_rows_before_and_after_minimising(name):
    real = reference_rigs.load(name)
    small = real.scaled(real.width // 4, real.height // 4)
    before = rectify(small, lens=True)
    after = rectify(small, RectificationOptions(minimise="rows"), lens=True)
    for views in (before, after):
        assert row_disagreement(small, views) < 1e-6
        assert rows(views) == [brute_rows(view) for view in views.values()]
    assert sum(rows(after)) <= sum(rows(before))
    assert loss(before, after) <= 0.05


@needs_rigs
@pytest.mark.parametrize("name, saved", [("EuRoC", 0.1), ("PS4 Eye", 0.25)])
def test_real_rigs_save_rows_at_their_own_size(name, saved):
    real = reference_rigs.load(name)
    before, after = (rectify(real, RectificationOptions(minimise=what), lens=True) for what in (None, "rows"))
    assert sum(rows(after)) <= (1 - saved) * sum(rows(before))
    assert loss(before, after) <= 0.05
