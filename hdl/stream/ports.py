"""Registers at the core's streams, so that no port depends on another within a clock."""

from amaranth import Module, Mux, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out


class InputRegister(wiring.Component):
    """Holds a beat. Latency: 1 clock. Throughput: one a clock.

    Parameters
    ----------
    bits : int
        Of a beat.

    Members
    -------
    i : In(bits), i_valid : In(1), i_ready : Out(1)
        ``i_ready`` depends on ``o_ready``, on no other port.
    o : Out(bits), o_valid : Out(1), o_ready : In(1)
        ``o`` and ``o_valid`` are registers.
    """

    def __init__(self, bits):
        super().__init__(
            {
                "i": In(bits),
                "i_valid": In(1),
                "i_ready": Out(1),
                "o": Out(bits),
                "o_valid": Out(1),
                "o_ready": In(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        held = Signal.like(self.o, reset_less=True)
        m.d.comb += [self.i_ready.eq(~self.o_valid | self.o_ready), self.o.eq(held)]
        with m.If(self.i_ready):
            m.d.sync += [held.eq(self.i), self.o_valid.eq(self.i_valid)]
        return m


class OutputSkid(wiring.Component):
    """The last register of a pipeline, and one beside it for the beat that comes while the output does not move.

    So the pipeline's clock enable is a register: it falls a clock after the output stopped. Latency: 1 clock while the
    output is ready. Throughput: one beat a clock.

    Parameters
    ----------
    bits : int
        Of a beat.

    Members
    -------
    enable : Out(1)
        The pipeline moves on in this clock; a register.
    running : Out(1)
        The same from a register of its own: for logic, so that ``enable`` is left to clock enables.
    i : In(bits), i_valid : In(1)
        The pipeline's last value, a beat where it is valid.
    o : Out(bits), o_valid : Out(1), o_ready : In(1)
        ``o`` and ``o_valid`` are registers.
    """

    def __init__(self, bits):
        super().__init__(
            {
                "enable": Out(1, init=1),
                "running": Out(1),
                "i": In(bits),
                "i_valid": In(1),
                "o": Out(bits),
                "o_valid": Out(1),
                "o_ready": In(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        out = Signal.like(self.o, reset_less=True)
        aside = Signal.like(self.o, reset_less=True)
        standing = Signal()  # inverted, or synthesis makes one register of the two
        m.d.comb += [self.running.eq(~standing), self.o.eq(out)]
        with m.If(~self.o_valid | self.o_ready):
            m.d.sync += [
                out.eq(Mux(standing, aside, self.i)),
                self.o_valid.eq(standing | self.i_valid),
                self.enable.eq(1),
                standing.eq(0),
            ]
        with m.Elif(self.i_valid):
            m.d.sync += [self.enable.eq(0), standing.eq(1)]
        with m.If(self.enable):
            m.d.sync += aside.eq(self.i)
        return m
