"""The figure of images before and after: what is measured, which points, and that broken pixels are noticed."""

import json
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from pictures import HEIGHT, WIDTH, board, seen
from pictures import rig as parallel

from hdl import calibration, cli
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.rectification import RectificationOptions, rectify
from scripts import figure5, figure5_drawing
from sim.frame import frame_through
from sim.scene import visible_points

SIZE = 128, 96
SIDES = "left", "right"


@pytest.fixture(scope="module")
def rig():
    return calibration.embedded(SIZE)


class Model:
    """In place of a compiled core: gives out what ``pixels`` makes of the integer model's frame."""

    def __init__(self, core, pixels=lambda frame: frame):
        self.core, self.pixels = core, pixels


def through_model(core, compiled, seconds, source):
    """What `frame_through` reports, without compiling anything."""
    from sim.remap import remap

    used = core.parameters.datapath.coordinates
    model = remap(source, used.u, used.v, used.fraction_bits)
    rectified = compiled.pixels(model)
    return type("Result", (), {"rectified": rectified, "model_differences": int((rectified != model).sum())})


@pytest.fixture
def quick(monkeypatch):
    """No compiler: the integer model's pixels; and three datapaths."""
    for name in [name for name in DATAPATHS if name not in ("conventional", "accumulate", "proposed", "spline")]:
        monkeypatch.delitem(DATAPATHS, name)
    monkeypatch.setattr(figure5.Cores, "_compiled", lambda self, core: Model(core))
    monkeypatch.setattr(figure5, "frame_through", through_model)
    embedded = calibration.embedded
    monkeypatch.setattr(calibration, "embedded", lambda size=SIZE: embedded(size))


@pytest.fixture
def script(monkeypatch, capsys):
    """Runs figure5 as the shell does: (exit status, stdout, stderr)."""

    def run(*arguments):
        monkeypatch.setenv("COLUMNS", "200")
        monkeypatch.setattr(sys, "argv", ["figure5", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.run(figure5.figure5)
        captured = capsys.readouterr()
        return ended.value.code, captured.out, captured.err

    return run


def silent(step):
    pass


def test_row_difference_is_that_of_the_points_in_the_rectified_cameras(rig, quick):
    # Not through any map: the points projected by the rectified cameras, for which Eq. 6 with z = 1 has an inverse too.
    pair = next(figure5.pairs((), None, silent))
    assert not pair.lens
    _, points = visible_points(rig, False, figure5.KNOWN_POINTS)
    rows = {row.label: row for row in figure5.rows_of(pair, figure5.Cores(silent), [])}
    assert list(rows) == ["original", "conventional, accumulate", "proposed", "spline"]
    source = np.abs(points["left"][:, 1] - points["right"][:, 1])
    assert rows["original"].measured["row_difference"] == pytest.approx({"mean": source.mean(), "max": source.max()})
    views = rectify(rig, lens=False)
    positions = {}
    for side, view in views.items():
        A, b = view.homography[:2, :2], view.homography[:2, 2]
        positions[side] = np.linalg.solve(A, (points[side] - b).T).T
    shown = np.logical_and.reduce(
        [((at >= 0.5) & (at <= np.array(SIZE) - 1.5)).all(axis=1) for at in positions.values()]
    )
    expected = np.abs(positions["left"][:, 1] - positions["right"][:, 1])[shown]
    found = rows["proposed"].measured
    assert found["points"] >= shown.sum() > 3000
    # Coordinates of 1/32 px cost half of that at each end, on average half of that again.
    assert found["row_difference"]["mean"] == pytest.approx(expected.mean(), abs=0.01)
    assert found["row_difference"]["max"] == pytest.approx(expected.max(), abs=1 / 16)
    assert rows["conventional, accumulate"].measured["row_difference"]["max"] < 1 / 16


def test_coordinate_error_is_the_distance_from_opencvs_map_where_the_source_is_inside(rig):
    view = rectify(rig, RectificationOptions(alpha=1.0), lens=True)["left"]
    u, v = cv2.initUndistortRectifyMap(view.camera.K, view.camera.D, view.R, view.P, SIZE, cv2.CV_32FC1)
    off = figure5.coordinate_error((u + 3.0, v - 4.0), view)
    inside = (u > 0.01) & (u < SIZE[0] - 1.01) & (v > 0.01) & (v < SIZE[1] - 1.01)
    assert off[inside] == pytest.approx(5.0, abs=1e-3)
    outside = (u < -0.01) | (u > SIZE[0] - 0.99) | (v < -0.01) | (v > SIZE[1] - 0.99)
    assert inside.any() and outside.any() and np.isnan(off[outside]).all()


def test_detail_is_the_point_that_the_papers_method_leaves_farthest_apart():
    def row(names, right):
        left = np.array([[50.0, 40], [60, 45], [70, 50], [3, 3]])
        return figure5_drawing.Row(
            "", {}, {"left": left, "right": left + [[0, off] for off in right]}, None, {"datapaths": names}
        )

    image = np.random.default_rng(0).integers(0, 256, (96, 128), np.uint8)
    rows = [row([], (9, 9, 9, 9)), row(["proposed"], (0.5, -2, 1, 30)), row(["spline"], (5, 0, 0, 0))]
    pair = figure5.Pair("", "", calibration.embedded(SIZE), False, {"left": image}, rows[0].points)
    assert figure5.detail(pair, rows) == 1
    nowhere = replace(rows[1], points={side: np.full((4, 2), np.nan) for side in SIDES})
    assert figure5.detail(pair, [rows[0], nowhere]) is None


def test_points_of_real_images_are_found_and_followed_through_the_cores():
    images = seen(board(), 3)
    points_by, points = figure5.found_points(images, parallel(3))
    assert points_by == "corners of a 9x6 chessboard" and len(points["left"]) == 54
    pair = figure5.Pair("real", "", parallel(3), True, images, points, points_by)
    off = {side: np.full((HEIGHT, WIDTH), 1.0) for side in SIDES}
    # The right core shows everything three rows higher, and half of what is left.
    x, y = np.meshgrid(np.arange(float(WIDTH)), np.arange(float(HEIGHT)))
    maps = {"left": (x, y), "right": (x[:, :160], y[:, :160] + 3)}
    measured = figure5.row_of(pair, "core", images, maps, off, ("core",), False).measured
    assert measured["row_difference"]["mean"] < 0.1 and measured["points_by"] == points_by
    assert 0 < measured["points"] == np.sum(points["right"][:, 0] <= 159) < 54
    assert figure5.row_of(pair, "original", images, None, None).measured["row_difference"]["mean"] == pytest.approx(
        3, abs=0.1
    )
    blank = {side: np.zeros_like(images[side]) for side in SIDES}
    with pytest.raises(InputError, match="^rig.yml: images: the two images are the same$"):
        figure5.found_points(blank, parallel(3))


def test_pictures_and_rows_are_written_with_and_without_the_lens(quick, script, tmp_path):
    status, out, err = script("--data", tmp_path / "missing", "--output", tmp_path, "--json", tmp_path / "rows.json")
    assert (status, err) == (0, "")
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert [(row["picture"], row["row"]) for row in rows] == [
        ("rendered_without_lens", name) for name in ("original", "conventional, accumulate", "proposed", "spline")
    ] + [
        ("rendered_with_lens", name)
        for name in (
            "original",
            "conventional, without the lens",
            "proposed, without the lens",
            "conventional, with the lens",
            "spline, with the lens",
        )
    ]
    for row in rows:
        assert set(row["row_difference"]) == {"mean", "max"} and row["points_by"] == "truth"
        assert (row["coordinate_error"] is None) == (row["row"] == "original")
    # What leaves out the lens is measured against the map with it, where the images were taken through it.
    for row in rows[5:7]:
        assert row["coordinate_error"]["max"] > 5 and row["row_difference"]["mean"] > 0.1
    for row in rows[7:]:
        assert row["coordinate_error"]["max"] < 0.08 and row["row_difference"]["mean"] < 0.02
    for name, count in (("rendered_without_lens", 4), ("rendered_with_lens", 5)):
        picture = cv2.imread(str(tmp_path / f"{name}.png"))
        assert str(tmp_path / f"{name}.png") in out
        # Lines of the same colour through both images of every row.
        orange = (np.abs(picture.astype(int) - (0, 159, 230)).max(axis=2) < 60).sum(axis=1)
        assert np.count_nonzero(orange > 2 * figure5_drawing.IMAGE - 40) >= count * figure5_drawing.LINES


def test_pixels_unlike_the_models_are_an_exit_status(quick, script, monkeypatch, tmp_path):
    def broken(frame):
        frame = frame.copy()
        frame[10, 20] += 1
        return frame

    monkeypatch.setattr(
        figure5.Cores,
        "_compiled",
        lambda self, core: (
            Model(core, broken) if core.plan.datapath == "spline" and not core.plan.lens else Model(core)
        ),
    )
    pairs = figure5.pairs
    monkeypatch.setattr(figure5, "pairs", lambda *arguments: [next(pairs(*arguments))])
    status, _, err = script("--data", tmp_path / "missing", "--output", tmp_path)
    assert status == 1
    assert err.splitlines() == [
        f"rendered_without_lens: spline, {side} camera: 1 pixels are not the integer model's" for side in SIDES
    ]


def test_hardware_is_what_is_compared(rig, tmp_path):
    # The stand-in of the other tests against the engine itself.
    from sim.compiler import compile_core

    core = build(rectify(rig, lens=False)["left"], Options("proposed"), "rectify_left")
    source = np.random.default_rng(2).integers(0, 256, SIZE[::-1], np.uint8)
    compiled = compile_core(core.verilog, "rectify_left", cache=tmp_path)
    found = frame_through(core, compiled, 0.0, source)
    assert found.model_differences == 0
    assert np.array_equal(found.rectified, through_model(core, Model(core), 0.0, source).rectified)


def test_missing_reference_data_is_one_line(script, tmp_path):
    status, out, err = script("--rig", "EuRoC", "--data", tmp_path / "missing")
    assert (status, out) == (2, "")
    assert err.startswith("error: --data: ") and err.count("\n") == 1
