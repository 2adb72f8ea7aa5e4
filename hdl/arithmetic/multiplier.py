"""Products made of rows of adders, for FPGAs and tools that shall spend no DSP blocks on them.

What a synthesis tool makes of `*` without DSP blocks differs; Yosys takes more than twice the look-up tables. A row is
one carry chain, and the look-up tables in front of it pick its operand too. All results are exact.
"""

from dataclasses import dataclass

from amaranth import Cat, Const, Mux, Signal, Value, signed

from hdl.arithmetic.fixedpoint import Q


@dataclass(frozen=True, eq=False)
class _Row:
    """(value + carry) * 2**place, or less that where ``subtract``; ``value`` is signed, ``carry`` a bit or None."""

    place: int
    value: Value
    carry: Value | None = None
    subtract: bool = False


def product(m, name, a, b, constant=0):
    """The expression a*b + constant: radix-4 Booth, a row of the wider factor for every two bits of the other.

    Parameters
    ----------
    m : Module
        The rows' adders go into its combinational domain.
    name : str
        What the names of the rows' signals begin with.
    a, b : Value
        Signed or unsigned.
    constant : int
    """
    wide, narrow = sorted((_signed(a), _signed(b)), key=len, reverse=True)
    digits = _BoothDigits(m, name, narrow)
    rows = []
    for index in range(len(digits)):
        negative = digits.is_negative(index)
        row = Signal(signed(len(wide) + 1), name=f"{name}_row_{index}")
        m.d.comb += row.eq(digits.magnitude_times(index, wide) ^ negative.replicate(len(row)))
        rows.append(_Row(2 * index, row, negative))
    return _add_rows(m, name, rows, constant)


def square(m, name, a, constant=0):
    """The expression a*a + constant, in half of what `product` takes; parameters as there.

    With the lowest Booth digit d and the rest r, a = 4*r + d, so a*a = 16*r*r + d*(8*r + d), and so on for r. Where d
    is negative the rest is the bits above it plus one, and that one is what the negation needs: -8*(bits + 1) + 1 is
    8*~bits + 1, and -16*(bits + 1) + 4 is 16*~bits + 4.
    """
    a = _signed(a)
    digits = _BoothDigits(m, name, a)
    rows = []
    for index in range(len(digits)):
        bits = a[min(2 * index + 2, len(a) - 1) :]
        # It does not matter for a digit of 0.
        rest = bits ^ digits.is_negative(index).replicate(len(bits))
        row = Signal(signed(len(bits) + 4), name=f"{name}_row_{index}")
        one, two = digits.is_one(index), digits.is_two(index)
        m.d.comb += row.eq(Cat(one, Const(0, 1), two, digits.magnitude_times(index, rest)))
        rows.append(_Row(4 * index, row))
    return _add_rows(m, name, rows, constant)


def scaled(m, name, a, factor, constant=0):
    """The expression a*factor + constant for an integer ``factor``; other parameters as for `product`.

    A row for each digit of the factor's canonical signed form, all but the first one an adder.
    """
    rows = [_Row(place, _signed(a), subtract=digit < 0) for place, digit in signed_digits(factor)]
    return _add_rows(m, name, rows, constant)


def signed_digits(factor):
    """(place, 1 or -1) of the canonical signed form of an integer: fewest digits that are not 0, lowest first."""
    digits, place = [], 0
    while factor:
        if factor & 1:
            digit = 2 - (factor & 3)
            digits.append((place, digit))
            factor -= digit
        factor >>= 1
        place += 1
    return digits


def _add_rows(m, name, rows, constant):
    """The expression constant + the sum of ``rows``, which come with ascending places.

    Bits below a row's place are final before it is added. As much of the constant as fits into the first row takes no
    adder of its own.
    """
    if not rows:
        return Const(constant)
    free = rows[0].place + len(rows[0].value) - 1
    total, done, final = Const(constant % (1 << free), signed(free + 1)), 0, []
    low = high = total.value
    for index, row in enumerate(rows):
        ready, done = row.place - done, row.place
        final.append(Cat(total, total[-1].replicate(ready))[:ready])
        total = total[min(ready, len(total) - 1) :].as_signed()
        most = 1 << (len(row.value) - 1)
        low, high = (low >> ready) - most, (high >> ready) + most
        added = Signal(signed(Q.covering(low, high, 0).width), name=f"{name}_sum_{index}")
        if row.subtract:
            sum_ = total - row.value
        elif row.carry is None:
            sum_ = total + row.value
        else:
            # An extra low bit makes the carry in.
            sum_ = (Cat(Const(1, 1), total).as_signed() + Cat(row.carry, row.value).as_signed())[1:].as_signed()
        m.d.comb += added.eq(sum_)
        total = added
    result = Cat(*final, total).as_signed()
    above = constant >> free << free
    return result + above if above else result


class _BoothDigits:
    """The digits -2..2 of a signed value in base 4."""

    def __init__(self, m, name, value):
        even = Cat(value, value[-1]) if len(value) % 2 else value
        self._bits, self._ones, self._changes = (
            Signal(len(even), name=f"{name}_{kind}") for kind in ("digits", "ones", "changes")
        )
        m.d.comb += [
            self._bits.eq(even),
            self._ones.eq(even ^ Cat(Const(0, 1), even)),
            self._changes.eq(even[:-1] ^ even[1:]),
        ]

    def __len__(self):
        return len(self._bits) // 2

    def is_negative(self, index):
        """For some digits of 0 too."""
        return self._bits[2 * index + 1]

    def is_one(self, index):
        """Whether its magnitude is 1."""
        return self._ones[2 * index]

    def is_two(self, index):
        """Whether its magnitude is 2."""
        return ~self._ones[2 * index] & self._changes[2 * index]

    def magnitude_times(self, index, value):
        """``value`` times the digit's magnitude, one bit wider."""
        twice = Mux(self._changes[2 * index], Cat(Const(0, 1), value), 0)
        return Mux(self._ones[2 * index], Cat(value, value[-1]), twice)


def _signed(value):
    return value if value.shape().signed else Cat(value, Const(0, 1)).as_signed()
