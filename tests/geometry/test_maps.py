"""Small whole cores for maps of all kinds."""

from dataclasses import replace
from itertools import pairwise

import pytest
import rigs
from cores import HEIGHT, check, parameters, random_map

from hdl.datapaths import DATAPATHS
from hdl.geometry.coordinates import Border, Window
from hdl.stream.rectifier import RectifierParameters
from sim.drivers import never, pauses


@pytest.mark.parametrize("border", [Border("constant", 201), Border("replicate")], ids=lambda border: border.mode)
@pytest.mark.parametrize("rig", rigs.NAMES)
def test_every_kind_of_map(rig, border):
    side = "left" if border.mode == "constant" else "right"
    check(parameters(view=rigs.view(rig, side, 19, 16), border=border), 2, never(), pauses(0.4, 3, burst=30))


@pytest.mark.parametrize("d_lo, d_hi", [(-2, 3), (-3, 1), (-5, -3), (4, 6)])
@pytest.mark.parametrize("latency", [0, 14])
@pytest.mark.parametrize("idle, backpressure", [(0.0, 0.6), (0.6, 0.0)])
def test_any_map_within_its_window(d_lo, d_hi, latency, idle, backpressure):
    p = RectifierParameters(random_map(17, 12, d_lo, d_hi, latency))
    assert p.line_buffer.window == Window(d_lo, d_hi)
    burst = 34 if backpressure else 3
    check(p, 3, pauses(idle, 1, burst), pauses(backpressure, 2, burst))


def narrowest():
    """The core of the narrowest frame that `conventional` takes, and its datapath for a pixel less."""
    datapaths = [DATAPATHS["conventional"].fit(rigs.view("rolled", "left", width, 12), 5) for width in range(9, 30)]
    for narrower, datapath in pairwise(datapaths):
        if datapath.width > datapath.latency + 2:
            return RectifierParameters(datapath), narrower


def test_a_row_may_be_little_longer_than_the_pipeline():
    p, _ = narrowest()
    assert p.datapath.width == p.datapath.latency + 3
    check(p, 4, never(), pauses(0.5, 1, burst=2 * p.datapath.width))
    check(p, 4, pauses(0.3, 2, burst=5), pauses(0.3, 3, burst=5))


def test_a_row_shorter_than_the_pipeline_is_refused():
    _, datapath = narrowest()
    with pytest.raises(ValueError) as caught:
        RectifierParameters(datapath)
    assert str(caught.value) == f"a row of {datapath.width} px is shorter than the pipeline"


def lowered(rows):
    """A core whose map looks down by ``rows`` at its farthest, of `HEIGHT` rows."""
    p = parameters(view=rigs.view("looks_down"))
    form = p.datapath.v_form
    down = rows - p.line_buffer.window.d_hi
    return RectifierParameters(replace(p.datapath, v_form=replace(form, c=form.c + (down << form.fraction_bits))))


def test_a_map_may_look_down_by_nearly_a_frame():
    p = lowered(HEIGHT - 2)
    assert p.line_buffer.window.lead == HEIGHT - 2
    sent, _ = check(p, 3, never(), never())
    assert sent[-1] - sent[0] == len(sent) - 1
    check(p, 3, pauses(0.3, 1), pauses(0.5, 2, burst=20))


def test_a_map_that_looks_down_by_more_is_refused():
    p = lowered(HEIGHT - 1)
    with pytest.raises(ValueError) as caught:
        _ = p.line_buffer
    assert str(caught.value) == "output row 0 needs 18 source rows: more than a frame of 18 rows allows"
