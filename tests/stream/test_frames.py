"""Whole frames through the exported Verilog, bit for bit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hdl import calibration
from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.geometry.coordinates import Border
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.stream.rectifier import Rectifier
from hdl.tools import verilog
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core
from sim.remap import cv2_remap, remap

VGA = (640, 480)
SMALL = (160, 120)


def named(value):
    return getattr(value, "name", str(value))


def largest(datapath):
    """The frame size at which a datapath is run here: VGA, but for tables, which take compilers long."""
    return (64, 48) if datapath == "table" else VGA


@cache
def view(side="left", size=VGA, alpha=0.0, lens=False):
    return rectify(calibration.embedded(size), RectificationOptions(alpha=alpha), lens=lens)[side]


@cache
def built(options, *geometry):
    return build(view(*geometry), options, "rectify")


@cache
def core(options=Options("proposed"), side="left", size=VGA, alpha=0.0, lens=False, pipeline=BALANCED):
    """A core with the registers of ``pipeline``."""
    core = built(options, side, size, alpha, lens)
    parameters = replace(core.parameters, datapath=core.parameters.datapath.with_pipeline(pipeline))
    return replace(
        core,
        parameters=parameters,
        verilog=verilog.convert(Rectifier(parameters), "rectify"),
        plan=core.plan.model_copy(update={"latency_cycles": parameters.latency_cycles}),
    )


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


def output(core, frames, **pauses):
    """The stream of ``frames`` through the core, and the frames that it gave out."""
    plan = core.plan
    stream = compile_core(core.verilog, plan.top).run(stream_of(frames, plan), **pauses)
    return stream, to_frames(stream.beats, plan.width, plan.height, channels=plan.channels, pixel_bits=plan.pixel_bits)


def run(core, frames, expected, **pauses):
    """The stream of ``frames`` through the core, which must give out ``expected`` of each."""
    stream, out = output(core, frames, **pauses)
    for frame, rectified in zip(frames, out, strict=True):
        np.testing.assert_array_equal(rectified, expected(core, frame))
    return stream


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("datapath", DATAPATHS)
def test_every_pixel_is_that_of_cv2_remap(datapath, side):
    built = core(Options(datapath=datapath), side, largest(datapath))
    run(built, frames_for(built, 2), opencv)


@pytest.mark.parametrize(
    "side, size, pipeline",
    [
        ("left", VGA, COMPACT),
        ("left", VGA, BALANCED),
        ("left", VGA, FAST),
        ("right", (643, 481), BALANCED),
        ("right", (643, 481), FAST),
    ],
    ids=named,
)
def test_every_pixel_with_the_lens_is_that_of_cv2_remap(side, size, pipeline):
    built = core(Options("spline"), side, size, lens=True, pipeline=pipeline)
    stream = run(built, frames_for(built, 2), opencv)
    assert stream.not_ready_cycles == 0
    assert stream.beats["cycle"][0] - stream.sent["cycle"][0] == built.plan.latency_cycles


@pytest.mark.parametrize(
    "datapath, lens",
    [(name, lens) for name, kind in DATAPATHS.items() for lens in (False, True) if kind.supports_lens or not lens],
)
@pytest.mark.parametrize("axis", ["u", "v"])
def test_ramps_show_the_models_coordinates_at_every_pixel(axis, datapath, lens):
    # With 16-bit pixels that rise by 64 a column (or a row), a bilinear core gives out its own coordinates.
    built = core(Options(datapath, pixel_bits=16), "left", min(SMALL, largest(datapath)), lens=lens)
    plan, coordinates = built.plan, built.parameters.datapath.coordinates
    x, y = np.meshgrid(np.arange(plan.width), np.arange(plan.height))
    slope = 64
    frame = ((x if axis == "u" else y) * slope).astype(np.uint16)
    (rectified,) = output(built, [frame])[1]
    u, v = coordinates.u / 32, coordinates.v / 32
    inside = (u >= 0) & (u <= plan.width - 1) & (v >= 0) & (v <= plan.height - 1)
    assert inside.mean() > 0.8
    np.testing.assert_array_equal((rectified / slope)[inside], (u if axis == "u" else v)[inside])


@pytest.mark.parametrize("border", [Border("constant", 201), Border("replicate")], ids=str)
@pytest.mark.parametrize("channels, pipeline", [(1, BALANCED), (3, FAST), (3, BALANCED)], ids=named)
def test_borders_and_colour_are_those_of_cv2_remap(border, channels, pipeline):
    # alpha 1 shows all of the source, so the map leaves it on every side.
    options = Options(datapath="accumulate", border=border, channels=channels)
    built = core(options, alpha=1.0, pipeline=pipeline)
    low, high = built.parameters.datapath.coordinates.u_range
    assert low < 0 and high > (VGA[0] - 1) << 5
    run(built, frames_for(built, 2), opencv)


@pytest.mark.parametrize("pixel_bits, fraction_bits", [(10, 5), (12, 3), (16, 8), (8, 6)])
def test_other_widths_are_those_of_the_integer_formula(pixel_bits, fraction_bits):
    built = core(Options("proposed", pixel_bits=pixel_bits, fraction_bits=fraction_bits))
    run(built, frames_for(built, 2), model)


@pytest.mark.parametrize("size", [(64, 48), (321, 241), (512, 384), (1000, 70)])
def test_any_frame_size(size):
    built = core(Options(datapath="conventional"), "right", size)
    run(built, frames_for(built, 3), opencv, idle=0.2, backpressure=0.3, seed=1)


@pytest.mark.parametrize(
    "datapath, pipeline",
    [*((name, BALANCED) for name in DATAPATHS), ("proposed", COMPACT), ("spline", FAST)],
    ids=named,
)
@pytest.mark.parametrize(
    "idle, backpressure, burst",
    [
        (0.0, 0.0, None),
        (0.5, 0.0, None),
        (0.0, 0.5, None),
        (0.4, 0.4, None),
        (0.3, 0.6, 900),
        (0.7, 0.1, 2000),
    ],
)
def test_pauses_change_nothing_but_the_time(datapath, pipeline, idle, backpressure, burst):
    built = core(Options(datapath=datapath), "left", min((320, 240), largest(datapath)), pipeline=pipeline)
    stream = run(built, frames_for(built, 3), opencv, idle=idle, backpressure=backpressure, burst=burst, seed=7)
    if not backpressure:
        assert stream.stall_cycles == 0


@pytest.mark.parametrize("datapath", DATAPATHS)
def test_frames_without_blanking_never_stall_the_input(datapath):
    built = core(Options(datapath=datapath), "right", largest(datapath))
    frames = frames_for(built, 3)
    stream = run(built, frames, opencv)
    assert stream.not_ready_cycles == 0
    # One beat in each clock on the way in, one on the way out.
    assert stream.sent["cycle"][-1] - stream.sent["cycle"][0] == frames.size - 1
    frame = frames[0].size
    assert stream.beats["cycle"][frame] - stream.beats["cycle"][0] == frame


@pytest.mark.parametrize("datapath", DATAPATHS)
@pytest.mark.parametrize("side", ["left", "right"])
def test_latency_is_the_plans(datapath, side):
    built = core(Options(datapath=datapath), side, largest(datapath))
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
