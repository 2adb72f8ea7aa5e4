"""Straight-line fixed-point programs: the steps from given values to results, and their integer model.

A program is a datapath's parameters; `hdl.arithmetic.pipeline` makes hardware of it. Every value has a name, a stored
integer and fraction bits: it stands for integer * 2**-fraction_bits.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from hdl.arithmetic.cost import dsp_blocks
from hdl.arithmetic.multiplier import signed_digits


@dataclass(frozen=True)
class Step:
    """What makes the value ``name``, with ``bits`` fraction bits, of the one named ``a``, and ``b`` if there is one."""

    name: str
    bits: int
    a: str

    @property
    def operands(self):
        """Names of the values that it takes."""
        return (self.a,)


@dataclass(frozen=True)
class _OfTwo(Step):
    b: str

    @property
    def operands(self):
        return self.a, self.b


@dataclass(frozen=True)
class Product(_OfTwo):
    """a*b + constant, rounded half up; the constant has the fraction bits of the exact product."""

    constant: int


@dataclass(frozen=True)
class Scaled(Step):
    """a*factor + constant, rounded half up; the factor has ``factor_bits``, the constant the exact product's."""

    factor: int
    factor_bits: int
    constant: int


@dataclass(frozen=True)
class Sum(_OfTwo):
    """a + b, rounded down."""


@dataclass(frozen=True)
class Quotient(_OfTwo):
    """a/b - 2**bias_bits, rounded down. a >= 0, b > 0, a < 2**(bias_bits + 1) b; fraction bits: a <= b + quotient."""

    bias_bits: int

    @property
    def quotient_bits(self):
        """Bits of the quotient, the bias included."""
        return self.bits + self.bias_bits + 1


def evaluate(steps, given, known=None):
    """The integer model of a program.

    Parameters
    ----------
    steps : sequence of Step
        Each after those that it takes values from.
    given : dict of str to (int64 array, int)
        Stored integers and fraction bits of what is there at the start.
    known : dict, optional
        Keeps the values for later calls, which take those of equal steps from it that are of the same operands.

    Returns
    -------
    dict of str to (int64 array, int)
        All values, the given ones too.
    """
    values = dict(given)
    for step in steps:
        a, b = values[step.operands[0]], values[step.operands[-1]]
        if known is None:
            values[step.name] = _value(step, a, b)
            continue
        key = step, id(a), id(b)
        if key not in known:
            known[key] = _value(step, a, b), a, b  # kept with it, so that no other operand gets the same id
        values[step.name] = known[key][0]
    return values


def _value(step, a, b):
    """(int64 array, int) of a step whose operands are such pairs too."""
    (a, a_bits), (b, b_bits) = a, b
    match step:
        case Product():
            stored = _rounded(a * b, step.constant, a_bits + b_bits - step.bits)
        case Scaled():
            stored = _rounded(a * step.factor, step.constant, a_bits + step.factor_bits - step.bits)
        case Sum():
            bits = max(a_bits, b_bits, step.bits)
            stored = a << (bits - a_bits)
            stored += b << (bits - b_bits) if bits > b_bits else b
            stored >>= bits - step.bits
        case Quotient():
            with np.errstate(divide="ignore"):
                stored = (a << (b_bits + step.bits - a_bits)) // b
            stored -= 1 << (step.bits + step.bias_bits)
        case _:
            raise TypeError(f"{step!r} is no step")
    return stored, step.bits


def in_range(steps, values):
    """Whether the operands of quotients are as `Quotient` demands, and int64 holds whatever `evaluate` computes.

    ``values`` as `evaluate` returns them.
    """
    return spans_in_range(steps, {name: (*span(stored), bits) for name, (stored, bits) in values.items()})


def span(stored):
    """The least and the greatest of an array of integers."""
    return int(stored.min()), int(stored.max())


def spans_in_range(steps, spans):
    """`in_range` by the least and greatest integer and the fraction bits of each value.

    Where only the given values have a span, what the others can be at most follows from those: True is then certain,
    False is not.
    """
    spans = dict(spans)
    for step in steps:
        (*a, a_bits), (*b, b_bits) = spans[step.operands[0]], spans[step.operands[-1]]
        largest_a, largest_b = (max(-low, high) for low, high in (a, b))
        match step:
            case Product():
                largest = largest_a * largest_b + abs(step.constant)
            case Scaled():
                largest = largest_a * abs(step.factor) + abs(step.constant)
            case Sum():
                bits = max(a_bits, b_bits, step.bits)
                largest = (largest_a << (bits - a_bits)) + (largest_b << (bits - b_bits))
            case Quotient():
                shift = b_bits + step.bits - a_bits
                if shift < 0 or a[0] < 0 or b[0] <= 0:
                    return False
                largest = largest_a << shift
            case _:
                raise TypeError(f"{step!r} is no step")
        if largest >= 1 << 62:
            return False
        if step.name not in spans:
            # Each step is monotone in either operand.
            found = [_value(step, (one, a_bits), (other, b_bits))[0] for one in a for other in b]
            spans[step.name] = min(found), max(found), step.bits
        if isinstance(step, Quotient) and spans[step.name][1] >= 1 << (step.quotient_bits - 1):
            return False
    return True


def step_clocks(step):
    """Clocks of a step whose products have no registers within: one for each bit of a `Quotient`, else one."""
    return step.quotient_bits if isinstance(step, Quotient) else 1


def delays(steps, given, clocks_of=step_clocks):
    """Clocks from a position to each value, from those to the ``given`` ones and of each step."""
    clocks = dict(given)
    for step in steps:
        clocks[step.name] = max(clocks[operand] for operand in step.operands) + clocks_of(step)
    return clocks


def waits(steps, clocks):
    """(name, clocks) of each row of registers in which a value waits; ``clocks`` as `delays` returns them."""
    taps = {}
    for step in steps:
        start = max(clocks[operand] for operand in step.operands)
        for operand in step.operands:
            taps.setdefault(operand, {clocks[operand]}).add(start)
    return [(name, end - start) for name, at in taps.items() for start, end in pairwise(sorted(at))]


def step_cost(step, widths, dsp):
    """Look-up tables, flip-flops and DSP blocks of a step, about, without what waits for it. DSP blocks have registers.

    Parameters
    ----------
    step : Step
    widths : dict of str to int
        Bits of its operands and of its value.
    dsp : bool
        Whether DSP blocks make the products.
    """
    return _step_cost(step, widths[step.a], widths[step.operands[-1]], widths[step.name], dsp)


@lru_cache(maxsize=1 << 14)
def _step_cost(step, a, b, width, dsp):
    match step:
        case Product() if dsp:
            return 0, 0, dsp_blocks(a, b)
        case Scaled() if dsp:
            return 0, 0, dsp_blocks(a, step.factor.bit_length() + 1)
        case Product():
            rows = (min(a, b) + 1) // (4 if step.a == step.b else 2)
            return rows * (max(a, b) + 3) + (width + 2) * bool(step.constant), width, 0
        case Scaled():
            return (len(signed_digits(step.factor)) - 1 + bool(step.constant)) * (a + 2), width, 0
        case Sum():
            return width, width, 0
        case Quotient():
            return step.quotient_bits * (b + 2), 2 * step.quotient_bits * b, 0
        case _:
            raise TypeError(f"{step!r} is no step")


def _rounded(values, constant, dropped):
    """``values``, which are changed, plus ``constant``, without the last ``dropped`` bits."""
    values += constant + (1 << dropped >> 1)
    values >>= dropped
    return values
