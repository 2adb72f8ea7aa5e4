"""The interpolator computes what it names, for all operands and any pauses."""

from amaranth import Module, Mux, ResetSignal, Signal, Value
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Elaboratable

from hdl.arithmetic.cuts import COMPACT
from hdl.stream.bilinear import Bilinear

from .opened import Opened


class BilinearProof(Elaboratable):
    """Without pauses the pixel is (sum of tap * weight + half) >> 2*fraction_bits, wherever the taps come from.

    By k-induction with k = `depth`: there is no loop, so that the pixel is a function of the inputs of so many clocks.

    Parameters
    ----------
    pixel_bits, channels, fraction_bits, lead, pipeline
        As of `Bilinear`.
    """

    def __init__(self, pixel_bits, channels, fraction_bits, lead=0, pipeline=COMPACT):
        self._bits, self._channels, self._f, self._lead = pixel_bits, channels, fraction_bits, lead
        self._bilinear = Bilinear(pixel_bits, channels, fraction_bits, lead, pipeline)

    @property
    def depth(self):
        """Clocks that the pixel depends on."""
        return self._lead + self._bilinear.latency + 1

    def elaborate(self, platform):
        m = Module()
        m.submodules.bilinear = bilinear = self._bilinear
        m.d.comb += bilinear.enable.eq(1)
        taps = bilinear.taps.as_value()
        said = [bilinear.fx, bilinear.fy, bilinear.odd_column, bilinear.odd_row]
        m.d.comb += [operand.eq(AnySeq(len(operand))) for operand in (taps, *said)]
        taps = self._later(m, "taps", taps, bilinear.latency)
        valid, fx, fy, odd_column, odd_row = (
            self._later(m, name, value, self._lead + bilinear.latency)
            for name, value in zip(("valid", "fx", "fy", "odd_column", "odd_row"), (Signal(init=1), *said))
        )
        one, f = 1 << self._f, self._f
        for channel in range(self._channels):
            rows = []
            for row in range(2):
                even, odd = (
                    taps.word_select(row * 2 + column, self._bits * self._channels).word_select(channel, self._bits)
                    for column in range(2)
                )
                left, right = Mux(odd_column, odd, even), Mux(odd_column, even, odd)
                rows.append(left * (one - fx) + right * fx)
            top, bottom = Mux(odd_row, rows[1], rows[0]), Mux(odd_row, rows[0], rows[1])
            mean = (top * (one - fy) + bottom * fy + (1 << 2 * f >> 1)) >> 2 * f
            m.d.comb += Assert(
                ~valid | (bilinear.pixel.word_select(channel, self._bits) == mean),
                f"channel {channel} is the weighted sum of its taps",
            )
        return m

    @staticmethod
    def _later(m, name, value, clocks):
        for clock in range(clocks):
            before, value = value, Signal(len(value), name=f"{name}_{clock}")
            m.d.sync += value.eq(before)
        return value


class PauseProof(Elaboratable):
    """No register of a block changes in a clock without ``enable``: with pauses it does what it does without them.

    Parameters
    ----------
    component : Component
        With a member ``enable``; of the others, those that are inputs are free.
    """

    def __init__(self, component):
        self._component = component

    def elaborate(self, platform):
        m = Module()
        m.submodules.block = opened = Opened(self._component)
        for _, member, signal in self._component.signature.flatten(self._component):
            if member.flow.name == "In":
                m.d.comb += Value.cast(signal).eq(AnySeq(len(Value.cast(signal))))
        paused = Signal()
        m.d.sync += paused.eq(~self._component.enable & ~ResetSignal())
        for path, register in opened.registers.items():
            before = Signal.like(register, name=f"{path}_before", init=0)
            m.d.sync += before.eq(register)
            m.d.comb += Assert(~paused | (register == before), f"{path} waits")
        return m
