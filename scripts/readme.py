"""Generated parts of the README, between ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->``."""

import re
from pathlib import Path

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
    """Whether the README's part ``name`` is ``text``."""
    return replaced(name, text) == README.read_text(encoding="utf-8")


def update(name, text):
    """Write ``text`` into the README's part ``name``."""
    README.write_text(replaced(name, text), encoding="utf-8")
