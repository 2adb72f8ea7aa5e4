"""Products made of rows of adders, for FPGAs and tools that shall spend no DSP blocks on them.

What a synthesis tool makes of `*` without DSP blocks differs; Yosys takes more than twice the look-up tables. A row is
one carry chain, and the look-up tables in front of it pick its operand too. All results are exact.
"""

from amaranth import Cat, Const, Mux, Signal, signed

from hdl.arithmetic.rows import Row, RowSum


def product(m, name, a, b, constant=0, registers=None):
    """The expression a*b + constant: radix-4 Booth, a row of the wider factor for every two bits of the other.

    With ``registers`` it is late by the clocks that `product_adders` tells, less the one of a register behind it.

    Parameters
    ----------
    m : Module
        The rows' adders go into its combinational domain.
    name : str
        What the names of the rows' signals begin with.
    a, b : Value
        Signed or unsigned.
    constant : int
    registers : Registers, optional
    """
    wide, narrow = sorted((as_signed(a), as_signed(b)), key=len, reverse=True)

    def rows(prefix, indices, wide, narrow):
        digits = _BoothDigits(m, prefix, narrow)
        for index in indices:
            negative = digits.is_negative(index)
            row = Signal(signed(len(wide) + 1), name=f"{name}_row_{index}")
            m.d.comb += row.eq(digits.magnitude_times(index, wide) ^ negative.replicate(len(row)))
            yield Row(2 * index, row, negative)

    return _add_rows(m, name, rows, _product_rows(len(wide), len(narrow)), (wide, narrow), constant, registers)


def square(m, name, a, constant=0, registers=None):
    """The expression a*a + constant, in half of what `product` takes; parameters as there.

    With the lowest Booth digit d and the rest r, a = 4*r + d, so a*a = 16*r*r + d*(8*r + d), and so on for r. Where d
    is negative the rest is the bits above it plus one, and that one is what the negation needs: -8*(bits + 1) + 1 is
    8*~bits + 1, and -16*(bits + 1) + 4 is 16*~bits + 4.
    """
    a = as_signed(a)

    def rows(prefix, indices, a):
        digits = _BoothDigits(m, prefix, a)
        for index in indices:
            bits = a[min(2 * index + 2, len(a) - 1) :]
            # It does not matter for a digit of 0.
            rest = bits ^ digits.is_negative(index).replicate(len(bits))
            row = Signal(signed(len(bits) + 4), name=f"{name}_row_{index}")
            one, two = digits.is_one(index), digits.is_two(index)
            m.d.comb += row.eq(Cat(one, Const(0, 1), two, digits.magnitude_times(index, rest)))
            yield Row(4 * index, row)

    return _add_rows(m, name, rows, _square_rows(len(a)), (a,), constant, registers)


def scaled(m, name, a, factor, constant=0, registers=None):
    """The expression a*factor + constant for an integer ``factor``; other parameters as for `product`.

    A row for each digit of the factor's canonical signed form, all but the first one an adder.
    """
    a, digits = as_signed(a), signed_digits(factor)

    def rows(_, indices, a):
        for place, digit in (digits[index] for index in indices):
            yield Row(place, a, subtract=digit < 0)

    return _add_rows(m, name, rows, _scaled_rows(len(a), factor), (a,), constant, registers)


def product_adders(a, b, constant):
    """Adders of a `product` that follow one on the other; of factors that are signed, of ``a`` and ``b`` bits."""
    return _adders(_product_rows(max(a, b), min(a, b)), constant)


def square_adders(a, constant):
    """Those of a `square`."""
    return _adders(_square_rows(a), constant)


def scaled_adders(a, factor, constant):
    """Those of `scaled`."""
    return _adders(_scaled_rows(a, factor), constant)


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


# Of each kind of product: its rows, and the bits of a constant for which the first row needs no adder.


def _product_rows(wide, narrow):
    return (narrow + 1) // 2, wide


def _square_rows(a):
    return (a + 1) // 2, a - min(2, a - 1) + 3


def _scaled_rows(a, factor):
    digits = signed_digits(factor)
    return len(digits), digits[0][0] + a - 1 if digits else 0


def _adders(shape, constant):
    rows, free = shape
    return max(rows + bool(rows and constant >> free), 1)


def _add_rows(m, name, rows, shape, operands, constant, registers):
    """The expression constant + the sum of ``rows``, which come with ascending places.

    As much of the constant as fits into the first row takes no adder of its own.

    Parameters
    ----------
    rows : function
        The `Row` of each of some indices, by the beginning of names, the indices, and operands.
    shape : (int, int)
        As `_product_rows` and the like return it.
    operands : tuple of Value
    registers : Registers or None
    """
    count, free = shape
    if not count:
        return Const(constant)
    first = Const(constant % (1 << free), signed(free + 1))
    sum_ = RowSum(m, name, first, first.value, first.value, registers.stages if registers else None)
    together = registers.adders if registers else count
    for start in range(0, count, together):
        prefix = name
        if start:
            prefix = f"{name}_{start // together}"
            # With a reset: without one, bits that only wait become shift registers, which are slow.
            operands = [
                registers.stages.after(f"{prefix}_operand_{index}", operand, reset_less=False)
                for index, operand in enumerate(operands)
            ]
            sum_.register()
        for row in list(rows(prefix, range(start, min(start + together, count)), *operands)):
            sum_.add(row)
    above = constant >> free << free
    if above and count % together == 0 and registers:
        sum_.register()
    return sum_.result() + above if above else sum_.result()


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


def as_signed(value):
    """``value`` as it is where it is signed, else with a sign bit more."""
    return value if value.shape().signed else Cat(value, Const(0, 1)).as_signed()
