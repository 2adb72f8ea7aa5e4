"""Registers of values that wait."""

import random

import pytest
from amaranth import Module, ResetInserter, Signal, signed

from hdl.arithmetic.cuts import PIPELINES, Stages
from sim.drivers import feed, observe, pauses, simulate


@pytest.mark.parametrize("clocks", [1, 2, 5])
@pytest.mark.parametrize("shape", [signed(5), 7, 1], ids=str)
def test_values_come_enabled_clocks_late_with_their_sign(shape, clocks):
    m, enable, value = Module(), Signal(), Signal(shape)
    late = Stages(m, enable).after("late", value, clocks)
    assert late.shape() == value.shape()
    generator = random.Random(clocks)
    bits, sign = len(value), value.shape().signed
    stimuli = [(generator.getrandbits(bits) - sign * 2 ** (bits - 1),) for _ in range(60)]
    _, results = simulate(
        m,
        feed(enable, [value], stimuli, pauses(0.4, clocks)),
        observe(enable, [late], len(stimuli), clocks),
        clocks=500,
    )
    assert results == stimuli


def test_without_a_clock_there_is_no_register():
    value = Signal(4)
    assert Stages(None, 1).after("late", value, 0) is value


@pytest.mark.parametrize("reset_less", [False, True])
def test_a_reset_clears_every_register_unless_told_otherwise(reset_less):
    m, reset = Module(), Signal()
    late = Stages(m, 1).after("late", Signal(4, init=9), 3, reset_less)

    async def testbench(ctx):
        for _ in range(4):
            await ctx.tick()
        ctx.set(reset, 1)
        await ctx.tick()
        ctx.set(reset, 0)
        seen = []
        for _ in range(4):
            seen.append(ctx.get(late))
            await ctx.tick()
        return seen

    (seen,) = simulate(ResetInserter(reset)(m), testbench, clocks=20)
    assert seen == ([9] * 4 if reset_less else [0, 0, 0, 9])


def test_pipelines_differ_and_go_by_their_names():
    assert [pipeline.name for pipeline in PIPELINES.values()] == list(PIPELINES)
    assert len(set(PIPELINES.values())) == len(PIPELINES)
