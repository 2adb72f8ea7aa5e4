"""Any map, lens and fisheye included, by additions and a little memory: a discrete tensor-product spline."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from amaranth import Cat, Const, Module, Mux, Shape, Signal
from amaranth.lib import data, wiring
from amaranth.lib.memory import Memory
from amaranth.utils import ceil_log2, exact_log2

from hdl.coordinates import Coordinates
from hdl.cost import Cost, block_rams
from hdl.datapaths.base import Datapath, check_budget, fitted_budget
from hdl.datapaths.spline_fit import LEAST_CELL, Cells, Fit
from hdl.errors import BudgetError
from hdl.fixedpoint import Q

# Memories of up to as many bits go into look-up tables, some 64 to 128 of them.
DISTRIBUTED_BITS = 2048


@dataclass(frozen=True, eq=False)
class Surface:
    """One coordinate's spline, quantised.

    Parameters
    ----------
    cells : Cells
    node_bits, increment_bits : int
        Fraction bits of the controls, and of a cell's increment.
    fraction_bits : int
        Of the coordinate.
    nodes : int64 (columns + 1, rows + 2)
        Controls in units of 2**-node_bits px.
    """

    cells: Cells
    node_bits: int
    increment_bits: int
    fraction_bits: int
    nodes: np.ndarray

    @property
    def start_bits(self):
        """Fraction bits of the row's start value beyond the nodes': none where a node stands at column 0."""
        return self.along_bits if self.cells.offset else 0

    @property
    def along_bits(self):
        """log2 of the cell width: fraction bits of an increment per pixel beyond those of one per cell."""
        return exact_log2(self.cells.cell_width)

    @property
    def value_bits(self):
        """Fraction bits of the accumulator along the row."""
        return self.increment_bits + self.along_bits

    @property
    def word_bits(self):
        """Fraction bits of a cell's increment as it is accumulated down the rows."""
        return self.node_bits + exact_log2(self.cells.scale)

    @property
    def carry_bits(self):
        """Low bits of a cell's increment that are carried to the next cell."""
        return self.word_bits - self.increment_bits

    @cached_property
    def start_controls(self):
        """Controls of the row's start value, int64 (rows + 2,), in units of 2**-(node_bits + start_bits) px.

        Exactly where the first cell's line meets column 0.
        """
        first, second = self.nodes[0], self.nodes[1]
        return (first << self.start_bits) + (self.cells.offset * (second - first) if self.start_bits else 0)

    @cached_property
    def cell_controls(self):
        """Controls of the cells' increments, int64 (columns, rows + 2), in units of 2**-node_bits px."""
        return np.diff(self.nodes, axis=0)

    @cached_property
    def start_half(self):
        """Half an output unit and half an accumulator unit, in the start value's, so that truncations round."""
        unit = self.word_bits + self.start_bits
        return (1 << (unit - self.fraction_bits - 1)) + ((1 << (unit - self.value_bits)) >> 1)

    @cached_property
    def values(self):
        """The accumulator's value at every pixel, int64 (height, width), in units of 2**-value_bits px."""
        return self.values_in(slice(None))

    def values_in(self, rows):
        """`values` in some rows (an index into them).

        In closed form: the nodes' values are rounded to the increment's units one by one, since the remainders are
        carried along the row.
        """
        cells, basis = self.cells, self.cells.basis[rows]
        start = (basis @ self.start_controls + self.start_half) >> (self.word_bits + self.start_bits - self.value_bits)
        travelled = np.cumsum(basis @ self.cell_controls.T, axis=1)
        nodes = np.zeros((len(basis), cells.columns + 1), np.int64)
        nodes[:, 1:] = (travelled + ((1 << self.carry_bits) >> 1)) >> self.carry_bits
        cell, distance = cells.place
        line = nodes[:, cell] * cells.cell_width + (nodes[:, cell + 1] - nodes[:, cell]) * distance
        return line - cells.offset * nodes[:, 1:2] + start[:, None]

    @cached_property
    def words(self):
        """Accumulated words (value, slope) down the rows, int64 (height, columns + 1) each; the start's in the last."""
        controls = np.vstack([self.cell_controls, self.start_controls])
        values, slopes = self.cells.basis @ controls.T, self.cells.slope_basis @ controls.T
        values[:, -1] += self.start_half
        return values, slopes

    @cached_property
    def bends(self):
        """Second differences of the controls, int64 (rows, columns + 1): what is added to the slopes."""
        controls = np.vstack([self.cell_controls, self.start_controls])
        return np.diff(controls, n=2, axis=1).T

    @cached_property
    def increments(self):
        """Least and greatest increment along the row, in units of 2**-value_bits px."""
        travelled = np.cumsum(self.cells.basis @ self.cell_controls.T, axis=1)
        nodes = (travelled + ((1 << self.carry_bits) >> 1)) >> self.carry_bits
        steps = np.diff(nodes, axis=1, prepend=0)
        return int(steps.min()), int(steps.max())


@dataclass(frozen=True, eq=False)
class Spline(Datapath):
    """Source coordinates as splines: along a row straight lines from node to node, down the columns quadratic ones.

    Each row starts from its start value and adds an increment a pixel, which changes from cell to cell; the start value
    and each cell's increment are themselves accumulated down the rows, by value and slope, and the slope bends every
    few rows. Values and slopes are in one small RAM, the bends in a ROM, both shared by u and v, and one pair of adders
    takes them all along. v is kept relative to the output row.

    165 LUT, 154 FF and 2 RAMB18 with the lens, 229 LUT and 179 FF without (README, the ladder: coordinates of the
    embedded rig, 640x480, 0.05 px). Latency 0, 1 px/clock.

    Parameters
    ----------
    u_surface, v_surface : Surface
        v's less the output row.

    Source: DESIGN section 3; the mesh of Akin et al., VLSI-SoC 2013, is degree 1 both ways.
    """

    name = "spline"
    summary = "a discrete spline fitted to the map, adders and a little memory"
    supports_lens = True

    u_surface: Surface
    v_surface: Surface

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        budget = fitted_budget(fraction_bits) if max_error is None else max_error
        check_budget(budget, fraction_bits)
        return _Search(view, fraction_bits, budget).best()

    @cached_property
    def coordinates(self):
        shift = self.u_surface.value_bits - self.fraction_bits
        rows = np.arange(self.height)[:, None] << self.fraction_bits
        u = self.u_surface.values >> shift
        v = (self.v_surface.values >> shift) + rows
        return Coordinates(u.astype(np.int32), v.astype(np.int32), self.fraction_bits)

    @property
    def surfaces(self):
        """Both surfaces, v's first: the order in which the hardware serves them."""
        return self.v_surface, self.u_surface

    @property
    def latency(self):
        return 0

    @property
    def warm_up(self):
        return self.u_surface.cells.cell_width

    @cached_property
    def value_format(self):
        """Of the accumulated values in the RAM (u's, v's, increments and starts alike)."""
        values = [surface.words[0] for surface in self.surfaces]
        return Q.covering(min(v.min() for v in values), max(v.max() for v in values), self.u_surface.word_bits)

    @cached_property
    def slope_format(self):
        """Of the slopes in the RAM."""
        slopes = [surface.words[1] for surface in self.surfaces]
        return Q.covering(min(s.min() for s in slopes), max(s.max() for s in slopes), self.u_surface.word_bits)

    @cached_property
    def bend_format(self):
        """Of the bends in the ROM."""
        bends = [surface.bends for surface in self.surfaces]
        return Q.covering(min(b.min() for b in bends), max(b.max() for b in bends), self.u_surface.word_bits)

    @property
    def formats(self):
        formats = {"value": self.value_format, "slope": self.slope_format, "bend": self.bend_format}
        for name, surface in (("u", self.u_surface), ("v_less_row", self.v_surface)):
            formats[name] = Q.covering(int(surface.values.min()), int(surface.values.max()), surface.value_bits)
            formats[f"{name}_increment"] = Q.covering(*surface.increments, surface.value_bits)
        return formats

    @property
    def column_bits(self):
        """Address bits of a column: the cells and, after them, the start value."""
        return ceil_log2(self.u_surface.cells.columns + 1)

    @property
    def rom_pitch(self):
        """ROM words from one row of cells to the next: a power of two where that needs no more block RAM."""
        exact = 2 * (self.u_surface.cells.columns + 1)
        padded = 2 << self.column_bits
        rows = self.u_surface.cells.rows
        width = self.bend_format.width
        return padded if block_rams(rows * padded, width) <= block_rams(rows * exact, width) else exact

    @cached_property
    def cost(self):
        formats = {name: q.width for name, q in self.formats.items()}
        waiting = formats["v_less_row"] - (self.v_surface.value_bits - self.fraction_bits)
        word = formats["value"] + formats["slope"]
        ff = (
            sum(formats.values())
            + 2 * self.u_surface.carry_bits
            + 2 * waiting
            + max(formats["u_increment"], formats["v_less_row_increment"])
        )
        lut, ramb18 = ff + 12, 0
        for words, width, lut_a_word in (
            (4 << self.column_bits, word, 1.4 * word / 64),
            (self.rom_pitch * self.u_surface.cells.rows, formats["bend"], formats["bend"] / 16),
        ):
            if words * width > DISTRIBUTED_BITS:
                ramb18 += block_rams(words, width)
            else:
                lut += words * lut_a_word
                ff += width  # the read register, which block RAM has inside
        return Cost(round(lut), round(ff), ramb18)

    def ram_contents(self):
        """Initial words: those of row 0 in the lower half, at 2*column and, for u, one more."""
        contents = [{"value": 0, "slope": 0}] * (4 << self.column_bits)
        for which, surface in enumerate(self.surfaces):
            values, slopes = surface.words
            for column in range(surface.cells.columns + 1):
                contents[2 * column + which] = {"value": int(values[0, column]), "slope": int(slopes[0, column])}
        return contents

    def rom_contents(self):
        """The bends, row of cells by row of cells, ordered like the RAM's words."""
        contents = [0] * (self.rom_pitch * self.u_surface.cells.rows)
        for which, surface in enumerate(self.surfaces):
            for (row, column), bend in np.ndenumerate(surface.bends):
                contents[row * self.rom_pitch + 2 * column + which] = int(bend)
        return contents

    def component(self):
        return SplineCoordinates(self)


class _Search:
    """The search of `Spline.fit`: the cells that take the least memory, with the fewest bits that do.

    Cells that the map's own curvature rules out are not tried; the others are fitted, and word lengths raised until the
    integer model is within the budget at every pixel.
    """

    CELL_WIDTHS = (64, 32, 16, 8)
    CELL_HEIGHTS = (128, 64, 32, 16, 8)
    SLOPES = (2, 4, 8)
    MOST_BITS = 12

    def __init__(self, view, fraction_bits, budget):
        self.view, self.fraction_bits, self.budget = view, fraction_bits, budget
        u, v = view.map()
        self.inside = view.inside
        self.targets = u, v - np.arange(view.height)[:, None]
        self.reached = np.inf

    def best(self):
        """The cheapest `Spline` within the budget; raises InputError where there is none."""
        found = None
        for cells in sorted(self._cells(), key=_cost):
            if found and _cost(cells)[0] >= found.cost.ramb18:
                break
            candidate = self._quantised(cells)
            if candidate and (not found or candidate.cost.ramb18 < found.cost.ramb18):
                found = candidate
        if not found:
            if not np.isfinite(self.reached):
                self._fit_finest()
            raise BudgetError(self.budget, self.reached, f"spline for the {self.view.side} camera")
        return found

    def _fit_finest(self):
        """Find out what the finest cells reach."""
        view, height = self.view, self.CELL_HEIGHTS[-1]
        cells = Cells(view.width, view.height, self.CELL_WIDTHS[-1], height, height // self.SLOPES[1])
        error = max(Fit(cells, target, self.inside).error for target in self.targets)
        self.reached = error + self.budget - self.slack

    @property
    def slack(self):
        """What rounding to the output's fraction leaves of the budget, px."""
        return self.budget - 2.0 ** -(self.fraction_bits + 1)

    def _cells(self):
        """Cells that may do."""
        view = self.view
        bend_across, bend_down = (
            max(
                np.abs(np.diff(target, n=order, axis=axis)[_inner(self.inside, order, axis)]).max(initial=0)
                for target in self.targets
            )
            for order, axis in ((2, 1), (3, 0))
        )
        for cell_width in self.CELL_WIDTHS:
            # A line through a parabola of that bend is off by at least this much, were only its ends free.
            if bend_across * cell_width**2 / 16 > 2 * self.slack or cell_width >= view.width:
                continue
            for cell_height in self.CELL_HEIGHTS:
                for slopes in self.SLOPES:
                    if cell_height > slopes:
                        yield Cells(view.width, view.height, cell_width, cell_height, cell_height // slopes)

    def _quantised(self, cells):
        fits = []
        for target in self.targets:
            fits.append(Fit(cells, target, self.inside))
            self.reached = min(self.reached, fits[-1].error + self.budget - self.slack)
            if fits[-1].error > self.slack:
                return None
        lengths = sorted(
            ((node, increment) for node in range(3, self.MOST_BITS) for increment in range(3, self.MOST_BITS)),
            key=lambda pair: (sum(pair), pair),
        )
        coarse = np.arange(0, cells.height, 7)
        for node_bits, increment_bits in lengths:
            rounding = 2.0 ** -(node_bits + 1) + 2.0 ** -(increment_bits + 1)
            if max(fit.error for fit in fits) + rounding / 2 > self.slack:
                continue
            along_bits = exact_log2(cells.cell_width)
            if not self.fraction_bits <= increment_bits + along_bits <= node_bits + exact_log2(cells.scale):
                continue
            surfaces = [
                Surface(
                    cells,
                    node_bits,
                    increment_bits,
                    self.fraction_bits,
                    np.round(fit.controls * 2.0**node_bits).astype(np.int64),
                )
                for fit in fits
            ]
            if all(
                self._error(surface, target, rows) <= self.budget
                for rows in (coarse, slice(None))
                for surface, target in zip(surfaces, self.targets)
            ):
                return Spline(cells.width, cells.height, self.fraction_bits, *surfaces)
        return None

    def _error(self, surface, target, rows):
        used = surface.values_in(rows) >> (surface.value_bits - self.fraction_bits)
        return np.abs(used * 2.0**-self.fraction_bits - target[rows])[self.inside[rows]].max(initial=0)


def _inner(inside, order, axis):
    """Where a difference of this order has all its samples inside."""
    length = inside.shape[axis] - order
    return np.logical_and.reduce(
        [np.take(inside, range(shift, shift + length), axis=axis) for shift in range(order + 1)]
    )


def _cost(cells):
    """What to try first: block RAM at the least, then words stored, then bits of a word."""
    words = cells.rows * 2 * (cells.columns + 1)
    return block_rams(4 << ceil_log2(cells.columns + 1), 30) + block_rams(words, 9), words, cells.scale


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

    Latency: none. Throughput: 1 px/clock.
    """

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        p = self._parameters
        v, u = p.surfaces
        cells = u.cells

        # Place: all that follows depends on the position alone.
        column = Signal(ceil_log2(cells.columns * cells.cell_width) + (cells.offset < 0))
        cell, step_in_cell = column >> u.along_bits, column[: u.along_bits]
        # In the part by which the first cell is lengthened, where the column is negative, nothing is loaded.
        in_cells = ~column[-1] if cells.offset < 0 else Const(1)
        last_cell, next_cell = Signal(), Signal(range(cells.columns))
        row = Signal(range(p.height))  # that the next cell belongs to
        first_row = Signal()
        m.d.comb += [
            column.eq(self.x + cells.offset),
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
        bends = bend_rows.all() if len(bend_rows) else Const(1)

        slot = Signal(u.along_bits)
        m.d.comb += slot.eq(step_in_cell + LEAST_CELL)
        is_start = slot[0]
        reads = (slot[2:] == 0) & in_cells
        word_column = Mux(is_start, cells.columns, next_cell)[: p.column_bits]
        served = ((slot[1:] == 1) | (slot[1:] == 2)) & in_cells
        serves_u = ~slot[1]

        # The words.
        ram_shape = data.StructLayout({"value": p.value_format.shape, "slope": p.slope_format.shape})
        m.submodules.ram = ram = _memory(ram_shape, p.ram_contents(), "ram_style")
        m.submodules.rom = rom = _memory(p.bend_format.shape, p.rom_contents(), "rom_style")
        ram_read, ram_write, rom_read = ram.read_port(), ram.write_port(), rom.read_port()
        word = Signal(ram_shape, reset_less=True)
        bend = Signal(p.bend_format.shape, reset_less=True)
        m.d.comb += [
            ram_read.en.eq(self.step & reads),
            ram_read.addr.eq(Cat(slot[1], word_column, ~first_row)),
            rom_read.en.eq(self.step & reads),
            rom_read.addr.eq((row >> exact_log2(cells.cell_height)) * p.rom_pitch + Cat(slot[1], word_column)),
            ram_write.en.eq(self.step & served & (~is_start | last_cell)),
            ram_write.addr.eq(Cat(serves_u, word_column, Const(1))),
            ram_write.data.value.eq(word.value + word.slope),
            ram_write.data.slope.eq(word.slope + Mux(bends, bend, 0)),
        ]
        with m.If(self.step):
            m.d.sync += [word.eq(ram_read.data), bend.eq(rom_read.data)]

        # The increments, each with the remainder of the one before.
        remainders = {
            name: Signal(surface.carry_bits, name=f"{name}_remainder", reset_less=True)
            for name, surface in (("v", v), ("u", u))
        }
        half = (1 << u.carry_bits) >> 1
        total = Signal.like(word.value + half)
        m.d.comb += total.eq(word.value + Mux(last_cell, half, Mux(serves_u, remainders["u"], remainders["v"])))
        increment_shape = max(
            (p.formats["u_increment"], p.formats["v_less_row_increment"]), key=lambda q: q.width
        ).shape
        cut = Signal(increment_shape, reset_less=True)
        with m.If(self.step & served & ~is_start):
            m.d.sync += cut.eq(total >> u.carry_bits)
            with m.If(serves_u):
                m.d.sync += remainders["u"].eq(total)
            with m.Else():
                m.d.sync += remainders["v"].eq(total)

        # Along the row.
        values = {}
        for name, surface, loads in (("v", v, (slot == 3) & in_cells), ("u", u, (slot == 5) & in_cells)):
            label = "u" if name == "u" else "v_less_row"
            increment = Signal(p.formats[f"{label}_increment"].shape, name=f"{name}_increment", reset_less=True)
            values[name] = value = Signal(p.formats[label].shape, name=f"{name}_value", reset_less=True)
            start = word.value >> (surface.word_bits + surface.start_bits - surface.value_bits)
            with m.If(self.step):
                m.d.sync += value.eq(Mux(loads & last_cell, start, value + increment))
                with m.If(loads):
                    m.d.sync += increment.eq(cut)

        cut_bits = u.value_bits - p.fraction_bits
        v_less_row = values["v"] >> cut_bits
        for ahead in (1, 0):
            waiting = Signal.like(v_less_row, name=f"v_less_row_{ahead}_ahead", reset_less=True)
            with m.If(self.step):
                m.d.sync += waiting.eq(v_less_row)
            v_less_row = waiting
        m.d.comb += [
            self.u.eq(values["u"] >> cut_bits),
            self.v.eq(v_less_row + (self.y << p.fraction_bits)),
        ]
        return m


def _memory(shape, contents, style):
    """A memory in block RAM; if it is small, tools put it into look-up tables."""
    bits = len(contents) * Shape.cast(shape).width
    attributes = {style: "block"} if bits > DISTRIBUTED_BITS else {}
    return Memory(shape=shape, depth=len(contents), init=contents, attrs=attributes)
