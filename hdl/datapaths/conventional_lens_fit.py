"""The program of the conventional datapath with the lens, and its word lengths."""

from functools import cached_property
from math import ceil, log2

import numpy as np
from numpy.polynomial.polynomial import polyval

from hdl.arithmetic.steps import (
    Product,
    Quotient,
    Scaled,
    Sum,
    evaluate,
    in_range,
    step_cost,
)
from hdl.calibration.rig import SIDES
from hdl.datapaths.base import word_length_budget
from hdl.datapaths.conventional_lens_check import EveryPixel, ideal
from hdl.datapaths.projective import quantised
from hdl.datapaths.word_lengths import shortest
from hdl.errors import BudgetError
from hdl.lens import polynomial

# Precision of the most precise candidate: how many fraction bits, px, the error of each word length alone leaves.
MOST_PRECISION = 14
MOST_BITS = 29  # of X and Y, before the point and after it
LEAST_TERMS = -30  # exponent of 2
FEWEST = {"pinhole": 1, "divisor": 6, "z": 6}
GRID = 36  # points of the sample along each side of the frame
KEPT = 500  # values at the sample that are kept for candidates that have them in common


class LensFit:
    """What `ConventionalLens.fit` finds.

    Parameters
    ----------
    pinhole : subclass of Projective
    view : hdl.geometry.rectification.View
    fraction_bits : int
    max_error : float or None

    Raises
    ------
    InputError
        For a lens of another model or one beyond int64, and a budget below the rounding.
    """

    def __init__(self, pinhole, view, fraction_bits, max_error):
        self.pinhole, self.view, self.fraction_bits = pinhole, view, fraction_bits
        self.size = view.width, view.height
        k1, k2, self.p1, self.p2, k3, *below = _coefficients(view).tolist()
        self.budget = word_length_budget(max_error, fraction_bits)
        self.half = 2.0 ** -(fraction_bits + 1)
        (self.fx, self.skew, self.cx), (_, self.fy, self.cy), _ = view.camera.K.tolist()
        # Polynomials in r2, px^2.
        per_power = self.fx ** -np.arange(0, 8, 2.0)
        self.above, self.below = ((np.array([1, *k]) * per_power).tolist() for k in ((k1, k2, k3), below))
        self.rows = dict(zip("uvz", np.vstack([view.camera.K[:2, :2] @ view.ray[:2], view.ray[2]])))
        x, y = (np.linspace(0, size - 1, min(size, GRID)).astype(int) for size in self.size)
        self.sample = x, y = [positions.ravel() for positions in np.meshgrid(x, y)]
        u, v, z = (self.rows[name] @ [x, y, np.ones_like(x)] for name in "uvz")
        self.ideal = u / z, v / z
        # X and Y are quotients less half their range, which is a power of two. Corners of the frame have the largest.
        self.bias = {axis: 1 << max(1, exponent(np.abs(value).max() + 1)) for axis, value in zip("uv", self.ideal)}
        self._measure_lens()
        inside = view.inside[y, x]
        self.positions = x[inside], y[inside]
        self.exact = {axis: exact[y[inside], x[inside]] + self.half for axis, exact in zip("uv", view.map())}
        self.made, self._known = {}, {}

    def _measure_lens(self):
        """Exponents of 2 that are not below what occurs in the frame."""
        x, y = self.ideal
        r2 = (x - self.skew / self.fy * y) ** 2 + (self.fx / self.fy * y) ** 2
        r2 = np.linspace(r2.min(), r2.max(), 1000)
        divisor = polyval(r2, self.below)
        field, D = _field(self.view), self.view.camera.D
        if not (divisor > 0).all():
            raise self.view.fault(field, D, "the lens model divides by 0 within the frame")
        self.r2_exponent = exponent(r2[-1])
        self.x_exponent = max(bias.bit_length() - 1 for bias in self.bias.values())
        self.bias_bits = exponent(1.001 * np.abs(polyval(r2, self.above) / divisor - 1).max())
        # Of the terms that the stretch is made of, the largest; smaller ones than that have no effect.
        terms = np.abs([*self.above[1:], *self.below[1:]]) * r2[-1] ** np.array([1, 2, 3, 1, 2, 3])
        self.terms_exponent = max(exponent(terms.max()), LEAST_TERMS)
        self.divisor_exponent = exponent(divisor.min())

    def best(self):
        """(pinhole, steps), the cheapest within the budget; raises BudgetError."""
        starts = [_Candidate(self, {}, precision) for precision in range(1, self.most_precision + 1)]
        if not starts:
            problem = "the lens model bends the frame too far for conventional's arithmetic"
            raise self.view.fault(_field(self.view), self.view.camera.D, problem)
        # Before the last rounding, which has its share.
        limit = self.budget - self.half
        every_pixel = EveryPixel(self.view, self.fraction_bits, self.budget)
        found = shortest(
            lambda bits: _Candidate(self, bits),
            starts,
            FEWEST,
            error=self._error,
            limit=limit,
            meets=lambda candidate: every_pixel.meets(candidate.pinhole, candidate.steps),
        )
        if found is None:
            reached = self.half + self._error(starts[-1])
            raise BudgetError(self.budget, reached, f"conventional for the {self.view.side} camera")
        return found.pinhole, tuple(found.steps)

    @cached_property
    def most_precision(self):
        """The greatest precision for which int64 holds what is computed at the sample; 0 for none."""
        # The pinhole's dividends have twice as many, and a few for z and the sign: no more than int64.
        most = min(MOST_PRECISION, MOST_BITS - self.x_exponent)
        return next((bits for bits in range(most, 0, -1) if self._fits(_Candidate(self, {}, bits))), 0)

    def _fits(self, candidate):
        try:
            return in_range(candidate.steps, candidate.values(*self.sample))
        except OverflowError:  # by a coefficient
            return False

    @cached_property
    def exponents(self):
        """Of every value, the least exponent of 2 that is not below it, from the most precise candidate."""
        values = _Candidate(self, {}, self.most_precision).values(*self.sample)
        return {name: exponent(np.abs(stored).max() * 2.0**-bits) for name, (stored, bits) in values.items()}

    def _error(self, candidate):
        """The greatest error at the sample, px, before the last rounding."""
        if len(self._known) > KEPT:
            self._known.clear()
        values = candidate.values(*self.positions, self._known)
        worst = 0.0
        for step in candidate.steps:
            if step.name in self.exact:
                sum_ = sum(stored * 2.0**-bits for stored, bits in (values[name] for name in step.operands))
                worst = max(worst, np.abs(sum_ - self.exact[step.name]).max())
        return worst


class _Candidate:
    """The datapath's parameters for some word lengths; those that are not given suffice for ``precision``."""

    def __init__(self, fit, bits, precision=0):
        self.fit, self.bits, self.steps, self.fraction = fit, dict(bits), [], {}
        self._add_pinhole(precision)
        self._add_lens(precision, precision + fit.x_exponent)

    def _add_pinhole(self, precision):
        bits = self.bits
        finer = max(self.fit.size).bit_length()
        pinhole = bits.setdefault("pinhole", max(precision, FEWEST["pinhole"]))
        bits.setdefault("z", precision + self.fit.x_exponent + finer)
        bits["divisor"] = min(bits.get("divisor", precision + self.fit.x_exponent), bits["z"])
        for axis in "uv":
            bits.setdefault(f"form_{axis}", precision + finer)
            most = min(bits["divisor"] + pinhole, bits[f"form_{axis}"])
            bits[f"kept_{axis}"] = min(bits.get(f"kept_{axis}", precision), most)
        self.fraction = dict.fromkeys("xy", pinhole)

    def _add_lens(self, precision, relative):
        """The steps from X and Y; ``relative``: fraction bits of what X and Y are multiplied by."""
        fit = self.fit
        fx, fy, skew = fit.fx, fit.fy, fit.skew
        squares = relative + fit.terms_exponent - fit.r2_exponent
        x = self._sum("x_plain", "x", self._scaled("x_skew", "y", -skew / fy, precision, fit.x_exponent))
        xx, yy = self._product("xx", x, x, squares), self._product("yy", "y", "y", squares)
        if fx != fy:
            yy = self._scaled("yy_scaled", yy, (fx / fy) ** 2, squares, fit.r2_exponent)
        r2 = self._sum("r2", xx, yy)
        stretch = self._sum(
            "stretch",
            self._radial(r2, relative),
            self._scaled("tangential_x", x, 2 * fit.p2 / fx, relative, fit.x_exponent),
            self._scaled("tangential_y", "y", 2 * fit.p1 / fy, relative, fit.x_exponent),
        )
        for axis, position, centre, bend in (
            ("v", "y", fit.cy, fit.p1 * fy / fx**2),
            ("u", "x", fit.cx, fit.p2 / fx + fit.p1 * skew / fx**2),
        ):
            self._sum(
                axis,
                position,
                self._product(f"{axis}_lens", position, stretch, precision, centre + fit.half),
                self._scaled(f"{axis}_bend", r2, bend, precision, fit.r2_exponent),
                bits=fit.fraction_bits,
            )

    def _radial(self, r2, bits):
        """The radial part of the stretch; None for none."""
        fit = self.fit
        if not any(fit.below[1:]):
            return self._polynomial("radial", [0, *fit.above[1:]], r2, bits)
        bits = self.bits["radial"] = max(self.bits.get("radial", bits), -fit.bias_bits)
        finer = bits - fit.divisor_exponent
        # The bias, and half a unit, which rounds.
        raised = 2.0**fit.bias_bits + 2.0 ** -(bits + 1) - 1
        numerator = [above + raised * below for above, below in zip(fit.above, fit.below)]
        a = self._polynomial("numerator", numerator, r2, finer)
        b = self._polynomial("denominator", fit.below, r2, finer + fit.bias_bits + 1)
        return self._add(Quotient, "radial", bits, a, b, fit.bias_bits)

    def _polynomial(self, name, coefficients, r2, bits):
        """coefficients[0] + r2*(coefficients[1] + r2*...), by Horner's rule; None if all are, or round to, 0."""
        value = None
        for power in reversed(range(len(coefficients) - 1)):
            plus = coefficients[power]
            step, finer = f"{name}_{power}", bits + power * self.fit.r2_exponent
            if value:
                value = self._product(step, r2, value, finer, plus)
            else:
                value = self._scaled(step, r2, coefficients[power + 1], finer, self.fit.r2_exponent, plus)
        return value or (coefficients[0] and self._product(f"{name}_0", r2, None, bits, coefficients[0])) or None

    def _product(self, name, a, b, bits, plus=0.0):
        """a*b + plus; b None for 0."""
        if b is None:
            bits = self.bits.setdefault(name, bits)
            return self._add(Scaled, name, bits, a, 0, bits - self.fraction[a], fixed(plus, bits))
        exact = self.fraction[a] + self.fraction[b]
        bits = self.bits[name] = min(self.bits.get(name, bits), exact)
        return self._add(Product, name, bits, a, b, fixed(plus, exact))

    def _scaled(self, name, a, factor, bits, a_exponent, plus=0.0):
        """a*factor + plus; None for a factor that is, or rounds to, 0; a for a*1."""
        factor_bits = self.bits.setdefault(f"{name} factor", bits + a_exponent)
        integer = fixed(factor, factor_bits)
        if not integer:
            return None
        spare = (integer & -integer).bit_length() - 1
        integer, factor_bits = integer >> spare, factor_bits - spare
        if (integer, factor_bits, plus) == (1, 0, 0):
            return a
        exact = self.fraction[a] + factor_bits
        bits = self.bits[name] = min(self.bits.get(name, bits), exact)
        return self._add(Scaled, name, bits, a, integer, factor_bits, fixed(plus, exact))

    def _sum(self, name, *terms, bits=None):
        """The sum of the terms that there are; the term itself if there is one, None if there is none."""
        total, *rest = [term for term in terms if term] or [None]
        for index, term in enumerate(rest, 1):
            exact = max(self.fraction[total], self.fraction[term])
            if index < len(rest):
                total = self._add(Sum, f"{name}_{index}", exact, total, term)
            else:
                total = self._add(Sum, name, exact if bits is None else bits, total, term)
        return total

    def _add(self, kind, name, bits, *rest):
        # Candidates have most steps in common.
        key = kind, name, bits, *rest
        step = self.fit.made.get(key)
        if not step:
            step = self.fit.made[key] = kind(name, bits, *rest)
        self.steps.append(step)
        self.fraction[name] = bits
        return name

    @cached_property
    def cost(self):
        """Look-up tables' worth; about, and without what waits."""
        bits, bias = self.bits, self.fit.bias
        stages = bits["pinhole"] + max(bias.values()).bit_length()
        divisor = bits["divisor"] + 1
        forms = sum(bits[f"form_{axis}"] + bias[axis].bit_length() for axis in "uv") + bits["z"]
        lut = 2 * stages * (divisor + 2) + 4 * forms + bits["kept_u"] + bits["kept_v"]
        ff = 3 * stages * divisor + 2 * forms
        exponents = self.fit.exponents
        widths = {name: max(1, exponents.get(name, 0) + 1 + bits) for name, bits in self.fraction.items()}
        for step in self.steps:
            step_lut, step_ff, _ = step_cost(step, widths, dsp=False)
            lut, ff = lut + step_lut, ff + step_ff
        return lut + ff / 2

    @cached_property
    def pinhole(self):
        fraction = self.bits["pinhole"]
        # The linear forms are in units of the quotients.
        relative = {name: self.bits[name] - fraction for name in ("kept_u", "kept_v", "form_u", "form_v")}
        fit = self.fit
        words = quantised(fit.rows, fit.bias, fit.size, fraction, {**self.bits, **relative})
        return fit.pinhole(*fit.size, fraction, *words)

    def values(self, x, y, known=None):
        """The integer model's values at the positions (x, y); ``known``: see `evaluate`."""
        return evaluate(self.steps, ideal(self.pinhole, x, y, known), known)


def exponent(value):
    """The least exponent of 2 that is not below ``value``; 0 for 0."""
    return ceil(log2(abs(value))) if value else 0


def fixed(value, fraction_bits):
    """The stored integer that is closest."""
    return round(float(value) * 2.0**fraction_bits)


def _coefficients(view):
    """k1, k2, p1, p2, k3, k4, k5, k6; raises InputError for a lens that has more, or others."""
    D = view.camera.D
    if view.camera.model not in polynomial.NAMES or D[8:].any():
        problem = "conventional computes radial-tangential and rational lenses alone; spline takes every lens"
        raise view.fault(_field(view), view.camera.model, problem)
    return np.pad(D[:8], (0, max(0, 8 - D.size)))


def _field(view):
    return f"D{1 + SIDES.index(view.side)}"
