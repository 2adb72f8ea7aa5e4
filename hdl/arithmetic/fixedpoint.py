"""Fixed-point formats, written Qi.f: i integer bits (the sign among them where there is one) and f fraction bits."""

from dataclasses import dataclass

from amaranth import signed, unsigned


@dataclass(frozen=True)
class Q:
    """A fixed-point format; a stored integer n stands for n * 2**-fraction_bits.

    Parameters
    ----------
    integer_bits : int
        Bits left of the point, the sign included when ``is_signed``. May be negative: the leading bits of small
        numbers need not be stored.
    fraction_bits : int
        Bits right of the point. May be negative: the trailing bits of large numbers need not be stored.
    is_signed : bool
        Two's complement if true.
    """

    integer_bits: int
    fraction_bits: int
    is_signed: bool = True

    @classmethod
    def covering(cls, lowest: int, highest: int, fraction_bits: int) -> "Q":
        """The narrowest format that holds every stored integer in ``lowest..highest`` (both inclusive)."""
        lowest, highest = int(lowest), int(highest)
        if lowest > highest:
            raise ValueError(f"empty range {lowest}..{highest}")
        is_signed = lowest < 0
        width = max(max(highest, 0).bit_length(), (~lowest).bit_length() if is_signed else 0) + is_signed
        return cls(max(width, 1) - fraction_bits, fraction_bits, is_signed)

    @property
    def width(self) -> int:
        """Bits stored."""
        return self.integer_bits + self.fraction_bits

    @property
    def shape(self):
        """The Amaranth shape of the stored integer."""
        return signed(self.width) if self.is_signed else unsigned(self.width)

    def __str__(self) -> str:
        return f"{'' if self.is_signed else 'U'}Q{self.integer_bits}.{self.fraction_bits}"
