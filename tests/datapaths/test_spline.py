"""Splines: their cells, their integer model against a step-by-step one, their fit, and the core for any width."""

import numpy as np
import pytest
from datapath_runs import assert_same, run

from hdl import calibration
from hdl.arithmetic.cuts import BALANCED, PIPELINES
from hdl.datapaths.base import fitted_budget
from hdl.datapaths.spline import Spline, Surface
from hdl.datapaths.spline_fit import LEAST_CELL, Cells, Fit
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from hdl.stream.rectifier import Rectifier, RectifierParameters
from hdl.tools.verilog import convert
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core
from sim.drivers import never, pauses
from sim.remap import cv2_remap


def view(size, lens=True, side="left"):
    return rectify(calibration.embedded(size), lens=lens)[side]


def inside(view):
    u, v = view.map()
    return (u >= 0) & (u <= view.width - 1) & (v >= 0) & (v <= view.height - 1)


@pytest.mark.parametrize("cell_height, slope_rows", [(8, 4), (32, 8), (64, 32)])
def test_a_row_depends_on_three_controls_that_sum_to_the_scale(cell_height, slope_rows):
    cells = Cells(64, 200, 8, cell_height, slope_rows)
    assert (cells.basis.sum(axis=1) == cells.scale).all()
    for y, weights in enumerate(cells.basis):
        used = np.flatnonzero(weights)
        assert used.min() >= y // cell_height and used.max() <= y // cell_height + 2


@pytest.mark.parametrize("width", range(64, 81))
def test_cells_cover_the_row_and_leave_time_to_load(width):
    cells = Cells(width, 48, 16, 16, 4)
    cell, distance = cells.place
    assert cell[0] == 0 and cell[-1] == cells.columns - 1 and distance[-1] == cells.cell_width - 1
    assert np.bincount(cell).min() >= LEAST_CELL
    positions = cell * cells.cell_width + distance
    assert (np.diff(positions) == 1).all()


def carried_along(surface):
    """The surface's values by nothing but the additions that the hardware makes."""
    cells = surface.cells
    words = [[int(part[0, column]) for part in surface.words] for column in range(cells.columns + 1)]
    rows = []
    for y in range(cells.height):
        unit = surface.word_bits + surface.start_bits - surface.value_bits
        value, remainder, row, cell_before, increment = (
            words[-1][0] >> unit,
            (1 << surface.carry_bits) >> 1,
            [],
            None,
            0,
        )
        for cell in cells.place[0]:
            if cell != cell_before:
                total = words[cell][0] + remainder
                increment, remainder = total >> surface.carry_bits, total % (1 << surface.carry_bits)
                cell_before = cell
            row.append(value)
            value += increment
        rows.append(row)
        for column, word in enumerate(words):
            word[0] += word[1]
            if y % cells.slope_rows == cells.slope_rows - 1:
                word[1] += int(surface.bends[y // cells.cell_height, column])
    return np.array(rows)


@pytest.mark.parametrize("width", [64, 65, 70, 79])
@pytest.mark.parametrize("node_bits, increment_bits", [(5, 5), (6, 7)])
def test_the_closed_form_is_what_the_additions_give(width, node_bits, increment_bits):
    rng = np.random.default_rng(width)
    cells = Cells(width, 37, 16, 16, 4)
    nodes = np.cumsum(rng.integers(0, 40 << node_bits, (cells.columns + 1, cells.rows + 2)), axis=0)
    surface = Surface(cells, node_bits, increment_bits, 5, nodes)
    np.testing.assert_array_equal(surface.values(), carried_along(surface))


def test_the_fit_is_closer_in_the_maximum_than_least_squares():
    exact = view((640, 480))
    cells = Cells(640, 480, 16, 64, 16)
    target = exact.map()[0]

    class LeastSquares(Fit):
        STEPS = 1

    assert Fit(cells, target, inside(exact)).error < 0.9 * LeastSquares(cells, target, inside(exact)).error


@pytest.mark.parametrize("lens", [False, True])
@pytest.mark.parametrize("budget, fraction_bits", [(None, 5), (0.1, 5), (0.03, 6)])
def test_every_pixel_inside_is_within_the_budget(lens, budget, fraction_bits):
    exact = view((320, 240), lens)
    spline = Spline.fit(exact, fraction_bits, budget)
    counts = inside(exact)
    for used, axis in zip((spline.coordinates.u, spline.coordinates.v), exact.map()):
        error = np.abs(used * 2.0**-fraction_bits - axis)[counts].max()
        assert error <= (fitted_budget(fraction_bits) if budget is None else budget)


def test_words_cover_every_row_and_fit_their_formats():
    spline = Spline.fit(view((320, 240)), 5)
    for surface in spline.surfaces:
        for words, q in zip(
            (*surface.words, surface.bends), (spline.value_format, spline.slope_format, spline.bend_format)
        ):
            low, high = (-(1 << (q.width - 1)), (1 << (q.width - 1)) - 1) if q.is_signed else (0, (1 << q.width) - 1)
            assert low <= words.min() and words.max() <= high


def random_spline(width, pipeline):
    """Of small cells, with nodes from everywhere."""
    cells = Cells(width, 19, 8, 8, 2)
    nodes = np.random.default_rng(width).integers(0, 40 << 6, (2, cells.columns + 1, cells.rows + 2))
    u, v = (Surface(cells, 6, 7, 5, axis) for axis in nodes)
    return Spline(width, 19, 5, u, v, pipeline=pipeline)


pipelines = pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)


@pipelines
@pytest.mark.parametrize("width, offset", [(24, 0), (31, 1), (22, 2), (17, -1), (37, -5)])
def test_hardware_computes_the_integer_model_under_pauses(width, offset, pipeline):
    spline = random_spline(width, pipeline)
    assert spline.u_surface.cells.offset == offset
    assert_same(run(spline, 2, pauses(0.3, seed=1, burst=3), pauses(0.4, seed=2, burst=4)), spline)


@pipelines
def test_hardware_takes_a_position_in_every_clock(pipeline):
    spline = random_spline(19, pipeline)
    assert spline.u_surface.cells.offset < 0
    assert_same(run(spline, 3, never(), never()), spline)


@pytest.mark.parametrize(
    "size, pipeline",
    list(zip([(64, 48), (97, 50), (130, 61), (67, 40)], [*PIPELINES.values(), BALANCED])),
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_the_core_is_right_for_any_width_and_after_a_reset(size, pipeline):
    exact = view(size, lens=False)
    spline = Spline.fit(exact, 5, 0.2).with_pipeline(pipeline)
    core = compile_core(convert(Rectifier(RectifierParameters(spline)), "t"), "t")
    frames = np.random.default_rng(1).integers(0, 256, (3, size[1], size[0]), np.uint8)
    expected = [cv2_remap(frame, spline.coordinates.u, spline.coordinates.v) for frame in frames]
    beats = core.run(to_beats(frames), idle=0.2, backpressure=0.3, seed=3).beats
    np.testing.assert_array_equal(to_frames(beats, *size), expected)
    core.run(to_beats(frames)[: size[0] * size[1] * 3 // 2], expected=0, check=False)
    beats = core.run(to_beats(frames), start="reset").beats
    np.testing.assert_array_equal(to_frames(beats, *size), expected)


def test_a_budget_out_of_reach_is_said():
    with pytest.raises(
        InputError, match=r"^--max-error: 0\.01: rounding to 5 fraction bits alone costs up to 0\.015625 px"
    ):
        Spline.fit(view((64, 48)), 5, 0.01)
    with pytest.raises(InputError, match=r"^--max-error: 0\.017: .*reaches 0\.\d+ px and no less"):
        Spline.fit(view((64, 48)), 5, 0.017)
