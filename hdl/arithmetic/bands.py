"""Frames in bands of rows, so small that what is computed of one stays in the cache."""

import numpy as np

PIXELS = 1 << 14


def bands(shape, step=1):
    """Slices of the rows of an array of ``shape`` (height, width), or of every ``step``-th one, from the first on."""
    height, width = shape
    rows = max(1, PIXELS // width) * step
    return [slice(top, min(top + rows, height), step) for top in range(0, height, rows)]


def spread(shape):
    """Slices of the rows too, each of them over the whole height: the first finds most of what there is to find."""
    height, width = shape
    parts = max(1, height * width // PIXELS)
    return [slice(first, None, parts) for first in range(min(parts, height))]


def banded(shape, dtype, part):
    """An array (height, width) whose rows are ``part(rows)`` for each of the `bands`."""
    array = np.empty(shape, dtype)
    for rows in bands(shape):
        array[rows] = part(rows)
    return array
