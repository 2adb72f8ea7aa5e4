"""Products with the registers of DSP blocks: a block each for pieces of the factors, their sum from block to block."""

from itertools import product as pairs

from amaranth import Cat, Const, signed

from hdl.arithmetic.rows import Row, RowSum

# Bits of the factors of a DSP48E1, both signed (AMD UG479).
WIDE, NARROW = 25, 18


def pieces(width, most):
    """(place, bits) of the pieces of a signed factor: all but the last one unsigned, and so a bit short of ``most``."""
    places = range(0, max(width - 1, 1), most - 1) if width > most else [0]
    return [(place, min(most - 1, width - place)) for place in places[:-1]] + [(places[-1], width - places[-1])]


def blocks(a, b):
    """(place, piece of the wider factor, piece of the other) of each block, for signed factors of ``a``, ``b`` bits."""
    wide, narrow = pieces(max(a, b), WIDE), pieces(min(a, b), NARROW)
    return sorted((one[0] + other[0], one, other) for one, other in pairs(wide, narrow))


def clocks(a, b):
    """Clocks of a `product`."""
    return len(blocks(a, b)) + 1


def product(m, name, a, b, constant, stages):
    """The expression a*b + constant, `clocks` late: a block has a register behind its multiplier and one, which takes
    all bits or none, behind its adder.

    Parameters
    ----------
    m : Module
    name : str
        What the names of the signals begin with.
    a, b : Value
        Signed, from registers.
    constant : int
    stages : Stages
    """
    wide, narrow = sorted((a, b), key=len, reverse=True)
    first = Const(constant, signed(constant.bit_length() + 1))
    sum_ = RowSum(m, name, first, constant, constant, stages)
    for index, (place, one, other) in enumerate(blocks(len(a), len(b))):
        if index:
            sum_.register()
            wide, narrow = (
                stages.after(f"{name}_{kind}_{index}", factor) for kind, factor in (("wide", wide), ("narrow", narrow))
            )
        value = stages.after(f"{name}_product_{index}", _piece(wide, one) * _piece(narrow, other))
        sum_.add(Row(place, value))
    sum_.register()
    return sum_.result()


def _piece(factor, piece):
    place, bits = piece
    cut = factor[place : place + bits]
    return cut.as_signed() if place + bits == len(factor) else Cat(cut, Const(0, 1)).as_signed()
