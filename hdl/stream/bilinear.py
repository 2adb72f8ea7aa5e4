"""Bilinear interpolation of a 2x2 window, bit for bit cv2.remap's."""

from amaranth import Module
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In, Out

from hdl.arithmetic.cuts import COMPACT, Stages
from hdl.errors import at_least
from hdl.stream.blend import BLENDS


def latency(fraction_bits, pipeline):
    """Enabled clocks from the taps to the pixel of a `Bilinear`."""
    return 2 * BLENDS[pipeline.interpolator](fraction_bits).latency - 1 + _is_registered(pipeline)


def _is_registered(pipeline):
    """Whether the pixel is."""
    return pipeline.result or not pipeline.ports


class Bilinear(wiring.Component):
    """(sum of tap * weight + half) >> 2*fraction_bits, weights (2**f - fx)(2**f - fy) and so on.

    The taps come as the four banks deliver them. Rather than sort them into left, right, top and bottom, the weights
    are exchanged where the left tap comes from the odd column, the top tap from the odd row.

    Latency: ``latency`` enabled clocks from the taps. Throughput: 1 px/clock. No multipliers.

    Parameters
    ----------
    pixel_bits : int
        Bits of each channel.
    channels : int
        Channels side by side in a pixel, blended with the same weights.
    fraction_bits : int
        f, bits of each weight. ValueError for any of the three below 1.
    lead : int
        Enabled clocks by which what is said of the window comes before its taps.
    pipeline : Pipeline
        Its interpolator; with ``ports`` the last register is left to `OutputSkid`, unless there is a ``result``'s.

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

    def __init__(self, pixel_bits, channels, fraction_bits, lead=0, pipeline=COMPACT):
        at_least(1, pixel_bits=pixel_bits, channels=channels, fraction_bits=fraction_bits)
        at_least(0, lead=lead)
        self._pixel_bits = pixel_bits
        self._channels = channels
        self._lead = lead
        self._pipeline = pipeline
        self.latency = latency(fraction_bits, pipeline)
        self._blend = BLENDS[pipeline.interpolator](fraction_bits)
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
        f, bits, blend = len(self.fx), self._pixel_bits, self._blend
        stages = Stages(m, self.enable)

        def weights(name, fraction, odd, clocks):
            """`Blend.recoded`, from what waits in shift registers, into the last of the registers."""
            before = max(clocks - 1, 0)
            fraction, odd = stages.after(f"{name}_fraction", fraction, before), stages.after(f"{name}_odd", odd, before)
            return stages.after(f"{name}_weights", blend.recoded(fraction, odd), clocks - before)

        column_weights = weights("column", self.fx, self.odd_column, self._lead)
        row_weights = weights("row", self.fy, self.odd_row, self._lead + blend.latency)
        channels = range(self._channels)
        pairs = [
            tuple(self.taps[row][column].word_select(channel, bits) for column in range(2))
            for channel in channels
            for row in range(2)
        ]
        blended = blend.totals(m, stages, "row", pairs, column_weights, half=True)
        rows = [stages.after(f"blended_{index // 2}_{index % 2}", total) for index, total in enumerate(blended)]
        totals = blend.totals(m, stages, "column", list(zip(rows[::2], rows[1::2])), row_weights, half=False)
        for channel, total in zip(channels, totals):
            pixel = stages.after(f"pixel_{channel}", total[2 * f :], _is_registered(self._pipeline))
            m.d.comb += self.pixel.word_select(channel, bits).eq(pixel)
        return m
