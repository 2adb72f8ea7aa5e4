"""Small whole cores for maps of all kinds."""

from dataclasses import replace
from itertools import pairwise

import pytest
import rigs
from cores import HEIGHT, check, parameters, random_map

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST, PIPELINES
from hdl.geometry.coordinates import Border, Window
from hdl.stream.raster import NEAR
from hdl.stream.rectifier import RectifierParameters
from sim.drivers import never, pauses


@pytest.mark.parametrize("border", [Border("constant", 201), Border("replicate")], ids=lambda border: border.mode)
@pytest.mark.parametrize("rig", rigs.NAMES)
def test_every_kind_of_map(rig, border):
    side, pipeline = ("left", BALANCED) if border.mode == "constant" else ("right", FAST)
    p = parameters(view=rigs.view(rig, side, 19, 16), pipeline=pipeline, border=border)
    check(p, 2, never(), pauses(0.4, 3, burst=30))


def longest(pipeline):
    """The longest latency of a datapath for rows of 17 px."""
    for latency in range(17):
        try:
            _ = RectifierParameters(random_map(17, 12, 0, 1, latency, pipeline)).line_buffer
        except ValueError:
            return latency - 1


@pytest.mark.parametrize("d_lo, d_hi", [(-2, 3), (-3, 1), (-5, -3), (4, 6)])
@pytest.mark.parametrize(
    "pipeline, waits, idle, backpressure",
    [
        *((pipeline, "as much as a row hides", 0.0, 0.6) for pipeline in PIPELINES.values()),
        (BALANCED, "no latency", 0.0, 0.6),
        (BALANCED, "as much as a row hides", 0.6, 0.0),
        (COMPACT, "no latency", 0.6, 0.0),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_any_map_within_its_window(d_lo, d_hi, waits, idle, backpressure, pipeline):
    latency = 0 if waits == "no latency" else longest(pipeline)
    p = RectifierParameters(random_map(17, 12, d_lo, d_hi, latency, pipeline))
    assert p.line_buffer.window == Window(d_lo, d_hi)
    burst = 34 if backpressure else 3
    check(p, 3, pauses(idle, 1, burst), pauses(backpressure, 2, burst))


def narrowest(pipeline):
    """The core of the narrowest frame that `conventional` takes, and that of a pixel less."""
    cores = [
        parameters("conventional", rigs.view("rolled", "left", width, 12), pipeline=pipeline) for width in range(9, 34)
    ]
    for narrower, core in pairwise(cores):
        # What lies between: the datapath, the place in the ring, the addresses, the memories; the row counts early.
        latency = core.datapath.latency + 1 + pipeline.address + 1 + pipeline.blocks + NEAR * pipeline.ahead
        if core.datapath.width > latency:
            return core, narrower


pipelines = pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)


@pipelines
def test_a_row_may_be_little_longer_than_the_pipeline(pipeline):
    p, _ = narrowest(pipeline)
    check(p, 4, never(), pauses(0.5, 1, burst=2 * p.datapath.width))
    check(p, 4, pauses(0.3, 2, burst=5), pauses(0.3, 3, burst=5))


@pipelines
def test_a_row_shorter_than_the_pipeline_is_refused(pipeline):
    _, p = narrowest(pipeline)
    with pytest.raises(ValueError) as caught:
        _ = p.line_buffer
    assert str(caught.value) == f"a row of {p.datapath.width} px is shorter than the pipeline"


def lowered(rows, pipeline=BALANCED):
    """A core whose map looks down by ``rows`` at its farthest, of `HEIGHT` rows."""
    p = parameters(view=rigs.view("looks_down"), pipeline=pipeline)
    form = p.datapath.v_form
    down = rows - p.line_buffer.window.d_hi
    return RectifierParameters(replace(p.datapath, v_form=replace(form, c=form.c + (down << form.fraction_bits))))


@pytest.mark.parametrize("pipeline", [COMPACT, BALANCED], ids=lambda pipeline: pipeline.name)
def test_a_map_may_look_down_by_nearly_a_frame(pipeline):
    p = lowered(HEIGHT - 2, pipeline)
    assert p.line_buffer.window.lead == HEIGHT - 2
    sent, _ = check(p, 3, never(), never())
    assert sent[-1] - sent[0] == len(sent) - 1
    check(p, 3, pauses(0.3, 1), pauses(0.5, 2, burst=20))


def test_a_map_that_looks_down_by_more_is_refused():
    p = lowered(HEIGHT - 1)
    with pytest.raises(ValueError) as caught:
        _ = p.line_buffer
    assert str(caught.value) == "output row 0 needs 18 source rows: more than a frame of 18 rows allows"
