"""Where the registers of a core are: pipelines by name, and the registers of values that wait in them."""

from dataclasses import dataclass, replace
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
    result : bool
        With ``ports``: one behind the interpolator too, and not only in the output's.
    products : int or None
        Within products and between the adders that sum them: how many adders may follow one on the other within a
        clock. None: all of them.
    narrow : bool
        No register, but a slice of the line buffer's memories for each bit: more block RAMs, and fewer look-up tables
        to choose from.
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
    result: bool = False
    products: int | None = None
    narrow: bool = False

    @property
    def lean(self) -> "Pipeline":
        """The same with fewer look-up tables, for more block RAMs and flip-flops."""
        return replace(self, interpolator=RADIX4, narrow=True)


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
    products=2,
)
FAST = replace(
    BALANCED,
    name="fast",
    summary="registers wherever there may be one",
    interpolator=TREE,
    address=True,
    blocks=True,
    result=True,
    products=1,
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
        The last of several registers in which a value waits has a reset, so that it is a flip-flop of its own and not
        the end of a shift register, which is slower.
    """

    def __init__(self, m: Module, enable: ValueLike, ends: bool = False) -> None:
        self._m, self.enable, self._ends = m, enable, ends

    def after(self, name: str, value: ValueLike, clocks: int = 1, reset_less: bool = True) -> Any:
        """``value``, ``clocks`` enabled clocks late, in registers called ``name``; itself for 0 clocks.

        Registers are reset to 0 unless ``reset_less``; those that are not reset may become shift registers.
        """
        value = Value.cast(value)
        if not clocks:
            return value
        if self._ends and clocks > 1:
            value = self._registers(f"{name}_waiting", value, clocks - 1, reset_less)
            clocks, reset_less = 1, False
        return self._registers(name, value, clocks, reset_less)

    def _registers(self, name, value, clocks, reset_less):
        registers = Signal(len(value) * clocks, name=name, reset_less=reset_less)
        with self._m.If(self.enable):
            self._m.d.sync += registers.eq(Cat(value, registers))
        last = registers[-len(value) :]
        return last.as_signed() if value.shape().signed else last
