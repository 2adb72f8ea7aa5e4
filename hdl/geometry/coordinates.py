"""The source coordinates that a core uses, for every output pixel, and what follows from them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

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
        width, height = source
        column = self.u >> self.fraction_bits
        top = self.v >> self.fraction_bits
        last_row = height - 1
        due = (np.arange(self.height, dtype=top.dtype) * height // self.height)[:, None]
        if border.mode == "replicate":
            # Clamping the row is what BORDER_REPLICATE does to both taps.
            upper = np.clip(top, 0, last_row) - due
            lower = np.clip(top + 1, 0, last_row) - due
            return Window(int(upper.min()), int(lower.max()))
        offset = top - due
        some_column = (column >= -1) & (column <= width - 1)
        upper = offset[some_column & (top >= 0) & (top <= last_row)]
        lower = offset[some_column & (top >= -1) & (top <= last_row - 1)] + 1
        taps = [taps for taps in (upper, lower) if taps.size]
        if not taps:
            raise InputError(None, "map", None, "no output pixel has its source inside the image")
        return Window(int(min(t.min() for t in taps)), int(max(t.max() for t in taps)))

    def error(self, u: np.ndarray, v: np.ndarray, source: tuple[int, int]) -> dict[str, Any]:
        """Error statistics against the float64 map ``u, v`` (px, shape (height, width)).

        Counted are the output pixels whose exact source lies inside the source image, which is of size ``source``
        (width, height; px). ``rounded`` is the paper's measure: the difference of both coordinates after rounding each
        to whole pixels (Hyun and Moon 2015, Table 1).

        Returns the plan's ``error`` entry, lengths in px.
        """
        inside = inside_image(u, v, *source)
        pixels = int(np.count_nonzero(inside))
        if not pixels:
            raise InputError(None, "map", None, "no output pixel has its source inside the image")
        scale = 2.0**-self.fraction_bits
        result, rounded = {}, {}
        squared = np.zeros(pixels)
        for name, stored, in_map in (("u", self.u, u), ("v", self.v, v)):
            used, exact = stored[inside] * scale, in_map[inside]
            difference = used - exact
            squared = squared + difference * difference
            result[name] = _statistics(np.abs(difference))
            rounded[name] = _statistics(np.abs(np.floor(used + 0.5) - np.floor(exact + 0.5)))
        return {**result, "euclidean_max": float(np.sqrt(squared.max())), "pixels": pixels, "rounded": rounded}


def inside_image(u: np.ndarray, v: np.ndarray, width: int, height: int) -> np.ndarray:
    """Which positions (u, v), px, arrays of one shape, lie inside an image of ``width`` x ``height`` px: bool."""
    return (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)


def _statistics(magnitude: np.ndarray) -> dict[str, float]:
    return {"mean": float(magnitude.mean()), "max": float(magnitude.max())}
