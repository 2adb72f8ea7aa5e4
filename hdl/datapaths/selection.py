"""``--datapath auto``: the cheapest datapath that meets the budget, and why."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from hdl.arithmetic.cost import Cost
from hdl.arithmetic.cuts import COMPACT, Pipeline
from hdl.datapaths import DATAPATHS, Datapath
from hdl.datapaths.base import check_budget, fitted_budget
from hdl.errors import BudgetError, InputError
from hdl.geometry.view import View


@dataclass(frozen=True)
class Considered:
    """One datapath as a candidate.

    Members
    -------
    name : str
    datapath : Datapath or None
        None where it cannot meet the budget.
    error : float or None
        Largest coordinate error, px; None where it could not be built at all.
    cost : Cost or None
    verdict : str
        "chosen", or why it was not.
    """

    name: str
    datapath: Datapath | None
    error: float | None
    cost: Cost | None
    verdict: str


def fit(name: str, view: View, fraction_bits: int, max_error: float | None, dsp: bool = True) -> Datapath:
    """`Datapath.fit` of the datapath ``name``, whose multiplications, where it has any, become ``dsp`` or adders."""
    try:
        datapath = _fitted(name, view, fraction_bits, max_error)
    except BudgetError as refusal:
        if max_error is None:
            raise BudgetError(_default(refusal.budget), refusal.reached, refusal.who) from None
        raise
    return datapath.with_dsp(dsp)


@lru_cache(maxsize=1)
def _fitted(name: str, view: View, fraction_bits: int, max_error: float | None) -> Datapath:
    """The same parameters serve hardware with DSP blocks and without, and of every pipeline."""
    return DATAPATHS[name].fit(view, fraction_bits, max_error)


def _default(budget: float) -> str:
    """How a message names a budget that the user did not give."""
    return f"{budget:g}, the default"


def choose(
    view: View,
    fraction_bits: int,
    max_error: float | None,
    goal: str,
    progress: Callable[[str], object] = lambda step: None,
    dsp: bool = True,
    pipeline: Pipeline = COMPACT,
) -> list[Considered]:
    """The candidates for ``view``: those within the budget in the order of their cost, the first one chosen, then the
    others.

    Parameters
    ----------
    view : hdl.geometry.rectification.View
    fraction_bits : int
    max_error : float or None
        Budget, px per axis; None: `fitted_budget`.
    goal : str
        What to save; a key of `hdl.arithmetic.cost.GOALS`.
    progress : callable
    dsp : bool
        See `fit`.
    pipeline : Pipeline
        Of all of them; it decides on registers, and so on the cost.

    Returns
    -------
    list of Considered

    Raises
    ------
    InputError
        If no datapath meets the budget: the message has the least error reached, and by which.
    """
    budget = fitted_budget(fraction_bits) if max_error is None else max_error
    check_budget(budget, fraction_bits)
    fitting: list[Considered] = []
    others: list[Considered] = []
    for name, kind in DATAPATHS.items():
        if view.lens and not kind.supports_lens:
            continue
        progress(f"trying {name}")
        try:
            datapath = fit(name, view, fraction_bits, budget, dsp).with_pipeline(pipeline)
        except BudgetError as refusal:
            others.append(Considered(name, None, refusal.reached, None, f"off by {refusal.reached:.3g} px"))
            continue
        except InputError as refusal:
            others.append(Considered(name, None, None, None, refusal.problem))
            continue
        worst = datapath.coordinates.largest_error(*view.map(), view.source_size)
        entry = Considered(name, datapath, worst, datapath.cost, "costs more")
        if worst <= budget:
            fitting.append(entry)
        else:
            others.append(Considered(name, None, worst, datapath.cost, f"off by {worst:.3g} px"))
    if not fitting:
        reached = min(((entry.error, entry.name) for entry in others if entry.error is not None), default=None)
        raise InputError(
            "--max-error",
            None,
            _default(budget) if max_error is None else budget,
            f"no datapath meets it for the {view.side} camera; "
            + (f"{reached[1]} comes closest with {reached[0]:.3g} px" if reached else "none gives an error at all"),
        )
    fitting.sort(key=lambda entry: entry.cost.weight(goal))
    first = fitting[0]
    return [Considered(first.name, first.datapath, first.error, first.cost, "chosen"), *fitting[1:], *others]
