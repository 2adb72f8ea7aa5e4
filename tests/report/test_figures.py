"""The report: its figures against the plan and the models, the page it makes of them, and what it refuses."""

import base64
import itertools
import json
from dataclasses import astuple, replace

import cv2
import linters
import numpy as np
import pytest
import rigs
from report_pages import write_cores

from hdl import calibration
from hdl.core.build import Options, build
from hdl.core.plan_file import load_folder
from hdl.geometry.coordinates import Border
from hdl.geometry.rectification import rectify
from hdl.report import figures, stereo, wiring
from hdl.report.measure import jpeg
from sim.alignment import rectified_positions


def test_the_figures_are_those_of_the_plan(report):
    found = json.loads(json.dumps(report.figures()))
    for side, camera in found["cameras"].items():
        plan = report.cameras[side].plan
        assert camera["plan"] == plan.model_dump()
        for axis in "uv":
            assert camera["largest_error"][axis]["value"] == getattr(plan.error, axis).max
        low, high = camera["line_buffer"]["least_offset"], camera["line_buffer"]["greatest_offset"]
        assert len(low) == len(high) == plan.height
        assert min(row for row in low if row is not None) == plan.line_buffer.d_lo
        assert max(row for row in high if row is not None) == plan.line_buffer.d_hi
        assert camera["pixels_different_from_model"] == camera["pixels_different_from_cv2_remap"] == 0
        assert camera["resources"]["ramb18"] == 3
        assert [entry["datapath"] for entry in camera["considered"]] == [entry.datapath for entry in plan.considered]
    assert found["row_difference"]["after"]["mean"] < 0.05 < 0.5 < found["row_difference"]["before"]["mean"]
    assert found["stereo"]["baseline"] == pytest.approx(np.linalg.norm(calibration.embedded().T))


@pytest.mark.parametrize("border", ["constant", "replicate"])
@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_the_rows_that_are_needed_are_those_of_the_window(tmp_path, border, alpha):
    write_cores(tmp_path, Options("proposed", border=Border(border)), sides=["left"], lens=False, alpha=alpha)
    core = load_folder(tmp_path)["left"].rebuild()
    coordinates, window = core.parameters.datapath.coordinates, core.parameters.line_buffer.window
    low, high = figures.row_needs(coordinates, core.parameters.border)
    assert (np.nanmin(low), np.nanmax(high)) == (window.d_lo, window.d_hi)
    for y in (0, 31, 63):
        taps = [
            row
            for u, v in zip(coordinates.u[y] >> 5, coordinates.v[y] >> 5)
            for row in (v, v + 1)
            if border == "replicate" or -1 <= u <= 95 and 0 <= row <= 63
        ]
        taps = [min(max(row, 0), 63) - y for row in taps]
        assert (low[y], high[y]) == ((min(taps), max(taps)) if taps else (pytest.approx(np.nan, nan_ok=True),) * 2)


def test_the_error_map_has_its_largest_value_where_it_is_said_to_be(report):
    camera = report.cameras["right"]
    for axis, error in camera.errors.items():
        peak = camera.peaks[axis]
        used = getattr(camera.core.parameters.datapath.coordinates, axis)[peak.y, peak.x] / 32
        exact = camera.core.exact["uv".index(axis)][peak.y, peak.x]
        assert abs(used - exact) == peak.value == np.nanmax(np.abs(error))
        assert np.count_nonzero(np.isfinite(error)) == camera.plan.error.pixels


@pytest.mark.parametrize("name", ["samples", "rolled"])
def test_displacements_are_how_far_the_rectified_image_is_off(name):
    core = build(rigs.view(name, "left", 96, 64), Options("proposed", fraction_bits=8), "rectify")
    found = stereo.displacement(core, figures.coordinate_errors(core))
    at = np.array(list(itertools.product(range(10, 90, 8), range(10, 56, 8))))
    sources = np.array([[axis[y, x] for axis in core.exact] for x, y in at])
    coordinates = core.parameters.datapath.coordinates
    shown = rectified_positions(coordinates.u / 256, coordinates.v / 256, sources)
    kept = np.isfinite(shown).all(axis=1)
    expected = -np.array([[axis[y, x] for axis in found] for x, y in at])
    assert kept.sum() > 40 and np.abs(expected).max() > 0.1
    np.testing.assert_allclose((shown - at)[kept], expected[kept], atol=1 / 128)


def test_depth_errors_follow_from_the_disparitys():
    views = rectify(calibration.embedded((96, 64)), lens=False)
    focal, baseline, _ = stereo.geometry(views["left"], views["right"])
    x = np.broadcast_to(np.arange(96.0), (64, 96))
    still = np.zeros((64, 96))
    distance = focal * baseline / 10
    (found,) = stereo.at_distances(views, {"left": (x / 1000, still), "right": (still, still + 0.02)}, [distance])
    counted = x[0, 10:] / 1000
    assert found.disparity == pytest.approx(10)
    assert found.share == pytest.approx(86 / 96)
    assert (found.disparity_mean, found.disparity_max) == pytest.approx((counted.mean(), counted.max()))
    assert found.depth_max == pytest.approx(distance / 10 * 0.095)
    assert found.depth_mean == pytest.approx(distance / 10 * counted.mean())
    assert (found.row_mean, found.row_max) == pytest.approx((0.02, 0.02))


def test_a_match_is_looked_up_at_its_disparity():
    views = rectify(calibration.embedded((96, 64)), lens=False)
    focal, baseline, _ = stereo.geometry(views["left"], views["right"])
    shift = np.broadcast_to(np.arange(96.0) ** 2, (64, 96))
    right = np.broadcast_to((np.arange(96.0) + 7) ** 2, (64, 96))
    still = np.zeros((64, 96))
    (found,) = stereo.at_distances(views, {"left": (shift, still), "right": (right, still)}, [focal * baseline / 7])
    assert found.disparity_max == 0


def test_one_above_the_other_columns_take_the_place_of_rows():
    beside = rectify(calibration.embedded((96, 64)), lens=False)
    exchange = np.eye(3)[[1, 0, 2]]
    above = {
        side: replace(view, P=exchange @ view.P @ np.eye(4)[[1, 0, 2, 3]], width=64, height=96, aligned="columns")
        for side, view in beside.items()
    }
    generator = np.random.default_rng(2)
    shifts = {side: tuple(generator.normal(0, 0.02, (2, 64, 96))) for side in beside}
    turned = {side: (dy.T, dx.T) for side, (dx, dy) in shifts.items()}
    assert stereo.geometry(*above.values()) == stereo.geometry(*beside.values())
    for found, expected in zip(stereo.at_distances(above, turned, None), stereo.at_distances(beside, shifts, None)):
        assert astuple(found) == pytest.approx(astuple(expected))


def test_default_distances_lie_between_the_disparities_that_are_named():
    found = stereo.default_distances(500.0, 0.1, 640)
    assert found == pytest.approx([0.5, 1, 2, 5, 10, 20])


def test_timing_follows_the_clock(report):
    core = report.cameras["left"].core
    at_100, at_200 = figures.timing(core, 100.0), figures.timing(core, 200.0)
    assert at_100["latency_lines"] == core.plan.latency_cycles / 96
    assert at_100["latency_us"] == core.plan.latency_cycles / 100 == 2 * at_200["latency_us"]
    assert at_100["frames_per_second"] == pytest.approx(1e8 / (96 * 64)) == at_200["frames_per_second"] / 2


def test_a_datapath_chosen_by_name_is_shown_among_the_others(tmp_path):
    write_cores(tmp_path, Options("proposed"), sides=["left"], lens=False)
    (planned,) = load_folder(tmp_path).values()
    core = planned.rebuild()
    ladder = figures.ladder(planned, core)
    assert (ladder.entries[0].name, ladder.entries[0].verdict) == ("proposed", "chosen by name")
    assert ladder.entries[0].error == max(core.plan.error.u.max, core.plan.error.v.max)
    assert ladder.entries[0].cost == core.parameters.datapath.cost
    names = [entry.name for entry in ladder.entries]
    assert len(names) == len(set(names)) and {"conventional", "accumulate"} <= set(names)
    assert any("more than the 0.05 px" in text for text in figures.warnings(core.plan))
    assert any(text.startswith("The left core leaves the lens out") for text in figures.warnings(core.plan))


@pytest.mark.parametrize("options", [Options("proposed", channels=3), Options("proposed", pixel_bits=12)])
def test_the_wiring_example_is_accepted_with_the_cores(tmp_path, options):
    write_cores(tmp_path, options, lens=False)
    (tmp_path / "example.v").write_text(wiring.example(load_folder(tmp_path)))
    files = ["example.v", "rectify_left.v", "rectify_right.v", "-Wno-DECLFILENAME", "-Wno-UNUSED"]
    for verilator in linters.VERILATORS.values():
        assert linters.warnings([*verilator, "--top-module", wiring.NAME, *files], tmp_path) == []
    bits = {1: 16, 3: 24}[options.channels]
    assert f"input wire [{bits - 1}:0] left_camera_tdata" in (tmp_path / "example.v").read_text()


@pytest.mark.parametrize("shape, bits", [((48, 64), 8), ((48, 64), 12), ((480, 2000), 16), ((48, 64, 3), 8)])
def test_pictures_keep_gray_and_colour_and_shrink_to_fit(shape, bits):
    image = np.full(shape, 100 << (bits - 8), np.uint8 if bits == 8 else np.uint16)
    if len(shape) == 3:
        image[..., 2] = 200
    uri = jpeg(image, bits)
    assert uri.startswith("data:image/jpeg;base64,")
    decoded = cv2.imdecode(np.frombuffer(base64.b64decode(uri.split(",")[1]), np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded.shape[:2] == ((240, 1000) if shape[1] == 2000 else (48, 64))
    np.testing.assert_allclose(decoded[20, 20], [100, 100, 200] if len(shape) == 3 else 100, atol=3)
