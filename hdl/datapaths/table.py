"""Every coordinate stored: the paper's LUT-based method."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from amaranth import Module, Signal
from amaranth.lib import data, wiring
from amaranth.lib.memory import Memory
from amaranth.utils import ceil_log2

from hdl.arithmetic.cost import Cost, block_rams
from hdl.arithmetic.cuts import Stages
from hdl.arithmetic.fixedpoint import Q
from hdl.datapaths.base import Datapath, check_budget
from hdl.errors import InputError
from hdl.geometry.coordinates import Coordinates

# Entries of the largest table that is built: Yosys reads so many words of Verilog in a minute or so, and the time grows
# in proportion.
MOST_ENTRIES = 1 << 16


@dataclass(frozen=True, eq=False)
class Table(Datapath):
    """u and v of every pixel, rounded, in one memory that is read in raster order.

    No arithmetic, hence no error but the rounding, and any map. The price is ``memory_bits``: an entry for every pixel,
    6.5 Mbit for the embedded rig at 640x480 without the lens. That is with each coordinate stored as its distance from
    the output pixel where this takes fewer bits. Frames of more than `MOST_ENTRIES` pixels are refused.

    Latency: 2, the memory and the register behind it, and 1 more where the pipeline has a register behind ``taps`` and
    something is added to what is stored; 1 px/clock.

    Parameters
    ----------
    used : Coordinates

    Source: Hyun and Moon 2015, section 1, on methods with look-up tables.
    """

    name = "table"
    summary = "every coordinate stored in one memory"
    supports_lens = True

    used: Coordinates

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        if max_error is not None:
            check_budget(max_error, fraction_bits)
        table = cls.of(view, fraction_bits)
        if table.entries > MOST_ENTRIES:
            raise InputError(
                "--size",
                None,
                f"{view.width}x{view.height}",
                f"a {cls.name} has {table.entries} entries of {table.entry_bits} bits, {table.memory_bits / 1e6:.1f} "
                f"Mbit; more than {MOST_ENTRIES} entries are not built",
            )
        return table

    @classmethod
    def of(cls, view, fraction_bits):
        """The table for ``view``, of any size: for its figures, where it is too large to be built."""

        # All that lies outside the image is the border's, however far.
        def used(exact, size):
            lowest, highest = -1 << fraction_bits, size << fraction_bits
            return lambda rows: np.clip(np.floor(exact[rows] * 2.0**fraction_bits + 0.5), lowest, highest)

        u, v = (used(exact, size) for exact, size in zip(view.map(), view.source_size))
        coordinates = Coordinates.banded((view.height, view.width), fraction_bits, u, v)
        return cls(view.width, view.height, fraction_bits, coordinates)

    @property
    def coordinates(self):
        return self.used

    @property
    def entries(self):
        return self.width * self.height

    @property
    def entry_bits(self):
        return sum(q.width for q in self.formats.values())

    @property
    def memory_bits(self):
        return self.entries * self.entry_bits

    @cached_property
    def stored(self):
        """What the memory holds for each axis: the name of its format, and int32 (height, width)."""
        x, y = np.arange(self.width, dtype=np.int32), np.arange(self.height, dtype=np.int32)[:, None]
        stored = {}
        for axis, coordinate, position, relative in (
            ("u", self.used.u, x, "u_less_column"),
            ("v", self.used.v, y, "v_less_row"),
        ):
            candidates = [(axis, coordinate), (relative, coordinate - (position << self.fraction_bits))]
            stored[axis] = min(candidates, key=lambda candidate: self._format(candidate[1]).width)
        return stored

    def _format(self, values):
        return Q.covering(values.min(), values.max(), self.fraction_bits)

    @cached_property
    def formats(self):
        return {name: self._format(values) for name, values in self.stored.values()}

    @property
    def registers_words(self):
        """Whether there is a register between the memory's block RAMs and an adder."""
        return self.pipeline.taps and any(name != axis for axis, (name, _) in self.stored.items())

    @property
    def latency(self):
        return 2 + self.registers_words

    @property
    def cost(self):
        # Without the multiplexers between block RAMs, some 10 to 150 LUT: how they are arranged is up to the tools.
        outputs = sum(q.width for q in self.coordinate_formats)
        counter = ceil_log2(self.entries)
        waiting = ceil_log2(self.width) + ceil_log2(self.height)
        selecting = max(counter - 10, 0)
        ff = outputs + counter + waiting + selecting + self.registers_words * (self.entry_bits + waiting)
        return Cost(outputs + counter + 4, ff, block_rams(self.entries, self.entry_bits))

    def contents(self):
        """The memory's words in raster order, {axis: integer}."""
        (_, u), (_, v) = self.stored.values()
        return [{"u": u, "v": v} for u, v in zip(u.ravel().tolist(), v.ravel().tolist())]

    def component(self):
        return StoredCoordinates(self)


class StoredCoordinates(wiring.Component):
    """The hardware of `Table`: an address that counts, the memory, and the pixel's own position added where it is left
    out there. 1 px/clock. Members: `DatapathSignature`.
    """

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        p = self._parameters
        u, v = p.formats.values()
        m.submodules.memory = memory = Memory(
            shape=data.StructLayout({"u": u.shape, "v": v.shape}),
            depth=p.entries,
            init=p.contents(),
            attrs={"rom_style": "block"},
        )
        read = memory.read_port()
        address = Signal(ceil_log2(p.entries))
        m.d.comb += [read.en.eq(self.enable), read.addr.eq(address)]
        with m.If(self.step):
            m.d.sync += address.eq(address + 1)
            with m.If(self.end_of_frame):
                m.d.sync += address.eq(0)
        stages = Stages(m, self.enable)
        words = p.latency - 2
        for (axis, (name, _)), position, out in zip(p.stored.items(), (self.x, self.y), (self.u, self.v)):
            value = stages.after(f"{axis}_word", read.data[axis], words)
            if name != axis:
                value = value + (stages.after(f"{axis}_place", position, 1 + words) << p.fraction_bits)
            coordinate = Signal.like(out, name=f"{axis}_coordinate", reset_less=True)
            with m.If(self.enable):
                m.d.sync += coordinate.eq(value)
            m.d.comb += out.eq(coordinate)
        return m
