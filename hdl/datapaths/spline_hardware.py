"""The hardware of the spline datapath."""

from amaranth import Cat, Const, Module, Mux, Shape, Signal
from amaranth.lib import data, wiring
from amaranth.lib.memory import Memory
from amaranth.utils import ceil_log2, exact_log2

from hdl.arithmetic.cost import block_width
from hdl.arithmetic.cuts import Stages
from hdl.datapaths.spline_fit import LEAST_CELL

# Memories of up to as many bits go into look-up tables, some 64 to 128 of them.
DISTRIBUTED_BITS = 2048


class SplineCoordinates(wiring.Component):
    """The hardware of `Spline`. Members: `DatapathSignature`.

    In the last steps of each cell the words of the next one are served, v's and then u's, each an increment and a start
    value (which counts in a row's last cell only, where the next cell is the next row's first). Counted from the end of
    the cell, six steps before it v's increment is addressed, and so on, a word a step:

        step before the end    6        5        4        3        2        1
        addressed              v incr.  v start  u incr.  u start
        taken along, written                     v incr.  v start  u incr.  u start
        loaded                                            v                 u

    Two steps after its address a word is in its register: value and slope are taken one row along and written back, and
    an increment gets the remainder of the cell before added and is cut to its length for the third step, in which it
    is loaded, together with the start value in a row's last cell. v is thus two steps ahead of u and waits for it.

    In a frame's first row words come from the half of the RAM that holds the initial ones and is never written, so a
    frame starts from the same state always, and nothing but the RAM's contents need be there at the start: the steps of
    the warm-up are those of a last cell.

    With ``pipeline.ahead`` all that follows from the position alone is registered, so the steps are taken a clock after
    the position is; v is added to its row on the way into the second of the registers in which it waits.

    Latency: `Spline.latency`. Throughput: 1 px/clock.
    """

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        p = self._parameters
        ahead = p.pipeline.ahead
        v, u = p.surfaces
        cells = u.cells

        # Place: all that follows depends on the position alone.
        column = self._column(m)
        cell, step_in_cell = column >> u.along_bits, column[: u.along_bits]
        # In the part by which the first cell is lengthened, where the column is negative, nothing is loaded.
        in_cells = ~column[-1] if cells.offset < 0 else Const(1)
        # The name that Python up to 3.12 would find, and 3.13 not.
        last_cell, next_cell = Signal(), Signal(range(cells.columns), name="next_cell")
        row = Signal(range(p.height))  # that the next cell belongs to
        first_row = Signal()
        m.d.comb += [
            last_cell.eq(cell == cells.columns - 1),
            next_cell.eq(Mux(last_cell, 0, cell + 1)),
            row.eq(self.y + last_cell),
            first_row.eq(self.y == 0),
        ]
        with m.If(last_cell):
            m.d.comb += first_row.eq(self.y == p.height - 1)
            with m.If(first_row):
                m.d.comb += row.eq(0)
        bend_rows = row[: exact_log2(cells.slope_rows)]
        slot = Signal(u.along_bits)
        m.d.comb += slot.eq(step_in_cell + LEAST_CELL)

        # The steps of a position are taken with it, or, ahead, in the next clock that moves on.
        step = moves = self.step
        if ahead:
            moves = self.enable
            step = Signal(name="steps")
            taken = Signal()
            with m.If(self.enable):
                m.d.sync += taken.eq(self.step)
            m.d.comb += step.eq(self.enable & taken)

        def known(name, value):
            return Stages(m, self.step).after(name, value, ahead)

        def acts(name, value):
            """A condition that holds only for a position that is taken: together with ``moves``, in one level less."""
            return Stages(m, self.enable).after(name, self.step & value, reset_less=False) if ahead else value

        serves_v = known("serves_v", slot[1])
        reads = acts("reads", (slot[2:] == 0) & in_cells)
        word_column = known("word_column", Mux(slot[0], cells.columns, next_cell)[: p.column_bits])
        served = ((slot[1:] == 1) | (slot[1:] == 2)) & in_cells
        writes, cuts = acts("writes", served & (~slot[0] | last_cell)), acts("cuts", served & ~slot[0])
        bends = known("bends", bend_rows.all() if len(bend_rows) else Const(1))
        cell_row, later = known("cell_row", row >> exact_log2(cells.cell_height)), known("later", ~first_row)
        loads_v, loads_u = known("loads_v", (slot == 3) & in_cells), known("loads_u", (slot == 5) & in_cells)
        in_last_cell = known("in_last_cell", last_cell)

        # The words.
        ram_shape = data.StructLayout({"value": p.value_format.shape, "slope": p.slope_format.shape})
        words = p.ram_contents()
        style = _style("ram_style", len(words), Shape.cast(ram_shape).width)
        m.submodules.ram = ram = Memory(shape=ram_shape, depth=len(words), init=words, attrs=style)
        rom_reads = self._rom(m)
        ram_read, ram_write = ram.read_port(), ram.write_port()
        word = Signal(ram_shape, reset_less=True)
        bend = Signal(p.bend_format.shape, reset_less=True)
        m.d.comb += [
            ram_read.en.eq(moves & reads),
            ram_read.addr.eq(Cat(serves_v, word_column, later)),
            *(read.en.eq(moves & reads) for read in rom_reads),
            *(read.addr.eq(cell_row * p.rom_pitch + Cat(serves_v, word_column)) for read in rom_reads),
            ram_write.en.eq(moves & writes),
            ram_write.addr.eq(Cat(~serves_v, word_column, Const(1))),
            ram_write.data.value.eq(word.value + word.slope),
            ram_write.data.slope.eq(word.slope + Mux(bends, bend, 0)),
        ]
        with m.If(step):
            m.d.sync += [word.eq(ram_read.data), bend.eq(Cat(read.data for read in rom_reads))]

        # The increments, each with the remainder of the one before.
        remainders = {
            name: Signal(surface.carry_bits, name=f"{name}_remainder", reset_less=True)
            for name, surface in (("v", v), ("u", u))
        }
        half = (1 << u.carry_bits) >> 1
        total = Signal.like(word.value + half)
        m.d.comb += total.eq(word.value + Mux(in_last_cell, half, Mux(serves_v, remainders["v"], remainders["u"])))
        increment_shape = max(
            (p.formats["u_increment"], p.formats["v_less_row_increment"]), key=lambda q: q.width
        ).shape
        cut = Signal(increment_shape, reset_less=True)
        with m.If(moves & cuts):
            m.d.sync += cut.eq(total >> u.carry_bits)
            with m.If(serves_v):
                m.d.sync += remainders["v"].eq(total)
            with m.Else():
                m.d.sync += remainders["u"].eq(total)

        # Along the row.
        values = {}
        for name, surface, loads in (("v", v, loads_v), ("u", u, loads_u)):
            label = "u" if name == "u" else "v_less_row"
            increment = Signal(p.formats[f"{label}_increment"].shape, name=f"{name}_increment", reset_less=True)
            values[name] = value = Signal(p.formats[label].shape, name=f"{name}_value", reset_less=True)
            start = word.value >> (surface.word_bits + surface.start_bits - surface.value_bits)
            with m.If(step):
                m.d.sync += value.eq(Mux(loads & in_last_cell, start, value + increment))
                with m.If(loads):
                    m.d.sync += increment.eq(cut)

        cut_bits = u.value_bits - p.fraction_bits
        v_less_row = values["v"] >> cut_bits
        waiting = Signal.like(v_less_row, name="v_waiting", reset_less=True)
        coordinate = Signal.like(self.v, name="v_coordinate", reset_less=True)
        # Ahead, the position is the next one already.
        row_of_v = self.y << p.fraction_bits
        with m.If(step):
            m.d.sync += [waiting.eq(v_less_row), coordinate.eq(waiting + row_of_v if ahead else waiting)]
        m.d.comb += [
            self.u.eq(values["u"] >> cut_bits),
            self.v.eq(coordinate if ahead else coordinate + row_of_v),
        ]
        return m

    def _rom(self, m):
        """Read ports of the memories of the bends, lowest bits first: one, or in slices of a block RAM each, so that
        there is nothing between those and the register behind them."""
        p = self._parameters
        contents, width = p.rom_contents(), p.bend_format.width
        slice_width = block_width(len(contents)) if p.pipeline.blocks else width
        style, reads = _style("rom_style", len(contents), width), []
        for low in range(0, width, slice_width):
            bits = min(slice_width, width - low)
            words = [(word >> low) % 2**bits for word in contents]
            memory = Memory(shape=bits, depth=len(words), init=words, attrs=style)
            m.submodules["rom" if bits == width else f"rom_{low}"] = memory
            reads.append(memory.read_port())
        return reads

    def _column(self, m):
        """The position's column in the cells: from the first one's left edge."""
        p = self._parameters
        cells = p.u_surface.cells
        bits = ceil_log2(cells.columns * cells.cell_width) + (cells.offset < 0)
        if not (p.pipeline.ahead and cells.offset):
            column = Signal(bits)
            m.d.comb += column.eq(self.x + cells.offset)
            return column
        column = Signal(bits, init=(-p.warm_up % p.width + cells.offset) % 2**bits)
        with m.If(self.step):
            m.d.sync += column.eq(Mux(self.end_of_line, cells.offset % 2**bits, column + 1))
        return column


def _style(style, words, width):
    """Attributes of a memory that shall be in block RAM; if it is small, tools put it into look-up tables."""
    return {style: "block"} if words * width > DISTRIBUTED_BITS else {}
