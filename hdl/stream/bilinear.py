"""Bilinear interpolation of a 2x2 window, bit for bit cv2.remap's."""

from amaranth import Cat, Module, Mux, Signal
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In, Out

from hdl.errors import at_least


def blend(m, name, even, odd, weight, swapped, half):
    """Total of ``even * (2**f - weight) + odd * weight``, the two exchanged where ``swapped``, f = len(weight).

    ``half`` adds 2**(f-1). From 2**f - weight = 1 + sum of 2**i over the bits i of the weight that are 0: one copy of
    the first value and, for each bit of the weight, 2**i times one of the two. That is f adders as wide as the values,
    one look-up table a bit; ``half`` enters as the last one's carry, and exchanging inverts the weight's bits.
    """
    f, width = len(weight), len(even)
    first = Signal(width, name=f"{name}_first")
    m.d.comb += first.eq(Mux(swapped, odd, even))
    done, upper = [], first
    for i in range(f):
        chosen = Signal(width + 1, name=f"{name}_chosen_{i}")
        stage = Signal(width + 1, name=f"{name}_sum_{i}")
        m.d.comb += chosen.eq(Mux(weight[i] ^ swapped, odd, even))
        # a - ~b is a + b + 1: the carry in is free.
        m.d.comb += stage.eq(upper - ~chosen if half and i == f - 1 else upper + chosen)
        done.append(stage[0])
        upper = stage[1:]
    return Cat(*done, upper)


class Bilinear(wiring.Component):
    """(sum of tap * weight + half) >> 2*fraction_bits, weights (2**f - fx)(2**f - fy) and so on.

    The taps come as the four banks deliver them. Rather than sort them into left, right, top and bottom, the weights'
    bits are inverted where the left tap comes from the odd column, the top tap from the odd row.

    Latency: 2 enabled clocks. Throughput: 1 px/clock. No multipliers.

    Parameters
    ----------
    pixel_bits : int
        Bits of each channel.
    channels : int
        Channels side by side in a pixel, blended with the same weights.
    fraction_bits : int
        f, bits of each weight. ValueError for any of the three below 1.

    Members
    -------
    enable : In(1)
    taps : In(ArrayLayout(ArrayLayout(pixel, 2), 2))
        Indexed [row parity][column parity].
    fx, fy : In(fraction_bits)
        Position between the taps, in units of 2**-fraction_bits px.
    odd_column, odd_row : In(1)
        The left tap is in the odd column, the top tap in the odd row.
    pixel : Out(channels * pixel_bits)

    Source: DESIGN section 4; cv2.remap with CV_16SC2 maps and INTER_LINEAR.
    """

    latency = 2

    def __init__(self, pixel_bits, channels, fraction_bits):
        at_least(1, pixel_bits=pixel_bits, channels=channels, fraction_bits=fraction_bits)
        self._pixel_bits = pixel_bits
        self._channels = channels
        pixel = pixel_bits * channels
        super().__init__(
            {
                "enable": In(1),
                "taps": In(data.ArrayLayout(data.ArrayLayout(pixel, 2), 2)),
                "fx": In(fraction_bits),
                "fy": In(fraction_bits),
                "odd_column": In(1),
                "odd_row": In(1),
                "pixel": Out(pixel),
            }
        )

    def elaborate(self, platform):
        m = Module()
        f, bits = len(self.fx), self._pixel_bits
        column_fy = Signal(f, reset_less=True)
        column_odd_row = Signal(reset_less=True)
        with m.If(self.enable):
            m.d.sync += [column_fy.eq(self.fy), column_odd_row.eq(self.odd_row)]

        for channel in range(self._channels):
            rows = []
            for row in range(2):
                even, odd = (tap.word_select(channel, bits) for tap in (self.taps[row][0], self.taps[row][1]))
                blended = blend(m, f"row_{channel}_{row}", even, odd, self.fx, self.odd_column, half=True)
                register = Signal(bits + f, name=f"blended_{channel}_{row}", reset_less=True)
                with m.If(self.enable):
                    m.d.sync += register.eq(blended)
                rows.append(register)
            blended = blend(m, f"column_{channel}", *rows, column_fy, column_odd_row, half=False)
            with m.If(self.enable):
                m.d.sync += self.pixel.word_select(channel, bits).eq(blended[2 * f :])
        return m
