"""The cells and word lengths of a spline: the cheapest within a budget."""

import numpy as np
from amaranth.utils import ceil_log2, exact_log2

from hdl.arithmetic.bands import bands
from hdl.arithmetic.cost import block_rams
from hdl.datapaths.spline_fit import Cells, Fit, least_error
from hdl.datapaths.spline_surface import Surface
from hdl.errors import BudgetError


class SplineSearch:
    """The search of `Spline.fit`: the cells that take the least memory, with the fewest bits that do.

    ``datapath`` is the class `Spline`, of which a candidate is made to know its cost.

    Cells that the map's own curvature rules out are not tried; the others are fitted, and word lengths raised until the
    integer model is within the budget at every pixel.
    """

    CELL_WIDTHS = (64, 32, 16, 8)
    CELL_HEIGHTS = (128, 64, 32, 16, 8)
    SLOPES = (2, 4, 8)
    MOST_BITS = 12
    STEPS = (97, 7, 1)  # rows from one to the next of those that are looked at: some first, all of them last

    def __init__(self, datapath, view, fraction_bits, budget):
        self.datapath = datapath
        self.view, self.fraction_bits, self.budget = view, fraction_bits, budget
        u, v = view.map()
        self.inside = view.inside
        self.targets = u, v - np.arange(view.height)[:, None]
        self.reached, self.hopeless = np.inf, []

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
            self._fit_hopeless()
            if not np.isfinite(self.reached):
                self._fit_finest()
            raise BudgetError(self.budget, self.reached, f"spline for the {self.view.side} camera")
        return found

    def _fit(self, cells, target):
        fit = Fit(cells, target, self.inside)
        self.reached = min(self.reached, fit.error + self.budget - self.slack)
        return fit

    def _fit_hopeless(self):
        """Find out what those reach that were known to be beyond the budget."""
        for least, cells, target in sorted(self.hopeless, key=lambda entry: entry[0]):
            if least + self.budget - self.slack < self.reached:
                self._fit(cells, target)

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
        bend_across = max(_bend(target, self.inside) for target in self.targets)
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
            least = least_error(cells, target, self.inside)
            if least > self.slack:
                self.hopeless.append((least, cells, target))
                return None
            fits.append(self._fit(cells, target))
            if fits[-1].error > self.slack:
                return None
        lengths = sorted(
            ((node, increment) for node in range(3, self.MOST_BITS) for increment in range(3, self.MOST_BITS)),
            key=lambda pair: (sum(pair), pair),
        )
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
                self._error(surface, target, step) <= self.budget
                for step in self.STEPS
                for surface, target in zip(surfaces, self.targets)
            ):
                return self.datapath(cells.width, cells.height, self.fraction_bits, *surfaces)
        return None

    def _error(self, surface, target, step):
        """The largest error inside, px, in every ``step``-th row."""
        largest = 0.0
        for rows in bands(target.shape, step):
            error = (surface.values(rows) >> (surface.value_bits - self.fraction_bits)) * 2.0**-self.fraction_bits
            error -= target[rows]
            np.abs(error, out=error)
            error *= self.inside[rows]
            largest = max(largest, float(error.max()))
        return largest


def _bend(target, inside):
    """The greatest second difference along a row, of three pixels inside."""
    largest = 0.0
    for rows in bands(target.shape):
        bend = np.abs(np.diff(target[rows], n=2))
        among = inside[rows]
        bend *= among[:, 2:] & among[:, 1:-1] & among[:, :-2]
        largest = max(largest, bend.max(initial=0))
    return largest


def _cost(cells):
    """What to try first: block RAM at the least, then words stored, then bits of a word."""
    words = cells.rows * 2 * (cells.columns + 1)
    return block_rams(4 << ceil_log2(cells.columns + 1), 30) + block_rams(words, 9), words, cells.scale
