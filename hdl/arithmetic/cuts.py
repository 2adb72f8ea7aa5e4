"""Where the registers of a core are: pipelines by name, and the registers of values that wait in them."""

from dataclasses import dataclass
from typing import Any

from amaranth import Cat, Module, Signal, Value, ValueLike

SERIAL, RADIX4, TREE = "serial", "radix4", "tree"


@dataclass(frozen=True)
class Pipeline:
    """Which of the places that may have a register have one.

    Parameters
    ----------
    name, summary : str
    interpolator : str
        ``SERIAL``: an adder a bit of the weight, in one clock; ``RADIX4``: two bits of the weight an adder, two adders
        a clock; ``TREE``: a tree of adders, one a clock or, at its root, two.
    ports : bool
        A register for the beat that comes in and two for the one that goes out, so that tready, and the clock enable of
        all between them, are registers.
    ahead : bool
        Row counts, raster and the addresses of a datapath's memories are looked at a position ahead.
    ring : bool
        Behind the place of a source row in the line buffer.
    address : bool
        Behind the addresses of the line buffer.
    blocks : bool
        Behind each block RAM, which then has a port of its own.
    taps : bool
        Behind the choice between block RAMs and border.
    writes : bool
        Before the write ports of the line buffer.
    products : bool
        Within products and between the adders that sum them.
    """

    name: str
    summary: str
    interpolator: str = SERIAL
    ports: bool = False
    ahead: bool = False
    ring: bool = False
    address: bool = False
    blocks: bool = False
    taps: bool = False
    writes: bool = False
    products: bool = False

    @property
    def adders(self) -> int | None:
        """Adders of a product that follow one on the other within a clock; None: all of them."""
        if not self.products:
            return None
        return 1 if self.interpolator == TREE else 2


COMPACT = Pipeline("compact", "as few registers as there can be")
BALANCED = Pipeline(
    "balanced",
    "registers between the blocks",
    interpolator=RADIX4,
    ports=True,
    ahead=True,
    ring=True,
    taps=True,
    writes=True,
    products=True,
)
FAST = Pipeline(
    "fast",
    "registers wherever there may be one",
    interpolator=TREE,
    ports=True,
    ahead=True,
    ring=True,
    address=True,
    blocks=True,
    taps=True,
    writes=True,
    products=True,
)
PIPELINES = {pipeline.name: pipeline for pipeline in (COMPACT, BALANCED, FAST)}


class Stages:
    """Registers of a block that move on together.

    Parameters
    ----------
    m : Module
        Takes them.
    enable : Value
    ends : bool
        Where a value waits for several clocks, the last of its registers is a flip-flop of its own, with a reset, and
        not the end of a shift register, which is slow.
    """

    def __init__(self, m: Module, enable: ValueLike, ends: bool = False) -> None:
        self._m, self._enable, self._ends = m, enable, ends

    def after(self, name: str, value: ValueLike, clocks: int = 1, reset_less: bool = True) -> Any:
        """``value``, ``clocks`` enabled clocks late, in registers called by ``name``; itself for 0 clocks."""
        value = Value.cast(value)
        if not clocks:
            return value
        width, shared = len(value), clocks - (self._ends and clocks > 1)
        last = Signal(value.shape(), name=name, reset_less=reset_less and shared == clocks)
        with self._m.If(self._enable):
            if clocks == 1:
                self._m.d.sync += last.eq(value)
            else:
                before = Signal(width * (clocks - 1), name=f"{name}_waiting", reset_less=reset_less)
                self._m.d.sync += [before.eq(Cat(value, before)), last.eq(before[-width:])]
        return last
