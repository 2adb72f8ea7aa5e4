"""Generated parts of the README, between ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->``."""

import math
import re
from pathlib import Path

from hdl import files

# Fits end in other last digits on another processor, and synthesis packs a look-up table more or less after harmless
# changes; what is really another core differs by more.
SAME = 0.02
_NUMBER = re.compile(r"\d+(?:\.\d+)?")

README = Path(__file__).resolve().parent.parent / "README.md"


def markdown(headings, rows):
    """A Markdown table; the first column to the left, the others to the right."""
    lines = [headings, ["---"] + ["---:"] * (len(headings) - 1), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def replaced(name, text):
    """The README with ``text`` as its part ``name``. Raises ValueError where it has no such part."""
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    readme = README.read_text(encoding="utf-8")
    if not pattern.search(readme):
        raise ValueError(f"{README.name} has no part {begin} ... {end}")
    return pattern.sub(lambda _: f"{begin}\n{text.strip()}\n{end}", readme)


def is_current(name, text):
    """Whether the README's part ``name`` is ``text``, but for numbers that differ by no more than `SAME`."""
    (words, numbers), (new_words, new_numbers) = map(_split, (README.read_text(encoding="utf-8"), replaced(name, text)))
    return words == new_words and all(math.isclose(old, new, rel_tol=SAME) for old, new in zip(numbers, new_numbers))


def _split(text):
    """The text without its numbers, and these."""
    return _NUMBER.split(text), [float(number) for number in _NUMBER.findall(text)]


def check_writable():
    """Raise InputError, before what is to be written is measured, where the README cannot be."""
    files.check_targets("--readme", [README])


def update(name, text):
    """Write ``text`` into the README's part ``name``."""
    files.write({README: replaced(name, text)})
