"""Small drivers for Amaranth's simulator: a testbench a side, seeded pauses, and a watchdog.

A testbench is what `simulate` takes: a function of the simulator's context that returns what it saw.

    sent, received = simulate(
        bench(core), send(stream, beats, pauses(0.2, seed=1)), receive(out, count, pauses(0.3, seed=2)), clocks=10_000
    )
"""

import random
from dataclasses import dataclass

from amaranth import ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.sim import Simulator

CORE_DOMAIN = "bus"
_PERIOD = 1e-6  # s


class Hang(AssertionError):
    """A simulation that did not come to its end."""


def simulate(top, *testbenches, clocks, domain="sync"):
    """Simulate ``top`` until every testbench has returned; their results.

    Raises Hang where they take more than ``clocks`` clocks.
    """
    results = {}
    simulator = Simulator(top)
    simulator.add_clock(_PERIOD, domain=domain)

    def add(index, testbench):
        async def run(ctx):
            results[index] = await testbench(ctx)

        simulator.add_testbench(run)

    for index, testbench in enumerate(testbenches):
        add(index, testbench)

    async def watchdog(ctx):
        await ctx.delay(clocks * _PERIOD)
        waiting = sorted(range(len(testbenches)) - results.keys())
        raise Hang(f"after {clocks} clocks testbenches {waiting} have not returned")

    simulator.add_testbench(watchdog, background=True)
    simulator.run()
    if len(results) != len(testbenches):
        raise Hang(f"only testbenches {sorted(results)} of {len(testbenches)} returned")
    return [results[index] for index in range(len(testbenches))]


def pauses(share, seed, burst=1.0):
    """An endless sequence of bool, one a clock, true for a pause.

    Parameters
    ----------
    share : float
        Part of the clocks that are pauses, 0 to below 1.
    seed : int
    burst : float
        Mean length of a pause where it is longer than chance makes it, clocks.
    """
    generator = random.Random(seed)
    leave = min(1 - share, 1 / burst)
    enter = share * leave / (1 - share)
    pausing = generator.random() < share
    while True:
        yield pausing
        pausing = generator.random() >= leave if pausing else generator.random() < enter


def never():
    """No pauses."""
    return pauses(0, seed=0)


@dataclass(frozen=True)
class Stream:
    """The signals of one stream.

    Members
    -------
    valid, ready : Signal(1)
    payload : tuple of Signal
    """

    valid: Signal
    ready: Signal
    payload: tuple


def axis(core, name):
    """The `Stream` of a core's AXI4-Stream ports called ``name``; payload: tdata, tuser, tlast."""
    port = {part: getattr(core, f"{name}_{part}") for part in ("tvalid", "tready", "tdata", "tuser", "tlast")}
    return Stream(port["tvalid"], port["tready"], (port["tdata"], port["tuser"], port["tlast"]))


def bench(core):
    """A top level, clocked by `CORE_DOMAIN`, for a core with its own ports aclk and aresetn."""
    m = Module()
    m.domains += ClockDomain(CORE_DOMAIN)
    m.submodules.core = core
    m.d.comb += [core.aclk.eq(ClockSignal(CORE_DOMAIN)), core.aresetn.eq(~ResetSignal(CORE_DOMAIN))]
    return m


def send(stream, beats, pauses, domain="sync"):
    """A testbench that offers ``beats``, tuples as the stream's payload; returns the clock in which each one moved.

    A beat once offered stays. The payload is noise while there is none.
    """
    generator = random.Random(len(beats))

    async def testbench(ctx):
        moved, clock = [], 0

        async def wait(valid, payload):
            ctx.set(stream.valid, valid)
            _set(ctx, stream.payload, payload)
            *_, ready = await ctx.tick(domain).sample(stream.ready)
            return ready

        for beat in beats:
            while next(pauses):
                await wait(0, _noise(stream.payload, generator))
                clock += 1
            while not await wait(1, beat):
                clock += 1
            moved.append(clock)
            clock += 1
        await wait(0, _noise(stream.payload, generator))
        return moved

    return testbench


def receive(stream, count, pauses, domain="sync", settle=50):
    """A testbench that takes ``count`` beats; returns (clock, *payload) of each.

    Whether more follow is seen in ``settle`` further clocks: then there are more than ``count``. Asserts that a beat,
    once offered, stays as it is until it is taken.
    """

    async def testbench(ctx):
        taken, clock, waiting, rest = [], 0, None, settle
        while rest:
            ready = not next(pauses)
            ctx.set(stream.ready, ready)
            _, _, valid, *beat = await ctx.tick(domain).sample(stream.valid, *stream.payload)
            offered = beat if valid else None
            assert waiting in (None, offered), f"clock {clock}: {waiting} waited, then there was {offered}"
            if valid and ready:
                taken.append((clock, *beat))
            waiting = None if ready else offered
            rest -= len(taken) >= count
            clock += 1
        return taken

    return testbench


def feed(enable, inputs, stimuli, pauses, domain="sync"):
    """A testbench that gives a pipeline one of ``stimuli``, tuples of values for ``inputs``, in each enabled clock.

    ``enable`` is low where there is a pause, and the inputs are noise then; it stays high after the last one.
    """
    generator = random.Random(len(stimuli))

    async def testbench(ctx):
        for values in stimuli:
            while next(pauses):
                ctx.set(enable, 0)
                _set(ctx, inputs, _noise(inputs, generator))
                await ctx.tick(domain)
            ctx.set(enable, 1)
            _set(ctx, inputs, values)
            await ctx.tick(domain)
        _set(ctx, inputs, _noise(inputs, generator))

    return testbench


def observe(enable, outputs, count, latency, domain="sync"):
    """A testbench that returns the first ``count`` results of a pipeline of ``latency`` >= 1, tuples of ``outputs``.

    The result of the n-th enabled clock's inputs is what stands there from ``latency`` enabled clocks later until the
    next enabled one; asserts that it stands.
    """

    async def testbench(ctx):
        results, enabled_clocks = [], 0
        while len(results) < count:
            _, _, enabled, *values = await ctx.tick(domain).sample(enable, *outputs)
            index = enabled_clocks - latency
            if index == len(results):
                results.append(tuple(values))
            elif index >= 0:
                assert tuple(values) == results[index], f"result {index} changed while the pipeline stood"
            enabled_clocks += enabled
        return results

    return testbench


def _set(ctx, signals, values):
    for signal, value in zip(signals, values, strict=True):
        ctx.set(signal, value)


def _noise(signals, generator):
    return [generator.getrandbits(len(signal)) for signal in signals]
