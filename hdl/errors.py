"""The exceptions that reach a user as a message instead of a traceback, and what constructors check by."""

from pathlib import Path


def at_least(least: float, **parameters: float) -> None:
    """Raise ValueError, naming it, for the first of ``parameters`` that is below ``least``."""
    for name, value in parameters.items():
        if value < least:
            raise ValueError(f"{name} = {value}: at least {least} is needed")


class InputError(ValueError):
    """Input that cannot be used. ``str(error)`` is one line: ``WHERE: FIELD = VALUE: PROBLEM``.

    Parameters
    ----------
    where : str | Path | None
        The file, or the command-line option, at fault.
    field : str | None
        The entry within it, in the file's own spelling.
    value : object
        What was found there; shortened so that the message stays one readable line.
    problem : str
        What is wrong and, where it helps, what would be right.
    """

    def __init__(self, where: str | Path | None, field: str | None, value: object, problem: str) -> None:
        location = " = ".join(part for part in (field, _one_line(value)) if part)
        super().__init__(": ".join(str(part) for part in (where, location, problem) if part))
        self.problem = problem


def _one_line(value: object, limit: int = 80) -> str | None:
    if value is None:
        return None
    text = " ".join(str(value).split())
    return text if len(text) <= limit else text[: limit - 3] + "..."


class ToolError(RuntimeError):
    """A tool that failed where the input is not to blame. ``str(error)`` is one line: the tool's own error line, and
    where its log is."""


class BudgetError(InputError):
    """A datapath that cannot be as exact as asked.

    Parameters
    ----------
    budget : float or str
        What was asked, px.
    reached : float
        The least largest error that it can have, px.
    who : str
        The datapath, and the camera where that helps.
    """

    def __init__(self, budget: float | str, reached: float, who: str) -> None:
        super().__init__("--max-error", None, budget, f"{who} reaches {reached:.3g} px and no less")
        self.budget, self.reached, self.who = budget, reached, who
