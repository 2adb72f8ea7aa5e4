import random

import numpy as np
import pytest
import rigs
from amaranth import ResetSignal, Signal
from cores import HEIGHT, WIDTH, check, frames_of, parameters, random_frames, random_map, rectified, stream_of

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST
from hdl.datapaths import DATAPATHS
from hdl.geometry.coordinates import Border
from hdl.stream.rectifier import Rectifier, RectifierParameters
from sim.drivers import CORE_DOMAIN, axis, bench, never, pauses, receive, send, simulate

# Every datapath with the pipeline that cores have unless told otherwise, some with the others.
CORES = [
    *((name, BALANCED) for name in DATAPATHS),
    ("proposed", COMPACT),
    ("spline", COMPACT),
    ("conventional", FAST),
    ("spline", FAST),
]
cores = pytest.mark.parametrize("name, pipeline", CORES, ids=lambda value: getattr(value, "name", value))


@cores
@pytest.mark.parametrize("idle, backpressure, burst", [(0.5, 0.0, 3), (0.0, 0.5, 3), (0.4, 0.4, 60)])
def test_frames_come_out_rectified_whatever_the_pauses(name, pipeline, idle, backpressure, burst):
    p = parameters(name, rigs.view("samples", "right", 23, 17), pipeline=pipeline)
    check(p, 2, pauses(idle, 1, burst), pauses(backpressure, 2, burst))


@pytest.mark.parametrize(
    "pixel_bits, channels, fraction_bits, pipeline",
    [
        (10, 1, 3, BALANCED),
        (12, 1, 5, FAST),
        (16, 1, 8, BALANCED),
        (8, 3, 5, BALANCED),
        (8, 3, 4, FAST),
        (16, 1, 7, COMPACT),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_every_pixel_format(pixel_bits, channels, fraction_bits, pipeline):
    view = rigs.view("samples_whole", "left", 18, 16)
    border = Border("constant", 255)
    p = parameters("proposed", view, fraction_bits, pipeline, pixel_bits=pixel_bits, channels=channels, border=border)
    assert p.tdata_width == {10: 16, 12: 16, 16: 16, 8: 24}[pixel_bits]
    check(p, 2, pauses(0.2, 5), pauses(0.2, 6))


@pytest.mark.parametrize(
    "name, pipeline", [("spline", BALANCED), ("proposed", FAST)], ids=lambda value: getattr(value, "name", value)
)
def test_many_frames(name, pipeline):
    # 11 rows a frame in a ring of 8.
    p = parameters(name, rigs.view("rolled", "left", 16, 11), pipeline=pipeline)
    assert p.line_buffer.rows == 8
    check(p, 12, pauses(0.05, 7), pauses(0.05, 8))


@pytest.mark.parametrize("rig", ["samples", "looks_up", "looks_down"])
def test_last_frame_drains_without_more_input(rig):
    p = parameters("conventional", rigs.view(rig))
    sent, taken = check(p, 1, never(), never())
    # From its last pixel in, no more than the rows that wait for it, and the pipeline.
    assert taken[-1] - sent[-1] <= p.latency_cycles


@pytest.mark.parametrize(
    "name, pipeline, rig, side",
    [
        *((name, pipeline, "rolled", "left") for name, pipeline in CORES),
        ("proposed", BALANCED, "looks_up", "right"),
        ("proposed", FAST, "looks_down", "left"),
        ("conventional", BALANCED, "samples", "right"),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_latency_is_exact(name, pipeline, rig, side):
    p = parameters(name, rigs.view(rig, side), pipeline=pipeline)
    sent, taken = check(p, 1, never(), never())
    assert taken[0] - sent[0] == p.latency_cycles


@pytest.mark.parametrize("fraction_bits", [1, 3, 4, 6, 7, 8])
@pytest.mark.parametrize("pipeline", [BALANCED, FAST], ids=lambda pipeline: pipeline.name)
def test_latency_is_exact_for_any_fraction(fraction_bits, pipeline):
    p = RectifierParameters(random_map(12, 4, 0, 1, 0, pipeline, fraction_bits))
    sent, taken = check(p, 1, never(), never())
    assert taken[0] - sent[0] == p.latency_cycles


@pytest.mark.parametrize(
    "name, pipeline, rig, idle",
    [
        *((name, pipeline, "rolled", 0.0) for name, pipeline in CORES),
        *((name, pipeline, "rolled", 0.4) for name, pipeline in CORES[::4]),
        *(("proposed", BALANCED, "looks_up", idle) for idle in (0.0, 0.4)),
        *(("proposed", FAST, "looks_down", idle) for idle in (0.0, 0.4)),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_input_never_waits_while_the_output_does_not(name, pipeline, rig, idle):
    watched = 3 * WIDTH * HEIGHT

    def ready_clocks(core):
        async def testbench(ctx):
            clocks = 0
            for _ in range(watched):
                _, _, ready = await ctx.tick(CORE_DOMAIN).sample(core.s_axis_tready)
                clocks += ready
            return clocks

        return testbench

    p = parameters(name, rigs.view(rig), pipeline=pipeline)
    sent, taken, ready = check(p, 3, pauses(idle, 9, burst=40), never(), ready_clocks)
    assert ready == watched
    if not idle:
        assert np.diff(sent).tolist() == np.diff(taken).tolist() == [1] * (watched - 1)


def test_input_side_does_not_see_the_output_side_within_a_clock():
    p = parameters(view=rigs.view("samples"), pipeline=COMPACT)

    def toggle(core):
        async def testbench(ctx):
            seen = set()
            for _ in range(8 * WIDTH):
                await ctx.tick(CORE_DOMAIN)
                ready = []
                for taking in (0, 1, 0):
                    ctx.set(core.m_axis_tready, taking)
                    ready.append(ctx.get(core.s_axis_tready))
                assert len(set(ready)) == 1
                seen.add((ctx.get(core.m_axis_tvalid), ready[0]))
            return seen

        return testbench

    core = Rectifier(p)
    stream = stream_of(p, random_frames(p, 1))
    _, seen = simulate(
        bench(core),
        send(axis(core, "s_axis"), stream[: 3 * WIDTH], never(), CORE_DOMAIN),
        toggle(core),
        clocks=10 * WIDTH,
        domain=CORE_DOMAIN,
    )
    assert seen >= {(0, 1), (1, 0)}  # before the first pixel, and with one waiting while the line buffer is full


@pytest.mark.parametrize("pipeline", [BALANCED, FAST], ids=lambda pipeline: pipeline.name)
def test_no_port_sees_another_within_a_clock(pipeline):
    p = parameters(view=rigs.view("samples"), pipeline=pipeline)
    core, generator = Rectifier(p), random.Random(1)
    inputs = core.s_axis_tdata, core.s_axis_tvalid, core.s_axis_tuser, core.s_axis_tlast, core.m_axis_tready
    outputs = core.s_axis_tready, core.m_axis_tvalid, core.m_axis_tdata, core.m_axis_tuser, core.m_axis_tlast
    beats = iter(stream_of(p, random_frames(p, 4)))

    async def testbench(ctx):
        seen = set()
        beat = next(beats)
        for clock in range(3 * WIDTH * HEIGHT):
            found = set()
            for _ in range(3):
                for port in inputs:
                    ctx.set(port, generator.getrandbits(len(port)))
                found.add(tuple(map(ctx.get, outputs)))
            assert len(found) == 1
            seen.add(found.pop()[:2])
            # In the end it is a stream of frames, and an output that stands for a frame's time.
            ctx.set(core.m_axis_tready, not WIDTH * HEIGHT < clock < 2 * WIDTH * HEIGHT)
            ctx.set(core.s_axis_tvalid, 1)
            for port, value in zip((core.s_axis_tdata, core.s_axis_tuser, core.s_axis_tlast), beat):
                ctx.set(port, value)
            *_, moved = await ctx.tick(CORE_DOMAIN).sample(core.s_axis_tready)
            beat = next(beats) if moved else beat
        return seen

    (seen,) = simulate(bench(core), testbench, clocks=4 * WIDTH * HEIGHT, domain=CORE_DOMAIN)
    assert seen >= {(1, 0), (1, 1), (0, 1)}


@cores
def test_a_reset_in_mid_frame_starts_over(name, pipeline):
    p = parameters(name, rigs.view("rolled", "left", WIDTH, HEIGHT), pipeline=pipeline)
    frames = random_frames(p, 3)
    core = Rectifier(p)
    top, reset = bench(core), Signal()
    top.d.comb += ResetSignal(CORE_DOMAIN).eq(reset)
    count = WIDTH * HEIGHT

    async def into(ctx):
        # Into the second frame, while the first one is still coming out.
        await send(axis(core, "s_axis"), stream_of(p, frames[:2])[: count + 5 * WIDTH + 7], never(), CORE_DOMAIN)(ctx)
        ctx.set(core.s_axis_tvalid, 0)
        ctx.set(reset, 1)
        await ctx.tick(CORE_DOMAIN)
        ctx.set(reset, 0)
        await send(axis(core, "s_axis"), stream_of(p, frames[2:]), never(), CORE_DOMAIN)(ctx)

    async def out_of(ctx):
        ctx.set(core.m_axis_tready, 1)
        in_reset = False
        while not in_reset:
            _, in_reset = await ctx.tick(CORE_DOMAIN)
        assert not ctx.get(core.m_axis_tvalid)
        return await receive(axis(core, "m_axis"), count, pauses(0.2, 1), CORE_DOMAIN)(ctx)

    _, received = simulate(top, into, out_of, clocks=6 * count, domain=CORE_DOMAIN)
    (out,) = frames_of(p, received)
    np.testing.assert_array_equal(out, rectified(p, frames[2]))


@pytest.mark.parametrize("pixel_bits, channels", [(9, 1), (7, 1), (10, 3), (8, 2), (8, 4), (24, 1), (0, 1)])
def test_other_pixel_formats_are_refused(pixel_bits, channels):
    with pytest.raises(ValueError) as caught:
        parameters(pixel_bits=pixel_bits, channels=channels)
    assert str(caught.value) == (f"pixels are one of 1x8, 1x10, 1x12, 1x16, 3x8 bits, not {channels}x{pixel_bits}")


@pytest.mark.parametrize("pixel_bits, value", [(8, 256), (10, 1024), (16, 65536), (8, -1)])
def test_border_values_that_do_not_fit_are_refused(pixel_bits, value):
    with pytest.raises(ValueError) as caught:
        parameters(pixel_bits=pixel_bits, border=Border("constant", value))
    assert str(caught.value) == f"border value {value} does not fit into {pixel_bits} bits"
