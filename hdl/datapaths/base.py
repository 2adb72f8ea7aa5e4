"""What every datapath is: parameters that were fitted to a map, an integer model, and the hardware they describe."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2

from hdl.arithmetic.cost import Cost
from hdl.arithmetic.cuts import COMPACT, Pipeline
from hdl.arithmetic.fixedpoint import Q
from hdl.errors import InputError
from hdl.geometry.coordinates import Coordinates
from hdl.geometry.view import View

# Error allowed on top of the rounding to fraction_bits where no budget is given, px.
ARITHMETIC_ERROR = 0.002


def default_budget(fraction_bits: int) -> float:
    """Largest coordinate error, px, of a datapath that computes what it names: rounding and a little arithmetic."""
    return 2.0 ** -(fraction_bits + 1) + ARITHMETIC_ERROR


def fitted_budget(fraction_bits: int) -> float:
    """Largest coordinate error, px, of a datapath that is fitted to the map, where no budget is given: 0.05 px, or
    three halves of what rounding alone may cost if that is more."""
    return max(0.05, 1.5 * 2.0 ** -(fraction_bits + 1))


# px. Words that are shorter yet save next to nothing, and their divisors may be 0.
COARSEST = 1.0


def check_budget(budget: float, fraction_bits: int) -> None:
    """Raise InputError where rounding alone exceeds the budget, px."""
    rounding = 2.0 ** -(fraction_bits + 1)
    if budget <= rounding:
        raise InputError(
            "--max-error",
            None,
            budget,
            f"rounding to {fraction_bits} fraction bits alone costs up to {rounding} px; more --fraction-bits help",
        )


def word_length_budget(max_error: float | None, fraction_bits: int) -> float:
    """What the word lengths of a datapath that follows an equation may cost, px: ``max_error``, its default or, where
    that is more, `COARSEST`. Raises InputError as `check_budget` does."""
    budget = default_budget(fraction_bits) if max_error is None else min(max_error, COARSEST)
    check_budget(budget, fraction_bits)
    return budget


class DatapathSignature(wiring.Signature):
    """The one interface between the rectifier and a datapath, seen from the datapath.

    Members
    -------
    enable : In(1)
        The pipeline moves on in this clock.
    step : In(1)
        The position is taken in this clock; only together with ``enable``.
    x, y : In
        Raster position in the rectified frame, px.
    end_of_line, end_of_frame : In(1)
        The position is its row's, its frame's, last one.
    u, v : Out
        Source column and row, fixed point, ``latency`` enabled clocks after their position was taken.
    """

    def __init__(self, width: int, height: int, u: Q, v: Q) -> None:
        super().__init__(
            {
                "enable": In(1),
                "step": In(1),
                "x": In(ceil_log2(width)),
                "y": In(ceil_log2(height)),
                "end_of_line": In(1),
                "end_of_frame": In(1),
                "u": Out(u.shape),
                "v": Out(v.shape),
            }
        )


@dataclass(frozen=True)
class Datapath(ABC):
    """The parameters of one datapath for one view; made by `fit`, shared by the integer model and the hardware.

    Parameters
    ----------
    width, height : int
        Frame size, px.
    fraction_bits : int
        Fraction bits of ``u`` and ``v``.
    pipeline : Pipeline
        The core's; it decides the hardware's registers, never its values.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    supports_lens: ClassVar[bool] = False
    has_default_budget: ClassVar[bool] = True  # else its error is what the rig makes of it, where no budget is given

    width: int
    height: int
    fraction_bits: int
    pipeline: Pipeline = field(default=COMPACT, kw_only=True)

    @classmethod
    @abstractmethod
    def fit(cls, view: View, fraction_bits: int, max_error: float | None = None) -> "Datapath":
        """Choose the parameters for ``view`` (`hdl.geometry.view.View`): the cheapest that meet ``max_error`` (px,
        rounding included) at every pixel whose source is inside the image, or, without a budget, that compute what the
        datapath names within `default_budget`, or follow the map within `fitted_budget`. Raises InputError where no
        word lengths do; a datapath whose error the rig decides and not its word lengths may ignore the budget, which
        the caller checks in any case."""

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width)."""
        return self.height, self.width

    @property
    @abstractmethod
    def coordinates(self) -> Coordinates:
        """The integer model: the `Coordinates` that the hardware computes, bit for bit."""

    @property
    @abstractmethod
    def formats(self) -> dict[str, Q]:
        """Formats of the values along the datapath, name to `Q`."""

    @property
    @abstractmethod
    def cost(self) -> Cost:
        """`Cost` of the hardware, estimated from its word lengths."""

    @property
    @abstractmethod
    def latency(self) -> int:
        """Enabled clocks from a position to its coordinates."""

    @property
    def warm_up(self) -> int:
        """Steps that the hardware needs after reset, through the last positions of a frame, before the first one."""
        return 0

    def with_dsp(self, dsp: bool) -> "Datapath":
        """The same datapath, its multiplications, where it has any, left to the synthesis tool or made of adders."""
        return self

    def with_pipeline(self, pipeline: Pipeline) -> "Datapath":
        """The same datapath with the registers of ``pipeline``."""
        return replace(self, pipeline=pipeline)

    @abstractmethod
    def component(self) -> wiring.Component:
        """The hardware, a `wiring.Component` with the `signature` below."""

    @cached_property
    def coordinate_formats(self) -> tuple[Q, Q]:
        """The narrowest formats (`Q`) of ``u`` and ``v``."""
        u, v = self.coordinates.u_range, self.coordinates.v_range
        return Q.covering(*u, self.fraction_bits), Q.covering(*v, self.fraction_bits)

    @property
    def signature(self) -> DatapathSignature:
        """The `DatapathSignature` of the hardware."""
        return DatapathSignature(self.width, self.height, *self.coordinate_formats)
