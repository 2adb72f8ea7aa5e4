"""The table of coordinate errors: the measure, by hand; the paper's claim; hardware that differs is noticed."""

import json
import math
import sys
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import rigs

from hdl import calibration, cli
from hdl.datapaths import DATAPATHS
from hdl.geometry.coordinates import Coordinates
from hdl.geometry.rectification import rectify
from scripts import coordinate_errors, readme, reference_rigs, table1, turned_cameras
from scripts.coordinate_errors import errors, ramp_core, unlike, verilog_coordinates

SMALL = 64, 48
# What 5 fraction bits and the word lengths of both sides may cost.
ROUNDING = 2 * (1 / 64 + 0.002)


@cache
def embedded_view(side="left", size=SMALL, lens=False):
    return rectify(calibration.embedded(size), lens=lens)[side]


def models_coordinates(core):
    """What unbroken hardware uses."""
    used = core.parameters.datapath.coordinates
    return tuple(
        np.clip(axis, 0, (size - 1) << used.fraction_bits)
        for axis, size in ((used.u, used.width), (used.v, used.height))
    )


_measured = {}


def remember(monkeypatch):
    """Measure a rig once for all tests that do not change what is measured."""
    measure = table1.measure

    def remembered(name, *arguments, **options):
        if name not in _measured:
            _measured[name] = measure(name, *arguments, **options)
        return _measured[name]

    monkeypatch.setattr(table1, "measure", remembered)


@pytest.fixture
def script(monkeypatch, capsys, tmp_path):
    """Runs table1 as the shell does, for a small embedded rig, two datapaths, hardware that need not be compiled, and a
    README of its own: (exit status, stdout, stderr)."""
    embedded = calibration.embedded
    page = tmp_path / "README.md"
    page.write_text("before\n<!-- table1:begin -->\n<!-- table1:end -->\nafter\n")
    monkeypatch.setattr(readme, "README", page)
    monkeypatch.setattr(calibration, "embedded", lambda size=SMALL: embedded(size))
    for name in [name for name in DATAPATHS if name not in ("conventional", "proposed")]:
        monkeypatch.delitem(DATAPATHS, name)
    monkeypatch.setattr(coordinate_errors, "verilog_coordinates", models_coordinates)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["table1", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.run(table1.table1)
        captured = capsys.readouterr()
        return ended.value.code, captured.out, captured.err

    return run


def test_rounded_measure_is_the_difference_of_whole_pixels():
    generator = np.random.default_rng(1)
    used, reference = (tuple(generator.integers(-200, 2200, (5, 7)) / 32 for _ in "uv") for _ in range(2))
    counted = generator.random((5, 7)) < 0.7
    found = errors(used, reference, counted)
    for axis, one, other in zip("uv", used, reference):
        pixels = [(a, b) for a, b, counts in zip(one.flat, other.flat, counted.flat) if counts]
        real = [abs(a - b) for a, b in pixels]
        whole = [abs(math.floor(a + 0.5) - math.floor(b + 0.5)) for a, b in pixels]
        assert found["real"][axis] == pytest.approx({"mean": sum(real) / len(real), "max": max(real)})
        assert found["rounded"][axis] == pytest.approx({"mean": sum(whole) / len(whole), "max": max(whole)})


def test_proposed_is_off_by_what_opencv_and_the_homography_say():
    rows, refusals = coordinate_errors.measure(
        "rig",
        calibration.embedded(SMALL),
        lenses=[False],
        datapaths=["proposed", "conventional"],
        verilog=False,
        progress=lambda step: None,
    )
    assert not refusals and [(row["side"], row["datapath"]) for row in rows] == [
        (side, name) for side in ("left", "right") for name in ("conventional", "proposed")
    ]
    for row in rows[1::2]:
        view = embedded_view(row["side"])
        # Not the project's own map: OpenCV's, without a lens, in float32.
        u, v = cv2.initUndistortRectifyMap(view.camera.K, None, view.R, view.P, SMALL, cv2.CV_32FC1)
        C = rigs.matrix(view)
        inside = (u >= 0) & (u <= SMALL[0] - 1) & (v >= 0) & (v <= SMALL[1] - 1)
        x, y = np.meshgrid(np.arange(SMALL[0]), np.arange(SMALL[1]))
        assert row["pixels"] == np.count_nonzero(inside)
        for axis, exact, (a, b, c) in zip("uv", (u, v), C):
            off = np.abs(a * x + b * y + c - exact)[inside]
            assert row["real"][axis]["mean"] == pytest.approx(off.mean(), abs=ROUNDING)
            assert row["real"][axis]["max"] == pytest.approx(off.max(), abs=ROUNDING)
            assert abs(row["rounded"][axis]["max"] - off.max()) < 1 + ROUNDING


def test_conventional_and_what_has_a_lens_are_measured_against_the_exact_map():
    rows, _ = coordinate_errors.measure(
        "rig",
        calibration.embedded(SMALL),
        lenses=[False, True],
        datapaths=["conventional", "accumulate", "proposed"],
        verilog=False,
        progress=lambda step: None,
    )
    left = {(row["datapath"], row["lens"]): row for row in rows if row["side"] == "left"}
    assert list(left) == [
        ("conventional", False), ("accumulate", False), ("proposed", False), ("conventional", True)
    ]  # fmt: skip
    for name, reference in zip(left, ("exact map", "conventional", "conventional", "exact map")):
        assert left[name]["reference"] == reference
    # Both divide, with the same word lengths: against the exact map it would be off by the rounding.
    assert all(axis == {"mean": 0, "max": 0} for axis in left["accumulate", False]["real"].values())
    for lens in (False, True):
        view = embedded_view(lens=lens)
        plan = DATAPATHS["conventional"].fit(view, 5).coordinates.error(*view.map(), view.source_size)
        assert left["conventional", lens]["real"] == {axis: plan[axis] for axis in "uv"}
        assert left["conventional", lens]["rounded"] == plan["rounded"]
        assert 0 < plan["u"]["max"] < ROUNDING


def test_turning_about_the_optical_axis_costs_nothing_and_about_the_others_ever_more():
    view = embedded_view(size=(160, 120))
    means = {
        axis: [
            turned_cameras.worst_mean(turned_cameras.approximation_error(turned_cameras.turned(view, axis, angle)))
            for angle in (0.0, 1.0, 2.0, 4.0, 8.0)
        ]
        for axis in "xyz"
    }
    assert means["z"] == [0.0] * 5 and turned_cameras.crossing(view, "z") is None
    for axis in "xy":
        assert means[axis] == sorted(set(means[axis])) and means[axis][0] == 0 and means[axis][-1] > 1


def test_z_changes_across_the_frame_as_the_angle_says():
    view, angle = embedded_view(), 3.0
    turned = turned_cameras.turned(view, "y", angle)
    assert coordinate_errors.turn(turned) == pytest.approx([0, angle, 0])
    u, v = turned.map()
    # The third column of the rotation about y is (sin, 0, cos).
    along = (np.arange(SMALL[0]) - view.P[0, 2]) / view.P[0, 0]
    z = math.cos(math.radians(angle)) + math.sin(math.radians(angle)) * along
    found = turned_cameras.approximation_error(turned)["real"]
    assert found["u"]["mean"] == pytest.approx(np.abs(u * (z - 1))[turned.inside].mean())
    assert found["v"]["max"] == pytest.approx(np.abs(v * (z - 1))[turned.inside].max())


@pytest.mark.parametrize("axis", ["x", "y"])
def test_bisection_finds_where_the_mean_crosses_the_limit(axis):
    view = embedded_view(size=(160, 120))
    angle = turned_cameras.crossing(view, axis)
    mean = [
        turned_cameras.worst_mean(turned_cameras.approximation_error(turned_cameras.turned(view, axis, at)))
        for at in (angle - 0.001, angle)
    ]
    assert mean[0] < 1.0 <= mean[1]


def test_full_size_embedded_rig_crosses_a_pixel_below_one_degree_and_the_claim_holds_for_it():
    view = embedded_view(size=(640, 480))
    assert turned_cameras.crossing(view, "x") == pytest.approx(0.80, abs=0.005)
    assert turned_cameras.crossing(view, "y") == pytest.approx(0.63, abs=0.005)
    assert turned_cameras.worst_mean(turned_cameras.approximation_error(view)) == pytest.approx(0.531, abs=0.002)


def test_distance_from_the_paper_is_the_mean_factor():
    def row(side, factors):
        return {
            "side": side,
            "rounded": {
                axis: {"mean": table1.PAPER[side][axis]["mean"] * factor} for axis, factor in zip("uv", factors)
            },
        }

    assert table1.distance([row("left", (1, 1)), row("right", (1, 1))]) == pytest.approx(1)
    assert table1.distance([row("left", (2, 0.5)), row("right", (2, 0.5))]) == pytest.approx(2)
    assert table1.distance([row("left", (16, 1)), row("right", (1, 1))]) == pytest.approx(2)


def test_ramps_through_the_exported_verilog_show_the_coordinates_and_those_of_broken_hardware(tmp_path):
    core = ramp_core(embedded_view(), "proposed")
    model = core.parameters.datapath.coordinates
    assert unlike(model, *verilog_coordinates(core, tmp_path)) == 0
    form = core.parameters.datapath.v_form
    start, one_more = (
        f"{form.format.width}'h{value % (1 << form.format.width):05x}"
        for value in (form.c, form.c + (1 << (form.fraction_bits - model.fraction_bits)))
    )
    assert start in core.verilog
    broken = replace(core, verilog=core.verilog.replace(start, one_more))
    found = verilog_coordinates(broken, tmp_path)
    assert np.array_equal(found[0], models_coordinates(core)[0])
    assert unlike(model, *found) > SMALL[0] * SMALL[1] / 2


def test_a_single_pixel_and_axis_that_differs_is_counted():
    generator = np.random.default_rng(3)
    model = Coordinates(
        *(generator.integers(-64, size << 5, (48, 64)).astype(np.int32) for size in (64, 48)), fraction_bits=5
    )
    u, v = np.clip(model.u, 0, 63 << 5), np.clip(model.v, 0, 47 << 5)
    assert unlike(model, u, v) == 0
    v[47, 63] += 1
    assert unlike(model, u, v) == 1
    u[3, 4] -= 1
    assert unlike(model, u, v) == 2


def test_rows_are_written_as_json(script, monkeypatch, tmp_path):
    remember(monkeypatch)
    status, out, err = script("--rig", "embedded", "--json", tmp_path / "rows.json")
    assert (status, err) == (0, "")
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert [(row["rig"], row["side"], row["datapath"], row["lens"]) for row in rows] == [
        ("embedded", side, name, lens)
        for lens, names in ((False, ("conventional", "proposed")), (True, ("conventional",)))
        for side in ("left", "right")
        for name in names
    ]
    for row in rows:
        for measure in ("real", "rounded"):
            assert list(row[measure]) == ["u", "v"]
            assert all(list(axis) == ["mean", "max"] for axis in row[measure].values())
        assert row["verilog_unlike"] == 0
    assert "0.4465, 0.2255" in out and "0.5028, 0.2880" in out
    assert f"The exported Verilog of 6 cores uses the integer models' coordinates at all {64 * 48} pixels." in out


def test_hardware_with_other_coordinates_is_an_exit_status_and_no_readme(script, monkeypatch):
    def wrong(core):
        u, v = (axis.copy() for axis in models_coordinates(core))
        v[0, 0] += core.parameters.datapath.name == "proposed" and core.plan.camera.side == "right"
        return u, v

    monkeypatch.setattr(coordinate_errors, "verilog_coordinates", wrong)
    before = readme.README.read_text()
    status, out, err = script("--readme")
    assert status == 1
    assert err == "proposed, right camera: the Verilog's coordinates are not the integer model's at 1 pixels\n"
    assert "The exported Verilog of" not in out
    assert readme.README.read_text() == before


def test_stale_readme_is_an_exit_status_and_is_renewed(script, monkeypatch):
    remember(monkeypatch)
    status, _, err = script("--check")
    assert (status, err) == (1, "README.md: the table of coordinate errors is stale; `make readme` renews it\n")
    assert script("--readme")[0] == 0
    text = readme.README.read_text()
    assert text.startswith("before\n<!-- table1:begin -->\n| coordinates |") and text.endswith("-->\nafter\n")
    assert "| proposed, the paper's | 0.4465, 0.2255 | 2, 2 | 0.5028, 0.2880 | 3, 2 | ? |" in text
    assert script("--check")[0] == 0
    readme.README.write_text(text.replace("0.4465", "0.4765"))
    assert script("--check")[0] == 1


@pytest.mark.parametrize("arguments, problem", [
    (("--rig", "EuRoC", "--data", "missing"), "error: --data: missing: no folder of reference rigs"),
    (("--rig", "EuRoC", "--readme"), "error: the README's table is of the embedded rig"),
])  # fmt: skip
def test_what_cannot_be_measured_is_one_line(script, arguments, problem):
    status, out, err = script(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith(problem) and err.count("\n") == 1


def test_without_the_reference_rigs_the_embedded_one_is_measured(script, monkeypatch, tmp_path):
    remember(monkeypatch)
    status, out, _ = script("--data", tmp_path / "missing")
    assert status == 0
    assert "The reference rigs were left out." in out
    assert "Means below 1 px in both images: 1 of 1: embedded." in out


@pytest.mark.skipif(not reference_rigs.FOLDER.is_dir(), reason="the reference data, ../shared/data, is not here")
def test_reference_rigs_whose_cameras_stand_worse_break_the_claim(script, monkeypatch, tmp_path):
    remember(monkeypatch)
    chosen = {name: reference_rigs.CALIBRATIONS[name] for name in ("Bouguet's example", "PS4 Eye")}
    monkeypatch.setattr(reference_rigs, "CALIBRATIONS", chosen)
    status, out, _ = script("--json", tmp_path / "rows.json")
    assert status == 0
    rows = {
        (row["rig"], row["side"]): row
        for row in json.loads((tmp_path / "rows.json").read_text())
        if row["datapath"] == "proposed"
    }
    assert len(rows) == 6 and rows["PS4 Eye", "left"]["verilog_unlike"] is None
    for side in ("left", "right"):
        assert table1.holds(rows["Bouguet's example", side])
        assert not table1.holds(rows["PS4 Eye", side]) and abs(rows["PS4 Eye", side]["rotation"]["y"]) > 2
    assert "Means below 1 px in both images: 2 of 3: embedded; Bouguet's example." in out
    assert "Means NOT below 1 px in both images: 1 of 3: PS4 Eye." in out
    assert "Nearest to the paper: Bouguet's example, whose four means" in out
