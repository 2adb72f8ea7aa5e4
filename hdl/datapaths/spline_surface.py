"""One coordinate as a quantised discrete tensor-product spline: straight lines across, quadratic ones down."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from amaranth.utils import exact_log2

from hdl.arithmetic.bands import bands
from hdl.datapaths.spline_fit import Cells


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

    def values(self, rows=slice(None)):
        """The accumulator's value at all pixels of some rows (an index into them), int64, in units of 2**-value_bits
        px.

        In closed form: the nodes' values are rounded to the increment's units one by one, since the remainders are
        carried along the row.
        """
        cells, basis = self.cells, self.cells.basis[rows]
        start = (basis @ self.start_controls + self.start_half) >> (self.word_bits + self.start_bits - self.value_bits)
        travelled = np.cumsum(basis @ self.cell_controls.T, axis=1)
        nodes = np.zeros((len(basis), cells.columns + 1), np.int64)
        nodes[:, 1:] = (travelled + ((1 << self.carry_bits) >> 1)) >> self.carry_bits
        cell, distance = cells.place
        widths = np.bincount(cell)
        first = nodes[:, :-1] * cells.cell_width - cells.offset * nodes[:, 1:2] + start[:, None]
        line = np.repeat(np.diff(nodes, axis=1), widths, axis=1)
        line *= distance
        line += np.repeat(first, widths, axis=1)
        return line

    @cached_property
    def span(self):
        """Least and greatest of the `values`."""
        parts = (self.values(rows) for rows in bands((self.cells.height, self.cells.width)))
        lowest, highest = zip(*((int(part.min()), int(part.max())) for part in parts))
        return min(lowest), max(highest)

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
