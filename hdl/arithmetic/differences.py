"""Polynomials of the raster position by integer forward differences, and their accumulation over the raster."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import comb

import numpy as np
from amaranth import Cat, Const, Module, Mux, ResetInserter, Signal, signed
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2, exact_log2

from hdl.arithmetic.bands import bands
from hdl.arithmetic.fixedpoint import Q


def functions_along(size, degree, cell):
    """Functions of a column (or row) that a polynomial is a sum of: ``size`` lists of degree + 1 Python integers.

    The first is 1. The k-th is cell * C(i, k) at column i * cell and linear from each of these columns to the next: a
    polynomial of degree k but for its chords, and C(x, k) itself where a cell is one column.
    """
    return [
        [1, *(cell * comb(i, k) + distance * comb(i, k - 1) for k in range(1, degree + 1))]
        for i, distance in (divmod(x, cell) for x in range(size))
    ]


@lru_cache(maxsize=32)
def wrapped_functions(size, degree, cell):
    """`functions_along`, `wrapped`; read-only."""
    array = wrapped(functions_along(size, degree, cell))
    array.setflags(write=False)
    return array


def wrapped(integers):
    """An int64 array of Python integers modulo 2**64: right in every sum whose value fits into 64 bits."""
    return np.array([[value % 2**64 for value in row] for row in integers], dtype=np.uint64).view(np.int64)


def value_name(k):
    """What `DifferenceForm.sequences` calls the k-th difference along the row."""
    return f"d{k}" if k else "value"


def jump_name(k, n):
    """What `DifferenceForm.sequences` calls the n-th difference, down the rows, of the k-th difference's jump."""
    return "_".join([f"d{k}"] * (k > 0) + ["jump"] + [f"d{n}"] * (n > 0))


@dataclass(frozen=True)
class Sequence:
    """What one accumulated value runs through in a frame.

    Parameters
    ----------
    order : int
        Differences taken, jumps counted as one.
    lowest, highest : int
        Over the frame, exhaustive.
    fixed_bits : int
        Trailing bits that all its values have in common.
    starts : tuple of int
        At the start of the first rows, as many as are in a cell.
    """

    order: int
    lowest: int
    highest: int
    fixed_bits: int
    starts: tuple[int, ...]

    @classmethod
    def of(cls, order, parts, rows):
        """From int64 arrays (height,) or (height, any), one below the other, of which the first ``rows`` rows are in a
        cell."""
        starts, spans, changing = [], [], 0
        for part in parts:
            starts += part.reshape(len(part), -1)[: rows - len(starts), 0].tolist()
            spans += [int(part.min()), int(part.max())]
            changing |= int(np.bitwise_or.reduce(part ^ starts[0], axis=None))
        fixed_bits = max((changing & -changing).bit_length() - 1, 0)
        return cls(order, min(spans), max(spans), fixed_bits, tuple(starts))

    @property
    def stored(self):
        """The sequence as its register holds it: negated where the order is odd.

        All additions are then subtractions, in which synthesis takes the register itself for the carry and has the rest
        of the look-up table for the choice of what is subtracted.
        """
        if self.order % 2 == 0:
            return self
        return Sequence(0, -self.highest, -self.lowest, self.fixed_bits, tuple(-start for start in self.starts))

    @property
    def changes_sign(self):
        return self.lowest < 0 <= self.highest

    @property
    def bits(self):
        """Bits that tell its values apart: without the leading and trailing ones that all have in common."""
        if self.changes_sign:
            return Q.covering(self.lowest, self.highest, 0).width - self.fixed_bits
        return (self.lowest ^ self.highest).bit_length() - self.fixed_bits


@dataclass(frozen=True, eq=False)
class DifferenceForm:
    """A polynomial of the raster position with integer coefficients, in units of 2**-fraction_bits.

    The sum of coefficients[k, l] * f_k(x) * g_l(y), with `functions_along` f for cells of ``cell_width`` columns and g
    for cells of ``cell_height`` rows. Where the latter are of more than one row, the degree is 2 at most, and the
    coefficient of x*y, to which the far corner is most sensitive, has log2(cell_height) fraction bits more: its sum
    down the rows, a part of the slope with which a row starts, is rounded to the unit of the others.

    Parameters
    ----------
    coefficients : int64 (degree + 1, degree + 1)
        Zero for k + l > degree.
    cell_width, cell_height : int
        Powers of two.
    fraction_bits : int
    width, height : int
        Frame size, px.
    """

    coefficients: np.ndarray
    cell_width: int
    cell_height: int
    fraction_bits: int
    width: int
    height: int

    @property
    def degree(self):
        return len(self.coefficients) - 1

    @property
    def cells(self):
        """Cells along a row."""
        return (self.width - 1) // self.cell_width + 1

    def values(self, rows=slice(None)):
        """The values at all pixels of some rows (an index into them), int64; in closed form, no accumulation."""
        functions = wrapped_functions(self.width, self.degree, self.cell_width)
        return self.row_coefficients[: self.height][rows] @ functions.T

    @cached_property
    def row_coefficients(self):
        """What the functions of the column are multiplied by in each row and some beyond the last: int64."""
        rows = self.height + self.degree
        sums = wrapped_functions(rows, self.degree, self.cell_height) @ self.coefficients.T
        if self.cell_height > 1 and self.degree > 1:
            finer = np.arange(rows) * self.coefficients[1, 1] + self.cell_height // 2
            sums[:, 1] = self.coefficients[1, 0] + (finer >> exact_log2(self.cell_height))
        return sums

    def difference(self, k):
        """The k-th difference along the row, k >= 1: int64 (height, cells), in closed form."""
        table = wrapped_functions(self.cells, self.degree - k, 1)
        return self.row_coefficients[: self.height, k:] @ table.T

    def jump(self, k):
        """What the k-th difference, the value for 0, changes by from each row's last column to the next row's first.

        In closed form, int64; that of the last row and of some beyond it, too.
        """
        if k:
            last = [0] * k + [comb(self.cells - 1, i) for i in range(self.degree + 1 - k)]
        else:
            last = functions_along(self.width, self.degree, self.cell_width)[-1]
        return self.row_coefficients[1:, k] - self.row_coefficients[:-1] @ wrapped([last])[0]

    @cached_property
    def sequences(self):
        """Everything that is accumulated, and what it is accumulated from: name to `Sequence`.

        A jump's last difference, which is the same for all rows of cells, is the only one with a period.
        """
        found = {}
        values = (self.values(rows) for rows in bands((self.height, self.width)))
        for k in range(self.degree + 1):
            found[value_name(k)] = Sequence.of(k, [self.difference(k)] if k else values, self.cell_height)
        for k in range(self.degree):
            for n in range(self.degree - k):
                down = np.diff(self.jump(k), n)[: self.height]
                found[jump_name(k, n)] = Sequence.of(k + 1 + n, [down], self.cell_height)
        return found

    @property
    def registers(self):
        """Those of `sequences` that have a register: degree * (degree + 1) / 2 of them. The others are constants."""
        names = [value_name(k) for k in range(self.degree)]
        names += [jump_name(k, n) for k in range(self.degree) for n in range(self.degree - k - 1)]
        return {name: self.sequences[name] for name in names}

    @property
    def register_bits(self):
        """Bits of all registers: as many flip-flops, and about as many look-up tables."""
        return sum(sequence.stored.bits for sequence in self.registers.values())

    @property
    def formats(self):
        """The narrowest format for each of `sequences`, name to `Q`."""
        return {
            name: Q.covering(sequence.lowest, sequence.highest, self.fraction_bits)
            for name, sequence in self.sequences.items()
        }


class DifferenceAccumulator(wiring.Component):
    """The value of a `DifferenceForm` at the raster position, by additions alone.

    Within a row the value changes by its first difference in each step, and at a cell's end each difference by the next
    one. At a row's end value and differences change by their jumps, and each jump by its own differences. All of it is
    exact, so errors grow neither with the row nor with the number of frames, which all start from the same state.

    Latency: none; ``value`` belongs to the position that is stepped over in the same clock. Throughput: 1 px/clock.

    Parameters
    ----------
    form : DifferenceForm

    Members
    -------
    step : In(1)
        Go to the next raster position after this clock.
    x, y : In
        The position, px; only the low bits are used, which tell the place within a cell.
    end_of_line, end_of_frame : In(1)
        The position is its row's, its frame's, last one.
    value : Out(form.formats["value"].shape)
    """

    def __init__(self, form):
        self.form = form
        super().__init__(
            {
                "step": In(1),
                "x": In(ceil_log2(form.width)),
                "y": In(ceil_log2(form.height)),
                "end_of_line": In(1),
                "end_of_frame": In(1),
                "value": Out(form.formats["value"].shape),
            }
        )

    def elaborate(self, platform):
        m = Module()
        form = self.form
        registers = {name: _Register(name, sequence.stored) for name, sequence in form.registers.items()}
        row_in_cell = self.y[: exact_log2(form.cell_height)]
        end_of_cell = self.x[: exact_log2(form.cell_width)].all() if form.cell_width > 1 else Const(1)

        def value(name):
            if name in registers:
                return registers[name].value
            return _periodic(form.sequences[name].stored.starts, row_in_cell)

        m.d.comb += self.value.eq(value(value_name(0)))
        for k in range(form.degree):
            along = value(value_name(k + 1))
            if k:
                along = Mux(end_of_cell, along, 0)
            jumps = [jump_name(k, n) for n in range(form.degree - k)]
            register = registers[value_name(k)]
            with m.If(self.step):
                m.d.sync += register.less(Mux(self.end_of_line, value(jumps[0]), along))
                with m.If(self.end_of_line):
                    m.d.sync += [registers[name].less(value(following)) for name, following in zip(jumps, jumps[1:])]
        # Unlike a condition on each assignment, a reset costs nothing a bit.
        return ResetInserter(self.step & self.end_of_frame)(m)


class _Register:
    """A register for a `Sequence`: its ``bits`` stored, and with those in common the ``value``, signed."""

    def __init__(self, name, sequence):
        (first, *_), width, self.fixed_bits = sequence.starts, sequence.bits, sequence.fixed_bits
        self.bits = Signal(width, name=name, init=(first >> self.fixed_bits) % 2**width)
        parts = [Const(first % 2**self.fixed_bits, self.fixed_bits), self.bits]
        if not sequence.changes_sign:
            leading = first >> width + self.fixed_bits
            parts.append(Const(leading, signed(leading.bit_length() + 1)))
        self.value = Cat(*parts).as_signed()

    def less(self, difference):
        """The assignment that subtracts ``difference``."""
        return self.bits.eq((self.value - difference) >> self.fixed_bits)


def _periodic(values, index):
    """values[index]; ``values`` are 2**len(index) integers of which few differ."""
    first, *others = sorted(set(values))
    value = Const(first)
    for other in others:
        where = sum(1 << place for place, found in enumerate(values) if found == other)
        value = Mux(Const(where, len(values)).bit_select(index, 1), other, value)
    return value
