"""Whole frames through the exported Verilog, bit for bit."""

from functools import cache

import numpy as np
import pytest

from hdl import calibration
from hdl.coordinates import Border
from hdl.core import Options, build
from hdl.datapaths import DATAPATHS
from hdl.rectification import rectify
from sim.beats import to_beats, to_frames
from sim.engine import compile_core
from sim.remap import cv2_remap, remap

VGA = (640, 480)


@cache
def view(side="left", size=VGA, alpha=0.0):
    return rectify(calibration.embedded().scaled(*size), alpha=alpha, lens=False)[side]


@cache
def core(options=Options(), side="left", size=VGA, alpha=0.0):
    return build(view(side, size, alpha), options, "rectify")


def frames_for(core, count, seed=0):
    plan = core.plan
    shape = (count, plan.height, plan.width) + ((3,) if plan.channels == 3 else ())
    dtype = np.uint8 if plan.pixel_bits == 8 else np.uint16
    return np.random.default_rng(seed).integers(0, 2**plan.pixel_bits, shape, dtype)


def stream_of(frames, plan):
    return to_beats(frames, channels=plan.channels, pixel_bits=plan.pixel_bits)


def model(core, frame):
    coordinates, border = core.parameters.datapath.coordinates, core.plan.border
    return remap(frame, coordinates.u, coordinates.v, core.plan.fraction_bits, border.mode, border.value)


def opencv(core, frame):
    coordinates, border = core.parameters.datapath.coordinates, core.plan.border
    return cv2_remap(frame, coordinates.u, coordinates.v, border.mode, border.value)


def run(core, frames, expected, **pauses):
    """The stream of ``frames`` through the core, which must give out ``expected`` of each."""
    plan = core.plan
    stream = compile_core(core.verilog, plan.top).run(stream_of(frames, plan), **pauses)
    out = to_frames(stream.beats, plan.width, plan.height, channels=plan.channels, pixel_bits=plan.pixel_bits)
    for frame, rectified in zip(frames, out, strict=True):
        np.testing.assert_array_equal(rectified, expected(core, frame))
    return stream


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("datapath", DATAPATHS)
def test_every_pixel_is_that_of_cv2_remap(datapath, side):
    built = core(Options(datapath=datapath), side)
    run(built, frames_for(built, 2), opencv)


@pytest.mark.parametrize("border", [Border("constant", 201), Border("replicate")], ids=str)
@pytest.mark.parametrize("channels", [1, 3])
def test_borders_and_colour_are_those_of_cv2_remap(border, channels):
    # alpha 1 shows all of the source, so the map leaves it on every side.
    built = core(Options(datapath="accumulate", border=border, channels=channels), alpha=1.0)
    low, high = built.parameters.datapath.coordinates.u_range
    assert low < 0 and high > (VGA[0] - 1) << 5
    run(built, frames_for(built, 2), opencv)


@pytest.mark.parametrize("pixel_bits, fraction_bits", [(10, 5), (12, 3), (16, 8), (8, 6)])
def test_other_widths_are_those_of_the_integer_formula(pixel_bits, fraction_bits):
    built = core(Options(pixel_bits=pixel_bits, fraction_bits=fraction_bits))
    run(built, frames_for(built, 2), model)


@pytest.mark.parametrize("size", [(64, 48), (321, 241), (512, 384), (1000, 70)])
def test_any_frame_size(size):
    built = core(Options(datapath="conventional"), "right", size)
    run(built, frames_for(built, 3), opencv, idle=0.2, backpressure=0.3, seed=1)


@pytest.mark.parametrize("datapath", DATAPATHS)
@pytest.mark.parametrize("idle, backpressure, burst", [
    (0.0, 0.0, None), (0.5, 0.0, None), (0.0, 0.5, None), (0.4, 0.4, None), (0.3, 0.6, 900), (0.7, 0.1, 2000),
])
def test_pauses_change_nothing_but_the_time(datapath, idle, backpressure, burst):
    built = core(Options(datapath=datapath), "left", (320, 240))
    stream = run(built, frames_for(built, 3), opencv, idle=idle, backpressure=backpressure, burst=burst, seed=7)
    if not backpressure:
        assert stream.stall_cycles == 0


@pytest.mark.parametrize("datapath", DATAPATHS)
def test_frames_without_blanking_never_stall_the_input(datapath):
    built = core(Options(datapath=datapath), "right")
    frames = frames_for(built, 3)
    stream = run(built, frames, opencv)
    assert stream.not_ready_cycles == 0
    # One beat in each clock on the way in, one on the way out.
    assert stream.sent["cycle"][-1] - stream.sent["cycle"][0] == frames.size - 1
    assert stream.beats["cycle"][VGA[0] * VGA[1]] - stream.beats["cycle"][0] == VGA[0] * VGA[1]


@pytest.mark.parametrize("datapath", DATAPATHS)
@pytest.mark.parametrize("side", ["left", "right"])
def test_latency_is_the_plans(datapath, side):
    built = core(Options(datapath=datapath), side)
    stream = run(built, frames_for(built, 1), opencv)
    assert stream.beats["cycle"][0] - stream.sent["cycle"][0] == built.plan.latency_cycles


def test_a_frame_after_reset_in_mid_frame_is_whole():
    built = core()
    compiled = compile_core(built.verilog, built.plan.top)
    frames = frames_for(built, 2)
    half = stream_of(frames[:1], built.plan)[: VGA[0] * 200 + 17]
    compiled.run(half, expected=0, check=False)
    stream = compiled.run(stream_of(frames[1:], built.plan), start="reset")
    (rectified,) = to_frames(stream.beats, *VGA)
    np.testing.assert_array_equal(rectified, opencv(built, frames[1]))
