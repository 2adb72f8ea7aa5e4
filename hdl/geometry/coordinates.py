"""The source coordinates that a core uses, for every output pixel, and what follows from them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hdl.arithmetic.bands import banded, bands
from hdl.errors import InputError


@dataclass(frozen=True)
class Border:
    """What a tap outside the source is worth.

    Parameters
    ----------
    mode : str
        ``constant`` (each such tap has ``value``) or ``replicate`` (it takes the nearest source pixel);
        cv2.BORDER_CONSTANT and cv2.BORDER_REPLICATE.
    value : int
        Pixel value for ``constant``, the same in each channel.
    """

    mode: str = "constant"
    value: int = 0

    def __post_init__(self) -> None:
        if self.mode not in ("constant", "replicate"):
            raise InputError("--border", None, self.mode, "must be constant, constant:VALUE or replicate")

    @classmethod
    def parse(cls, text: str) -> "Border":
        """From the command line's ``constant``, ``constant:VALUE`` or ``replicate``; raises InputError."""
        mode, colon, value = text.partition(":")
        if not colon:
            return cls(mode)
        if mode != "constant" or not (value.isascii() and value.isdigit() and len(value) <= 5):
            raise InputError("--border", None, text, "must be constant, constant:VALUE or replicate")
        return cls(mode, int(value))


@dataclass(frozen=True)
class Window:
    """Which source rows an output row needs: rows y + d_lo to y + d_hi of the source for row y (px).

    Of a source of another height, y stands for the source row that is due with row y: both frames take the same time.
    Source: DESIGN section 5; both ends are exhaustive over all taps that are read inside the source.
    """

    d_lo: int
    d_hi: int

    @property
    def lead(self) -> int:
        """Source rows that must be complete beyond row y before output row y starts.

        A core cannot start a frame before that frame's first row is in, so a map that looks upwards only has lead 0.
        """
        return max(self.d_hi, 0)

    def leaves_room(self, height: int) -> bool:
        """Whether a core can follow: output row 0 starts before the last one of ``height`` source rows is in."""
        return self.lead <= height - 2

    @property
    def rows(self) -> int:
        """Source rows kept: those between the extremes, one being written, one being released; an even number."""
        spread = self.lead - self.d_lo
        return spread + 3 + (spread + 3) % 2


@dataclass(frozen=True)
class Coordinates:
    """Fixed-point source coordinates of every output pixel.

    Parameters
    ----------
    u, v : int32 arrays (height, width)
        Column and row of the source, in units of 2**-fraction_bits px.
    fraction_bits : int
    """

    u: np.ndarray
    v: np.ndarray
    fraction_bits: int

    @classmethod
    def banded(
        cls,
        shape: tuple[int, int],
        fraction_bits: int,
        u: Callable[[slice], np.ndarray],
        v: Callable[[slice], np.ndarray],
    ) -> "Coordinates":
        """Of a frame of ``shape`` (height, width); ``u``, ``v``: functions of a slice of its rows, to integers."""
        stored_u, stored_v = (banded(shape, np.int32, coordinate) for coordinate in (u, v))
        return cls(stored_u, stored_v, fraction_bits)

    @property
    def height(self) -> int:
        return self.u.shape[0]

    @property
    def width(self) -> int:
        return self.u.shape[1]

    @cached_property
    def u_range(self) -> tuple[int, int]:
        """Least and greatest ``u``, in units of 2**-fraction_bits px."""
        return int(self.u.min()), int(self.u.max())

    @cached_property
    def v_range(self) -> tuple[int, int]:
        """Least and greatest ``v``, in units of 2**-fraction_bits px."""
        return int(self.v.min()), int(self.v.max())

    def window(self, border: Border, source: tuple[int, int]) -> Window:
        """The `Window` of these coordinates under a `Border`.

        ``source``: (width, height) of the source image, px. Raises InputError where no tap is inside the source.
        """
        last_column, last_row = source[0] - 1, source[1] - 1
        spans = []
        for rows in bands(self.u.shape):
            top = self.v[rows] >> self.fraction_bits
            due = (np.arange(rows.start, rows.stop, dtype=top.dtype) * source[1] // self.height)[:, None]
            if border.mode == "replicate":
                # Clamping the row is what BORDER_REPLICATE does to both taps.
                upper, lower = (np.clip(row, 0, last_row) - due for row in (top, top + 1))
            else:
                column = self.u[rows] >> self.fraction_bits
                some_column = (column >= -1) & (column <= last_column)
                upper, lower = ((row - due)[some_column & (row >= 0) & (row <= last_row)] for row in (top, top + 1))
            spans += [(taps.min(), taps.max()) for taps in (upper, lower) if taps.size]
        if not spans:
            raise InputError(None, "map", None, "no output pixel has its source inside the image")
        lowest, highest = zip(*spans)
        return Window(int(min(lowest)), int(max(highest)))

    def largest_error(self, u: np.ndarray, v: np.ndarray, source: tuple[int, int]) -> float:
        """The largest error of both axes that `error` finds, px; its arguments."""
        scale, largest = 2.0**-self.fraction_bits, 0.0
        for rows in bands(u.shape):
            outside = ~inside_image(u[rows], v[rows], *source)
            for stored, exact in ((self.u, u), (self.v, v)):
                difference = stored[rows] * scale
                difference -= exact[rows]
                np.abs(difference, out=difference)
                difference[outside] = 0
                largest = max(largest, float(difference.max()))
        return largest

    def error(self, u: np.ndarray, v: np.ndarray, source: tuple[int, int]) -> dict[str, Any]:
        """Error statistics against the float64 map ``u, v`` (px, shape (height, width)).

        Counted are the output pixels whose exact source lies inside the source image, which is of size ``source``
        (width, height; px). ``rounded`` is the paper's measure: the difference of both coordinates after rounding each
        to whole pixels (Hyun and Moon 2015, Table 1).

        Returns the plan's ``error`` entry, lengths in px.
        """
        scale = 2.0**-self.fraction_bits
        magnitudes = {name: np.empty(u.size) for name in "uv"}
        off: dict[str, list[tuple[float, float]]] = {name: [] for name in "uv"}
        pixels, squared = 0, 0.0
        for rows in bands(u.shape):
            inside = inside_image(u[rows], v[rows], *source)
            counted = slice(pixels, pixels + int(np.count_nonzero(inside)))
            pixels, squares = counted.stop, np.zeros(counted.stop - counted.start)
            for name, stored, in_map in (("u", self.u, u), ("v", self.v, v)):
                used, exact = stored[rows][inside] * scale, in_map[rows][inside]
                difference = used - exact
                squares += difference * difference
                np.abs(difference, out=magnitudes[name][counted])
                steps = np.abs(np.floor(used + 0.5) - np.floor(exact + 0.5))
                off[name].append((steps.sum(), steps.max(initial=0)))
            squared = max(squared, squares.max(initial=0))
        if not pixels:
            raise InputError(None, "map", None, "no output pixel has its source inside the image")
        result = {name: _statistics(magnitude[:pixels]) for name, magnitude in magnitudes.items()}
        rounded = {}
        for name, parts in off.items():
            sums, greatest = zip(*parts)
            rounded[name] = {"mean": float(sum(sums) / pixels), "max": float(max(greatest))}
        return {**result, "euclidean_max": float(np.sqrt(squared)), "pixels": pixels, "rounded": rounded}


def inside_image(u: np.ndarray, v: np.ndarray, width: int, height: int) -> np.ndarray:
    """Which positions (u, v), px, arrays of one shape, lie inside an image of ``width`` x ``height`` px: bool."""
    return (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)


def _statistics(magnitude: np.ndarray) -> dict[str, float]:
    return {"mean": float(magnitude.mean()), "max": float(magnitude.max())}
