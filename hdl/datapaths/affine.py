"""The hardware of `proposed` with the best coefficients there are: those of least maximum error."""

from dataclasses import dataclass

import numpy as np

from hdl.arithmetic.bands import bands
from hdl.arithmetic.linear import LinearForm
from hdl.arithmetic.minimax import minimax, outside_by
from hdl.datapaths.base import ARITHMETIC_ERROR
from hdl.datapaths.proposed import Proposed
from hdl.errors import BudgetError

# Enough for any coefficient to be exact to a thousandth of the output's unit over the largest frame.
MOST_FRACTION_BITS = 36
COARSE = 16  # rows from one to the next of those that are looked at first


@dataclass(frozen=True)
class Affine(Proposed):
    """u and v as affine functions of the raster position, accumulated.

    The linear functions closest to the exact map, in its greatest deviation over the pixels whose source is inside the
    image; the README's Table 1 has what that gains over the coefficients of Eq. 6. Two adders and two registers;
    latency 0, 1 px/clock.

    Fitted without the lens only: with it any affine map is off by tens of pixels, which nobody wants to get for having
    left out an option.

    48 LUT and 51 FF (README, the ladder: coordinates of the embedded rig, 640x480).

    Parameters
    ----------
    u_form, v_form : LinearForm
        px
    """

    name = "affine"
    summary = "the two accumulators of Eq. 6, coefficients of least maximum error"
    has_default_budget = False

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        exact = view.map()
        counts = outside_by(*exact) == 0
        fits = [_Fit(coordinate, counts, fraction_bits) for coordinate in exact]
        forms = [fit.narrowest(fit.reachable if max_error is None else max_error) for fit in fits]
        if None in forms:
            reached = max(fit.error(fit.narrowest(fit.reachable)) for fit in fits)
            raise BudgetError(max_error, reached, f"{cls.name} for the {view.side} camera")
        return cls(view.width, view.height, fraction_bits, *forms)


class _Fit:
    """The linear function closest to one coordinate, and its accumulators."""

    def __init__(self, exact, counts, fraction_bits):
        self.exact, self.counts, self.fraction_bits = exact, counts, fraction_bits
        height, width = exact.shape
        columns, rows = (np.stack([np.ones(size), np.linspace(-1, 1, size)], axis=1) for size in (width, height))
        (constant, down), (across, _) = (
            minimax(columns, rows, [(0, 0), (1, 0), (0, 1)], exact, np.where(counts, 0.0, np.inf))
        )[0]
        a, b = 2 * across / (width - 1), 2 * down / (height - 1)
        self.coefficients = a, b, constant - across - down
        x, y = np.arange(width), np.arange(height)[:, None]
        least = self._largest(lambda rows: a * x + b * y[rows] + self.coefficients[2])
        # Of the model with coefficients that are as good as exact.
        self.reachable = float(least) + 2.0 ** -(fraction_bits + 1) + ARITHMETIC_ERROR

    def narrowest(self, limit):
        """The form with the fewest fraction bits whose integer model is within ``limit`` px, or None."""
        height, width = self.exact.shape
        half = 2.0 ** -(self.fraction_bits + 1)
        for bits in range(self.fraction_bits, MOST_FRACTION_BITS):
            form = LinearForm.quantise(self.coefficients, bits, width, height, half=half)
            if all(self.error(form, step) <= limit for step in (COARSE, 1)):
                return form
        return None

    def error(self, form, step=1):
        """Largest error, px, of the integer model at the pixels that count, in every ``step``-th row."""
        height, width = self.exact.shape
        x, y = np.arange(width), np.arange(height)[:, None]
        dropped, scale = form.fraction_bits - self.fraction_bits, 2.0**-self.fraction_bits
        return self._largest(lambda rows: (form.values(x, y[rows]) >> dropped) * scale, step)

    def _largest(self, used, step=1):
        largest = 0.0
        for rows in bands(self.exact.shape, step):
            error = used(rows)
            error -= self.exact[rows]
            np.abs(error, out=error)
            error *= self.counts[rows]
            largest = max(largest, float(error.max()))
        return largest
