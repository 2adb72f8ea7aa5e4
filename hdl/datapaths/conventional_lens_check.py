"""Whether the conventional datapath with the lens is within its budget at every pixel of the frame."""

import numpy as np

from hdl.arithmetic.bands import spread
from hdl.arithmetic.steps import evaluate, in_range, span, spans_in_range

NEAR = 0.85  # share of the budget from which on a pixel is remembered as one that later candidates may fail at


def ideal(pinhole, x, y, known=None):
    """X and Y at the positions (x, y), as `evaluate` takes them; ``known``: a dict that keeps them for later calls."""
    known = {} if known is None else known
    values = {}
    for name, ratio in (("x", pinhole.u_ratio), ("y", pinhole.v_ratio)):
        key = ideal_key(pinhole, ratio)
        if key not in known:
            known[key] = pinhole.coordinate(ratio, x, y), pinhole.fraction_bits
        values[name] = known[key]
    return values


def ideal_key(pinhole, ratio):
    """What X, or Y, depends on."""
    return ratio, pinhole.z_form, pinhole.divisor_bits


class EveryPixel:
    """The check of candidate after candidate, exhaustive each time that one passes.

    Those that fail nearly always do so at pixels where others came near the budget, so these are looked at first. X and
    Y, which most candidates have in common, are kept.

    Parameters
    ----------
    view : hdl.geometry.view.View
    fraction_bits : int
    budget : float
        px
    """

    def __init__(self, view, fraction_bits, budget):
        self._view, self._scale, self._budget = view, 2.0**-fraction_bits, budget
        self._shape = view.height, view.width
        self._x, self._y = np.arange(view.width), np.arange(view.height)[:, None]
        self._doubtful = np.empty(0, np.int64)  # flat indices
        self._ideal = {}  # X and Y of the last one that passed: int32 (height, width) by their keys

    def meets(self, pinhole, steps):
        """Whether every pixel whose source is inside is within the budget, and nothing overflows at any pixel."""
        row, column = np.divmod(self._doubtful, self._view.width)
        values = evaluate(steps, ideal(pinhole, column, row))
        if (self._errors(values, (row, column)) > self._budget).any():
            return False
        keys = {name: ideal_key(pinhole, ratio) for name, ratio in (("x", pinhole.u_ratio), ("y", pinhole.v_ratio))}
        before = {key: self._ideal[key] for key in keys.values() if key in self._ideal}
        kept = {key: before.get(key, np.empty(self._shape, np.int32)) for key in keys.values()}
        spans, near = {name: [] for name in keys}, [self._doubtful]
        for rows in spread(self._shape):
            known = {key: (stored[rows].astype(np.int64), pinhole.fraction_bits) for key, stored in before.items()}
            given = ideal(pinhole, self._x, self._y[rows], known)
            for name, key in keys.items():
                if key not in before:
                    kept[key][rows] = given[name][0]
                spans[name] += span(given[name][0])
            errors = self._errors(evaluate(steps, given), rows)
            found = np.flatnonzero((errors > NEAR * self._budget) & self._view.inside[rows])
            if found.size:
                row, column = np.divmod(found, self._view.width)
                near.append((rows.start + row * rows.step) * self._view.width + column)
                if errors[row, column].max() > self._budget:
                    break
        else:
            self._ideal = kept
        self._doubtful = np.unique(np.concatenate(near))
        if self._ideal is not kept:
            return False
        if spans_in_range(steps, {name: (min(ends), max(ends), pinhole.fraction_bits) for name, ends in spans.items()}):
            return True
        every = (ideal(pinhole, self._x, self._y[rows]) for rows in spread(self._shape))
        return all(in_range(steps, evaluate(steps, given)) for given in every)

    def _errors(self, values, where):
        """The greater error of both axes at the pixels ``where``, an index into the frame, px."""
        u, v = (np.abs(values[name][0] * self._scale - exact[where]) for name, exact in zip("uv", self._view.map()))
        return np.maximum(u, v, out=u)
