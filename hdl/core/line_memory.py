"""Line memory that is too much: refused from the float map before a datapath is fitted, with an option that helps."""

import math
from dataclasses import replace

import numpy as np

from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import fitted_budget
from hdl.errors import InputError
from hdl.geometry.coordinates import Coordinates, Window
from hdl.geometry.rectification import rectify
from hdl.stream.linebuffer import LineBufferParameters

# A core's coordinates are not the float map's: so many rows more, or fewer, at either end than their largest error.
_ROUNDED = 1
# px; of datapaths that are as exact as they can be, nobody knows before they are fitted.
_UNKNOWN = 4
_SHARES = (1.1, 0.9, 1.25, 0.8, 1.5, 0.65)  # of the field of view, that are tried
_LOSSES = (0.2, 0.5)  # of --minimise


class LineMemoryError(InputError):
    """More line memory than --max-line-buffer-kib allows.

    Parameters
    ----------
    side : str
    rows : int or str
    kib : float
    allowed : int
        KiB.
    """

    def __init__(self, side, rows, kib, allowed, remedy=""):
        problem = f"the {side} camera's map bends rows so far that {rows} rows are needed, {in_kib(kib)} KiB"
        super().__init__("--max-line-buffer-kib", None, allowed, problem + remedy)
        self.needed = side, rows, kib, allowed

    def with_remedy(self, text):
        """The same, and what would help."""
        return LineMemoryError(*self.needed, f"; {text}")


def in_kib(kib):
    """A size in KiB, in digits enough for small memories too."""
    return f"{kib:,.0f}" if kib >= 10 else f"{kib:.2g}"


def refuse_early(view, options):
    """Raise `LineMemoryError` where the float map of a `View` tells that no core within the error of ``options``,
    `hdl.core.build.Options`, can do with the memory they allow."""
    spare = _off(options)
    if spare is not None and _kib(view, options, -spare - _ROUNDED) > options.max_line_buffer_kib:
        raise LineMemoryError(
            view.side, f"some {view.window.rows}", _kib(view, options, 0), options.max_line_buffer_kib
        )


def remedy(rig, choices, options, *, lens):
    """What to choose instead of the rectification ``choices`` so that line memory is enough, in words; tried out."""
    off = _off(options)
    spare = _ROUNDED + (_UNKNOWN if off is None else off)
    found = []
    for text, other in _alternatives(rig, choices, lens):
        try:
            needed = max(_kib(view, options, spare) for view in rectify(rig, other, lens=lens).values())
        except InputError:
            continue
        if needed <= options.max_line_buffer_kib:
            return f"{text} keeps within it"
        found.append((needed, text))
    if not found:
        return "no other view was found"
    needed, text = min(found)
    return f"{text} needs no more than {in_kib(math.ceil(needed))} KiB, and nothing less was found"


def _alternatives(rig, choices, lens):
    """Other choices of a rectification, each in words."""
    minimised = replace(choices, minimise="rows")
    if not choices.minimise:
        yield "--minimise rows", minimised
        # Rows of the rectified image that are as far apart as the source's need the fewest.
        instead = next(
            (f" in place of {name}" for name in ("--alpha", "--focal", "--fov") if name in choices.given), ""
        )
        fov = _fov(rectify(rig, choices, lens=lens)["left"])
        for share in _SHARES:
            angle = round(fov * share, 1)
            if angle < 180:
                yield f"--fov {angle:g}{instead}", replace(choices, alpha=None, focal=None, fov=angle)
    for loss in _LOSSES:
        if loss > choices.allowed_loss:
            yield f"--minimise rows --max-fov-loss {loss:g}", replace(minimised, max_fov_loss=loss)


def _off(options):
    """By how many rows a core's coordinates may be off; None where no error was asked for and none is kept to."""
    if options.max_error is not None:
        return math.ceil(options.max_error)
    datapath = DATAPATHS.get(options.datapath)  # or auto
    return math.ceil(fitted_budget(options.fraction_bits)) if not datapath or datapath.has_default_budget else None


def _kib(view, options, spare):
    """Line memory for the rows of the float map and ``spare`` ones at either end; 0 where a frame is too small."""
    u, v = (np.floor(axis).astype(np.int32) for axis in view.map())
    window = Coordinates(u, v, 0).window(options.border, view.source_size)
    low, high = window.d_lo - spare, window.d_hi + spare
    if low > high:
        return 0.0
    try:
        buffer = LineBufferParameters(
            view.width, view.height, Window(low, high), None, None, None, None, options.border,
            options.pixel_bits, options.channels,
        )  # fmt: skip
    except ValueError:
        return 0.0
    return buffer.bits / 8192


def _fov(view):
    """Horizontal field of view, outer edge to outer edge, degrees."""
    f, x = view.P[0, 0], view.P[0, 2]
    return math.degrees(math.atan((x + 0.5) / f) + math.atan((view.width - 0.5 - x) / f))
