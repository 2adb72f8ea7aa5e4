"""The drivers see what they are there to see: they fail on blocks that are wrong."""

import itertools

import pytest
from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from sim.drivers import Hang, Stream, feed, never, observe, pauses, receive, send, simulate


class Register(wiring.Component):
    """A register with the handshake of a stream; with a fault."""

    def __init__(self, fault=None):
        self.fault = fault
        super().__init__(
            {
                "i": In(8),
                "i_valid": In(1),
                "i_ready": Out(1),
                "o": Out(8),
                "o_valid": Out(1),
                "o_ready": In(1),
            }
        )

    def elaborate(self, _platform):
        m = Module()
        count = Signal(6)
        m.d.comb += self.i_ready.eq(~self.o_valid | self.o_ready)
        with m.If(self.i_ready):
            m.d.sync += [self.o.eq(self.i), self.o_valid.eq(self.i_valid), count.eq(count + self.i_valid)]
        match self.fault:
            case "stops":
                m.d.comb += self.i_ready.eq((~self.o_valid | self.o_ready) & (count != 20))
            case "changes":
                with m.If(self.o_valid & ~self.o_ready):
                    m.d.sync += self.o.eq(self.o + 1)
            case "withdraws":
                with m.If(self.o_valid & ~self.o_ready):
                    m.d.sync += self.o_valid.eq(0)
            case "repeats":
                with m.If(self.o_valid & self.o_ready & (count == 40)):
                    m.d.sync += [self.o_valid.eq(1), self.o.eq(self.o), count.eq(41)]
            case "takes noise":
                m.d.sync += self.o_valid.eq(1)
        return m


def run(fault=None, share=0.4):
    block = Register(fault)
    beats = [(value,) for value in range(100, 140)]
    sent, received = simulate(
        block,
        send(Stream(block.i_valid, block.i_ready, (block.i,)), beats, pauses(share, 1)),
        receive(Stream(block.o_valid, block.o_ready, (block.o,)), len(beats), pauses(share, 2)),
        clocks=400,
    )
    assert [(value,) for _, value in received] == beats
    return sent, [clock for clock, _ in received]


def test_beats_pass_under_pauses():
    sent, taken = run()
    assert all(clock < later for clock, later in zip(sent, taken))
    assert taken[-1] > 50


def test_clocks_are_counted_from_the_first():
    assert run(share=0) == (list(range(40)), list(range(1, 41)))


@pytest.mark.parametrize("fault", ["changes", "withdraws", "repeats", "takes noise"])
def test_a_fault_is_seen(fault):
    with pytest.raises(AssertionError):
        run(fault)


def test_a_hang_ends_with_its_name():
    with pytest.raises(Hang) as caught:
        run("stops")
    assert str(caught.value) == "after 400 clocks testbenches [0] have not returned"


@pytest.mark.parametrize("share, burst", [(0.0, 1), (0.3, 1), (0.5, 10), (0.8, 4), (0.2, 30)])
def test_pauses_have_their_share_and_their_length(share, burst):
    clocks = list(itertools.islice(pauses(share, 3, burst), 40000))
    assert sum(clocks) / len(clocks) == pytest.approx(share, abs=0.06 if burst > 1 else 0.01)
    runs = [len(list(group)) for pausing, group in itertools.groupby(clocks) if pausing]
    if share:
        assert sum(runs) / len(runs) == pytest.approx(max(burst, 1 / (1 - share)), rel=0.15)
    assert clocks == list(itertools.islice(pauses(share, 3, burst), 40000))


class Delay(wiring.Component):
    """Two registers with an enable, which one of them may not heed."""

    def __init__(self, heeds=True):
        self.heeds = heeds
        super().__init__({"enable": In(1), "i": In(8), "o": Out(8)})

    def elaborate(self, _platform):
        m = Module()
        first = Signal(8)
        with m.If(self.enable):
            m.d.sync += first.eq(self.i)
        with m.If(self.enable | (not self.heeds)):
            m.d.sync += self.o.eq(first)
        return m


def delayed(block, latency, pattern):
    stimuli = [(value * 7 % 256,) for value in range(60)]
    _, results = simulate(
        block,
        feed(block.enable, [block.i], stimuli, pattern),
        observe(block.enable, [block.o], len(stimuli), latency),
        clocks=500,
    )
    return results == stimuli


def test_a_pipeline_is_observed_at_its_latency():
    assert delayed(Delay(), 2, pauses(0.5, 1))
    assert not delayed(Delay(), 1, never())
    assert not delayed(Delay(), 3, never())


def test_a_pipeline_that_does_not_stand_is_seen():
    with pytest.raises(AssertionError, match="changed while the pipeline stood"):
        delayed(Delay(heeds=False), 2, pauses(0.5, 1))
