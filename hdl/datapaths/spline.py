"""Any map, lens and fisheye included, by additions and a little memory: a discrete tensor-product spline."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from amaranth.utils import ceil_log2

from hdl.arithmetic.cost import Cost, block_rams
from hdl.arithmetic.fixedpoint import Q
from hdl.datapaths.base import Datapath, check_budget, fitted_budget
from hdl.datapaths.spline_hardware import DISTRIBUTED_BITS, SplineCoordinates
from hdl.datapaths.spline_search import SplineSearch
from hdl.datapaths.spline_surface import Surface
from hdl.geometry.coordinates import Coordinates


@dataclass(frozen=True, eq=False)
class Spline(Datapath):
    """Source coordinates as splines: along a row straight lines from node to node, down the columns quadratic ones.

    Each row starts from its start value and adds an increment a pixel, which changes from cell to cell; the start value
    and each cell's increment are themselves accumulated down the rows, by value and slope, and the slope bends every
    few rows. Values and slopes are in one small RAM, the bends in a ROM, both shared by u and v, and one pair of adders
    takes them all along. v is kept relative to the output row.

    165 LUT, 154 FF and 2 RAMB18 with the lens, 233 LUT and 179 FF without (README, the ladder: coordinates of the
    embedded rig, 640x480, 0.05 px). Latency 0, or 1 with `Pipeline.ahead`; 1 px/clock.

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
        return SplineSearch(cls, view, fraction_bits, budget).best()

    @cached_property
    def coordinates(self):
        shift = self.u_surface.value_bits - self.fraction_bits
        y = np.arange(self.height)[:, None] << self.fraction_bits
        return Coordinates.banded(
            self.shape,
            self.fraction_bits,
            lambda rows: self.u_surface.values(rows) >> shift,
            lambda rows: (self.v_surface.values(rows) >> shift) + y[rows],
        )

    @property
    def surfaces(self):
        """Both surfaces, v's first: the order in which the hardware serves them."""
        return self.v_surface, self.u_surface

    @property
    def latency(self):
        return int(self.pipeline.ahead)

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

    @cached_property
    def formats(self):
        formats = {"value": self.value_format, "slope": self.slope_format, "bend": self.bend_format}
        for name, surface in (("u", self.u_surface), ("v_less_row", self.v_surface)):
            formats[name] = Q.covering(*surface.span, surface.value_bits)
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
        if self.pipeline.ahead:
            # What follows from the position; of v, one of the registers in which it waits holds its row too.
            ff += 10 + self.column_bits + ceil_log2(self.u_surface.cells.rows)
            ff += self.coordinate_formats[1].width - waiting
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
