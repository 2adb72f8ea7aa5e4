"""What coordinate hardware costs on a 7-series FPGA, estimated before synthesis."""

from dataclasses import dataclass

# What each resource is worth in look-up tables: its share of a Virtex-7 485T (the VC707's), which has 303600 LUT,
# 607200 flip-flops, 2060 RAMB18 and 2800 DSP48 (AMD DS180).
_WORTH = {"lut": 1.0, "ff": 303600 / 607200, "ramb18": 303600 / 2060, "dsp": 303600 / 2800}
# The resource that is asked to be saved counts as many times its worth.
_EMPHASIS = 8
GOALS = {"lut": "lut", "ff": "ff", "bram": "ramb18", "balanced": None}


@dataclass(frozen=True)
class Cost:
    """An estimate: look-up tables, flip-flops, block RAMs of 18 Kb, DSP blocks."""

    lut: int
    ff: int
    ramb18: int = 0
    dsp: int = 0

    def weight(self, goal: str = "balanced") -> float:
        """The cost as one number, in look-up tables' worth; ``goal`` is a key of `GOALS`."""
        emphasis = {GOALS[goal]: _EMPHASIS}
        return sum(getattr(self, name) * worth * emphasis.get(name, 1) for name, worth in _WORTH.items())


# Words and bits of a RAMB18 as a simple dual-port memory (AMD UG473).
RAMB18 = ((512, 36), (1024, 18), (2048, 9), (4096, 4), (8192, 2), (16384, 1))


def block_width(words):
    """Bits of the widest memory of so many words that one block RAM holds; 1 where none does."""
    return next((bits for depth, bits in RAMB18 if words <= depth), 1)


def block_rams(words, width):
    """RAMB18 that a simple dual-port memory takes (AMD UG473; a RAMB36 counts as two)."""
    return min(-(-words // depth) * -(-width // bits) for depth, bits in RAMB18)


def dsp_blocks(a, b):
    """DSP48E1 that a product of signed factors of ``a`` and ``b`` bits takes: 25 by 18 bits each (AMD UG479)."""
    wide, narrow = max(a, b), min(a, b)
    return -(-wide // 25) * -(-narrow // 18)


def waiting(bits, clocks, ends=False):
    """Look-up tables and flip-flops in which a value waits; from three clocks on registers become shift registers, in
    look-up tables, without the last one where it has a reset (``ends``, see `Stages`)."""
    last = bool(ends and clocks > 1)
    shifts = clocks - last >= 3
    return bits * shifts, bits * (last if shifts else clocks)
