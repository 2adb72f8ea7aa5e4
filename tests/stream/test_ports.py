"""The registers at the streams: nothing lost, nothing doubled, nothing out of order, and no way from port to port."""

import random

import pytest

from hdl.stream.ports import InputRegister, OutputSkid
from sim.drivers import Stream, never, pauses, receive, send, simulate

BITS = 9
PATTERNS = [(0.0, 0.0, 1), (0.5, 0.0, 1), (0.0, 0.5, 1), (0.4, 0.4, 1), (0.6, 0.5, 6), (0.1, 0.6, 12)]
patterns = pytest.mark.parametrize("idle, backpressure, burst", PATTERNS)


def numbered(count):
    """Beats that all differ."""
    beats = list(range(2**BITS))
    random.Random(count).shuffle(beats)
    return beats[:count]


def output(block):
    return Stream(block.o_valid, block.o_ready, (block.o,))


@patterns
def test_input_register_hands_on_every_beat(idle, backpressure, burst):
    block, beats = InputRegister(BITS), numbered(200)
    i = Stream(block.i_valid, block.i_ready, (block.i,))
    sent, taken = simulate(
        block,
        send(i, [(beat,) for beat in beats], pauses(idle, 1, burst)),
        receive(output(block), len(beats), pauses(backpressure, 2, burst)),
        clocks=5000,
    )
    assert [beat for _, beat in taken] == beats
    if not backpressure:
        assert [clock for clock, _ in taken] == [clock + 1 for clock in sent]
    if not idle and not backpressure:
        assert sent == list(range(len(beats)))


def through_a_skid(beats, idle, backpressure):
    """(clocks in which a beat went in, (clock, beat) of those that came out).

    The input is noise in the clocks in which the pipeline stands. ``running`` is compared with ``enable``.
    """
    block = OutputSkid(BITS)
    generator = random.Random(len(beats))

    async def pipeline(ctx):
        sent, clock, left = [], 0, list(beats)
        while left:
            moves = ctx.get(block.enable)
            assert ctx.get(block.running) == moves
            valid = not next(idle) if moves else generator.getrandbits(1)
            ctx.set(block.i_valid, valid)
            ctx.set(block.i, left[0] if moves and valid else generator.getrandbits(BITS))
            await ctx.tick()
            if moves and valid:
                sent.append(clock)
                left.pop(0)
            clock += 1
        ctx.set(block.i_valid, 0)
        return sent

    return simulate(block, pipeline, receive(output(block), len(beats), backpressure), clocks=5000)


@patterns
def test_output_skid_hands_on_every_beat(idle, backpressure, burst):
    beats = numbered(200)
    sent, taken = through_a_skid(beats, pauses(idle, 1, burst), pauses(backpressure, 2, burst))
    assert [beat for _, beat in taken] == beats
    if not backpressure:
        assert [clock for clock, _ in taken] == [clock + 1 for clock in sent]
    if not idle and not backpressure:
        assert sent == list(range(len(beats)))


def test_output_skid_loses_no_clock_while_there_are_beats():
    # As many beats go out as the output is ready for, the first clock aside.
    beats = numbered(200)
    ready = [not pause for pause, _ in zip(pauses(0.5, 3, burst=3), range(2000))]
    _, taken = through_a_skid(beats, never(), (not is_ready for is_ready in ready))
    assert [clock for clock, _ in taken] == [clock for clock in range(1, 2000) if ready[clock]][: len(beats)]


def held(block, registers, ports):
    """Whatever ``ports`` do within a clock, ``registers`` stay; both are seen high and low."""
    generator = random.Random(len(ports))

    async def testbench(ctx):
        seen = set()
        for _ in range(200):
            found = set()
            for _ in range(6):
                for port in ports:
                    ctx.set(port, generator.getrandbits(len(port)))
                found.add(tuple(map(ctx.get, registers)))
            assert len(found) == 1
            seen |= found
            await ctx.tick()
        return seen

    (seen,) = simulate(block, testbench, clocks=500)
    assert all(len(set(values)) > 1 for values in zip(*seen))


def test_input_register_is_a_register():
    block = InputRegister(BITS)
    held(block, [block.o, block.o_valid], [block.i, block.i_valid, block.o_ready])


def test_input_register_is_ready_whatever_comes_in():
    block = InputRegister(BITS)

    async def testbench(ctx):
        seen = []
        for o_ready in (0, 0, 1, 0):
            ctx.set(block.o_ready, o_ready)
            found = set()
            for i_valid in (0, 1):
                ctx.set(block.i_valid, i_valid)
                ctx.set(block.i, 2**BITS - 1 - i_valid)
                found.add(ctx.get(block.i_ready))
            assert len(found) == 1
            seen += found
            await ctx.tick()
        return seen

    assert simulate(block, testbench, clocks=10) == [[1, 0, 1, 0]]


def test_output_skid_moves_and_gives_out_by_registers_only():
    block = OutputSkid(BITS)
    held(block, [block.enable, block.running, block.o, block.o_valid], [block.i, block.i_valid, block.o_ready])
