"""What `conventional` and `accumulate` share: Eq. 3's linear forms, their word lengths, and the division by z."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import ceil

import numpy as np
from amaranth import Signal

from hdl.arithmetic.bands import spread
from hdl.arithmetic.cost import Cost
from hdl.arithmetic.divider import Divider
from hdl.arithmetic.linear import LinearForm
from hdl.datapaths.base import Datapath, word_length_budget
from hdl.errors import InputError
from hdl.geometry.coordinates import Coordinates

# No calibration within the checked ranges needs as many; beyond them int64 would not hold the model's dividends.
MOST_FRACTION_BITS = 34


@dataclass(frozen=True)
class Ratio:
    """Integers of u = x/z (or v = y/z): floor of numerator over z, each a truncated linear form.

    Parameters
    ----------
    form : LinearForm
        2**fraction_bits * (x + bias*z) + z/2, so that the floor of the quotient is u rounded half up, plus the bias.
    kept_bits : int
        Fraction bits of the form that the divider sees.
    bias : int
        Whole pixels added to keep the quotient from being negative.
    """

    form: LinearForm
    kept_bits: int
    bias: int

    def dividend(self, x, y):
        """What the divider sees at the positions (x, y), int64, in units of 2**-kept_bits."""
        return self.form.values(x, y) >> (self.form.fraction_bits - self.kept_bits)


@dataclass(frozen=True)
class Projective(Datapath):
    """Parameters and integer model of u = x/z, v = y/z with x, y, z linear in the raster position (Eq. 3 and 4).

    Parameters
    ----------
    u_ratio, v_ratio : Ratio
    z_form : LinearForm
    divisor_bits : int
        Fraction bits of z that the dividers see.
    """

    u_ratio: Ratio
    v_ratio: Ratio
    z_form: LinearForm
    divisor_bits: int

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        return cls(view.width, view.height, fraction_bits, *_words(view, fraction_bits, max_error))

    @property
    def forms(self):
        """The three linear forms, in the order x, y, z."""
        return {"x": self.u_ratio.form, "y": self.v_ratio.form, "z": self.z_form}

    def coordinate(self, ratio, x, y):
        """u or v at the positions (x, y), int64, in units of 2**-fraction_bits px."""
        return _coordinate(ratio, self.z_form, self.divisor_bits, self.fraction_bits, x, y)

    @cached_property
    def coordinates(self):
        x, y = np.arange(self.width), np.arange(self.height)[:, None]

        def used(ratio):
            return lambda rows: self.coordinate(ratio, x, y[rows])

        return Coordinates.banded(self.shape, self.fraction_bits, used(self.u_ratio), used(self.v_ratio))

    @property
    def formats(self):
        return {
            **{name: form.format for name, form in self.forms.items()},
            "divisor": replace_fraction(self.z_form.format, self.divisor_bits),
            "dividend_u": replace_fraction(self.u_ratio.form.format, self.u_ratio.kept_bits),
            "dividend_v": replace_fraction(self.v_ratio.form.format, self.v_ratio.kept_bits),
        }

    @property
    def quotient_bits(self):
        """Quotient bits, and so stages, of the dividers."""
        limits = (
            limit + (ratio.bias << self.fraction_bits)
            for ratio, (_, limit) in (
                (self.u_ratio, self.coordinates.u_range),
                (self.v_ratio, self.coordinates.v_range),
            )
        )
        return max(limits).bit_length()

    @property
    def division_clocks(self):
        """Clocks from the linear forms to ``u`` and ``v``: the dividers' and, where products have registers within, the
        one of the registers behind the subtraction of the biases."""
        return self.quotient_bits + bool(self.pipeline.products)

    @property
    def divider_cost(self):
        """`Cost` of the dividers and of the registers behind them."""
        stages, width = self.quotient_bits, self.formats["divisor"].width
        coordinates = sum(q.width for q in self.coordinate_formats) * bool(self.pipeline.products)
        return Cost(lut=stages * 2 * (width + 2), ff=stages * (3 * width) - width + coordinates)

    @property
    def form_bits(self):
        """Bits of the three linear forms."""
        return sum(form.format.width for form in self.forms.values())

    def divider(self):
        """The `Divider` for both coordinates."""
        formats = self.formats
        return Divider(
            [
                (formats[f"dividend_{axis}"].width, self.divisor_bits - ratio.kept_bits)
                for axis, ratio in (("u", self.u_ratio), ("v", self.v_ratio))
            ],
            divisor_bits=formats["divisor"].width,
            quotient_bits=self.quotient_bits,
        )


def replace_fraction(q, fraction_bits):
    """``q`` truncated to ``fraction_bits``."""
    return replace(q, fraction_bits=fraction_bits)


def _coordinate(ratio, z_form, divisor_bits, fraction_bits, x, y):
    divisor = z_form.values(x, y)
    divisor >>= z_form.fraction_bits - divisor_bits
    quotient = ratio.dividend(x, y)
    quotient <<= divisor_bits - ratio.kept_bits
    quotient //= divisor
    quotient -= ratio.bias << fraction_bits
    return quotient


def quantised(rows, bias, size, fraction_bits, bits):
    """What given word lengths make of `Projective`: (u_ratio, v_ratio, z_form, divisor_bits).

    Parameters
    ----------
    rows : dict of "u", "v", "z" to (3,) float64
        Rows of the homography.
    bias : dict of "u", "v" to int
        See `Ratio`.
    size : (int, int)
        Frame width and height, px.
    fraction_bits : int
    bits : dict of str to int
        Fraction bits: divisor <= z, and for each axis kept_* <= form_* and kept_* <= divisor.
    """

    def ratio(axis):
        kept, stored = bits[f"kept_{axis}"], bits[f"form_{axis}"]
        numerator = 2.0**fraction_bits * (rows[axis] + bias[axis] * rows["z"]) + rows["z"] / 2
        return Ratio(LinearForm.quantise(numerator, stored, *size, half=_half(kept, stored)), kept, bias[axis])

    divisor = bits["divisor"]
    z_form = LinearForm.quantise(rows["z"], bits["z"], *size, half=_half(divisor, bits["z"]))
    return ratio("u"), ratio("v"), z_form, divisor


@lru_cache(maxsize=1)
def _words(view, fraction_bits, max_error):
    """Of `Projective.fit`, whose subclasses have them in common."""
    return _WordLengths(view, fraction_bits, word_length_budget(max_error, fraction_bits)).search()


class _WordLengths:
    """The search of `Projective.fit`: fewest divisor bits first, then dividend bits, then coefficient bits.

    The divisor's width sets the size of every divider stage, twice; the rest is small change. Candidates that already
    miss the budget on a coarse grid are dropped there; one that passes is evaluated at every pixel.
    """

    def __init__(self, view, fraction_bits, budget):
        self.view, self.fraction_bits, self.budget = view, fraction_bits, budget
        self.exact = dict(zip("uv", view.map()))
        self.bias = {axis: max(0, ceil(-float(exact.min() - budget))) for axis, exact in self.exact.items()}
        self.row = dict(zip("uvz", np.asarray(view.homography) / np.sign(view.homography[2, 2])))
        step = max(1, min(view.width, view.height) // 60)
        coarse_x, coarse_y = (np.unique(np.r_[0:size:step, size - 1]) for size in (view.width, view.height))
        self.coarse = coarse_x, coarse_y[:, None]
        self.every = np.arange(view.width), np.arange(view.height)[:, None]

    def search(self):
        most = MOST_FRACTION_BITS
        start = self.fraction_bits
        bits = {"divisor": most, "z": most, **{f"{kind}_{axis}": most for kind in ("kept", "form") for axis in "uv"}}

        def fewest(low, axes, *names):
            for candidate in range(low, most + 1):
                trial = {**bits, **dict.fromkeys(names, candidate)}
                if all(self.meets(trial, axis) for axis in axes):
                    bits.update(trial)
                    return
            raise InputError("--max-error", None, self.budget, "cannot be reached by word lengths of this datapath")

        # With fewer divisor bits the kept bits must shrink along.
        fewest(start, "uv", "divisor", "kept_u", "kept_v")
        for axis in "uv":
            fewest(0, axis, f"kept_{axis}")
        fewest(bits["divisor"], "uv", "z")
        for axis in "uv":
            fewest(bits[f"kept_{axis}"], axis, f"form_{axis}")
        return self.build(bits)

    def build(self, bits):
        size = self.view.width, self.view.height
        return quantised(self.row, self.bias, size, self.fraction_bits, bits)

    def meets(self, bits, axis):
        *ratios, z_form, divisor_bits = self.build(bits)
        ratio, exact = ratios["uv".index(axis)], self.exact[axis]

        def error(x, y, exact):
            used = _coordinate(ratio, z_form, divisor_bits, self.fraction_bits, x, y) * 2.0**-self.fraction_bits
            used -= exact
            return np.abs(used, out=used).max()

        (x, y), (every_x, every_y) = self.coarse, self.every
        return error(x, y, exact[y, x]) <= self.budget and all(
            error(every_x, every_y[rows], exact[rows]) <= self.budget for rows in spread(exact.shape)
        )


def _half(kept, stored):
    return 2.0 ** -(kept + 1) if stored > kept else 0.0


def connect_divider(m, datapath, parameters, x, y, z):
    """Drive ``u`` and ``v`` of a datapath with the quotients x/z and y/z of its linear forms, full width."""
    m.submodules.divider = divider = parameters.divider()
    ratios = (parameters.u_ratio, parameters.v_ratio)
    quotients = (divider.quotient_0, divider.quotient_1)
    m.d.comb += [
        divider.enable.eq(datapath.enable),
        divider.divisor.eq(z >> (parameters.z_form.fraction_bits - parameters.divisor_bits)),
    ]
    for ratio, value, dividend, quotient, out in zip(
        ratios, (x, y), (divider.dividend_0, divider.dividend_1), quotients, (datapath.u, datapath.v)
    ):
        m.d.comb += dividend.eq(value >> (ratio.form.fraction_bits - ratio.kept_bits))
        difference = quotient - (ratio.bias << parameters.fraction_bits)
        if parameters.pipeline.products:
            # With a reset: without one, bits of which nothing is subtracted come out of the divider's shift registers.
            coordinate = Signal.like(out, name=f"{out.name}_coordinate")
            with m.If(datapath.enable):
                m.d.sync += coordinate.eq(difference)
            difference = coordinate
        m.d.comb += out.eq(difference)
