"""Which of two files is of the left camera, as far as their names tell."""

import re
from pathlib import Path

# In this order: words, letters, and numbers, which may begin with 0 or with 1.
_PAIRS = (("left", "right"), ("l", "r"), ("0", "1"), ("1", "2"))


def by_name(first, second) -> tuple[int, bool] | None:
    """0 or 1, whichever of the two paths is that of the left, or of the first, camera, and whether the names say "left"
    and "right" (otherwise they count); None if they do not tell.

    The folder tells where both files have one name.
    """
    paths = [Path(str(path)) for path in (first, second)]
    parts = [paths[0].stem, paths[1].stem]
    if parts[0] == parts[1]:
        parts = [path.parent.name for path in paths]
    words = [_words(part) for part in parts]
    for left, right in _PAIRS:
        for index in (0, 1):
            if left in words[index] - words[1 - index] and right in words[1 - index] - words[index]:
                return index, left in ("left", "l")
    return None


def _words(name):
    """Runs of letters and numbers, without zeros before them: cam_left2 has cam, left and 2, camR cam and r."""
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+|[0-9]+", name)
    found = {word.lower().lstrip("0") or "0" for word in words}
    return found | {side for word in found for side in ("left", "right") if side in word}
