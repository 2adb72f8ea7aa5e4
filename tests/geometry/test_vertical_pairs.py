"""One camera above the other: columns of the rectified pair agree, and everything that speaks of rows knows it."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from commands import ended
from standing_rigs import rotation, standing, write

from hdl.calibration import Camera, load
from hdl.calibration.stance import turn_about_view
from hdl.calibration.suspicions import row_difference
from hdl.core.build import Options, build
from hdl.core.plan_file import baseline_of, load_folder, stereo_rig
from hdl.errors import InputError
from hdl.generate import write as write_cores
from hdl.geometry.notes import notes, row_disagreement, warnings
from hdl.geometry.rectification import RectificationOptions, rectify
from sim.run import simulate

UPPER_FIRST = (0.002, 0.1, 0.001)


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def fisheye():
    rig = standing(at=UPPER_FIRST)
    D = np.array([-0.0135, -0.0323, 0.0538, -0.0367])
    return replace(rig, left=Camera("equidistant", rig.left.K, D), right=Camera("equidistant", rig.right.K, D))


RIGS = {"radtan": standing(at=UPPER_FIRST), "pinhole": standing(at=UPPER_FIRST, lens=False), "fisheye": fisheye()}


@pytest.mark.parametrize(
    "options", [{}, {"focal": 130.0}, {"fov": 50.0, "center": (70.0, 64.5)}, {"minimise": "rows"}], ids=str
)
@pytest.mark.parametrize("name", RIGS)
def test_a_point_lies_on_one_column_and_its_disparity_tells_its_distance(name, options):
    rig = RIGS[name]
    left, right = rectify(rig, RectificationOptions(**options), lens=True).values()
    points = np.random.default_rng(3).uniform([-0.5, -0.4, 1], [0.5, 0.4, 5], (50, 3)).T
    xl, yl, zl = left.P[:, :3] @ left.R @ points
    xr, yr, zr = right.P[:, :3] @ right.R @ (rig.R @ points + rig.T[:, None])
    assert np.abs(xl / zl - xr / zr).max() < 1e-9
    assert (yl / zl - yr / zr) == pytest.approx(left.P[1, 1] * np.linalg.norm(rig.T) / zl)
    assert (left.aligned, right.aligned) == ("columns", "columns")
    assert row_disagreement(rig, {"left": left, "right": right}) < 1e-9
    assert row_difference(rig, {side.side: (side.R, side.P) for side in (left, right)}) < 1e-9


@pytest.mark.parametrize("name", RIGS)
def test_images_are_not_turned_and_nothing_is_warned_of(name):
    views = rectify(RIGS[name], lens=True)
    assert max(abs(turn_about_view(view.R)) for view in views.values()) < 2
    assert warnings(RIGS[name], views) == []
    assert all(view.window.rows < 30 for view in views.values())


def test_a_matcher_is_told_to_search_down_the_columns():
    rig = RIGS["radtan"]
    assert notes(rig, RectificationOptions(), rectify(rig, lens=True)) == [
        "rig.yml: one camera stands above the other, so that a point lies on one column of both rectified images, not "
        "on one row; search down the columns (y_left - y_right = f B / Z), or transpose both images"
    ]
    beside = standing()
    assert notes(beside, RectificationOptions(), rectify(beside, lens=True)) == []


def test_minimising_saves_rows_and_turns_about_the_baseline():
    rig = RIGS["radtan"]
    before, after = (rectify(rig, RectificationOptions(minimise=what), lens=True) for what in (None, "rows"))
    assert sum(view.window.rows for view in after.values()) < sum(view.window.rows for view in before.values())
    for side in before:
        turn = after[side].R @ before[side].R.T
        assert turn @ [0, 1, 0] == pytest.approx([0, 1, 0])
        assert after[side].P[0, 2] == before[side].P[0, 2]


def test_the_rectification_of_the_file_is_used():
    rig = RIGS["radtan"]
    given = {side: (view.R, view.P) for side, view in rectify(rig, lens=True).items()}
    loaded = load(write(rig, rectification=given))
    assert loaded.rectification and not loaded.warnings and not loaded.rectification_warnings
    assert rectify(loaded, lens=True)["left"].aligned == "columns"


@pytest.mark.parametrize("pan, said", [
    (2e-3, "columns of the rectification in the file differ by up to 0.35 px, 10 baselines away"),
    (2e-2, "R1 and R2 are not used: columns would differ by 3.5 px, as they are not of these cameras"),
])  # fmt: skip
def test_columns_that_differ_are_told_of_as_columns(pan, said):
    rig = RIGS["radtan"]
    given = {side: (view.R, view.P) for side, view in rectify(rig, lens=True).items()}
    given["right"] = rotation(0, np.degrees(pan), 0) @ given["right"][0], given["right"][1]
    loaded = load(write(rig, rectification=given))
    (line,) = [*loaded.warnings, *loaded.rectification_warnings]
    assert said in line


def test_a_baseline_of_the_wrong_sign_is_that_of_a_camera_below():
    rig = RIGS["radtan"]
    given = {side: (view.R, view.P.copy()) for side, view in rectify(rig, lens=True).items()}
    given["right"][1][1, 3] *= -1
    with pytest.raises(
        InputError, match=r"P2 = \[0.0, .*: the baseline has the wrong sign for a camera below; --alpha 0"
    ):
        rectify(load(write(rig, rectification=given)), lens=True)


@pytest.fixture
def folder(tmp_path):
    views = rectify(RIGS["radtan"], lens=False)
    write_cores([build(view, Options("proposed"), f"rectify_{side}") for side, view in views.items()], tmp_path)
    return tmp_path


def test_plans_say_what_is_aligned_and_imply_the_rig(folder):
    cores = load_folder(folder)
    assert [core.plan.rectification.aligned for core in cores.values()] == ["columns", "columns"]
    implied, rig = stereo_rig(cores), RIGS["radtan"]
    assert implied.R == pytest.approx(rig.R, abs=1e-9) and implied.T == pytest.approx(rig.T, abs=1e-9)
    assert baseline_of(*(core.view for core in cores.values())) == pytest.approx(np.linalg.norm(rig.T))
    for core in cores.values():
        assert core.rebuild().plan == core.plan


def test_a_single_upper_camera_gets_a_lower_one_beside_its_plan(folder):
    (core,) = [core for side, core in load_folder(folder).items() if side == "left"]
    implied = stereo_rig({"left": core})
    assert core.view.R @ implied.T == pytest.approx([0, -1, 0])


def test_a_core_for_rows_and_one_for_columns_are_no_pair(folder):
    view = rectify(standing(), lens=False)["right"]
    write_cores([build(view, Options("proposed"), "rectify_right")], folder)
    with pytest.raises(InputError) as caught:
        load_folder(folder)
    said = "rectification.aligned = rows: rectify_left.json has columns: these two are no pair"
    assert str(caught.value) == f"{folder}/rectify_right.json: {said}"


def test_simulation_compares_columns(capsys):
    rig = write(standing(at=UPPER_FIRST, right=(0.3, 2.0, -1.5)))
    status, out, err = ended(
        capsys, simulate, rig, "--datapath", "polynomial", "--no-lens", "--output", "out", "--json"
    )  # fmt: skip
    assert (status, err.startswith("note: rig.yml: one camera stands above the other")) == (0, True)
    result = json.loads(out)
    assert "row_difference" not in result
    columns = result["column_difference"]
    assert columns["after"]["mean"] < 0.1 < 1 < columns["before"]["mean"]
    for stage in ("source", "rectified"):
        height, width, _ = cv2.imread(result["pictures"][f"epipolar_{stage}"]).shape
        assert (height > 240, width) == (True, 160)
