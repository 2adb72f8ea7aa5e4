"""The picture of `scripts.figure5`: a row each for the images as they came and for every core."""

from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from hdl.calibration import SIDES

DPI = 100
IMAGE, DETAIL, GAP, EDGE = 640, 232, 10, 24  # px: widths of an image and of a detail, between and around them
HEADER, CAPTION = 150, 48  # px of height
LINES = 16
REACH = 20  # px to either side of a detail's point
CELLS = 120  # of a heat map, along its longer side
LEAST = 0.01  # px, where the scale of errors begins
_LINE, _MARK, _INK, _MUTED = "#e69f00", "#56b4e9", "#1a1a1a", "#595959"
_COLOURS = matplotlib.colormaps["viridis"].with_extremes(bad="#d9d9d9")


@dataclass(frozen=True)
class Row:
    """One row of the figure.

    Members
    -------
    label : str
    images : {side: (height, width) uint8}
    points : {side: (n, 2)}
        Where the images show the pair's points, px; NaN where they do not.
    error : {side: (height, width)} or None
        Coordinate error, px; NaN where not counted.
    measured : dict
        ``row_difference`` and ``coordinate_error`` ({"mean", "max"} or None), ``points``, ``points_by``.
    """

    label: str
    images: dict
    points: dict
    error: dict | None
    measured: dict


def draw(file, title, size, rows, detail):
    """Write the figure.

    Parameters
    ----------
    file : Path
    title : str
    size : (width, height)
        Of the images, px.
    rows : list of Row
    detail : int or None
        The point that is shown enlarged.
    """
    image_height = round(IMAGE * size[1] / size[0])
    width = 2 * EDGE + 2 * IMAGE + 2 * DETAIL + 4 * GAP
    # Details are squares, heat maps as wide; both must fit beside the images.
    row_height = max(image_height, DETAIL + GAP + round(DETAIL * size[1] / size[0]))
    page = _Page(width, HEADER + len(rows) * (row_height + CAPTION) + EDGE)
    page.text(EDGE, 40, title, size=17, weight="bold")
    page.text(
        EDGE,
        72,
        "Pixels are those of the exported Verilog. A point should lie on the same line in both images.",
        size=13,
        colour=_MUTED,
    )
    right = EDGE + 2 * IMAGE + 3 * GAP
    for x, text in (
        (EDGE, "left"),
        (EDGE + IMAGE + GAP, "right"),
        (right, "one point enlarged; coordinate error of each pixel"),
    ):
        page.text(x, HEADER - 14, text, size=13)
    errors = [error for row in rows if row.error for error in row.error.values()]
    norm = LogNorm(LEAST, 10 ** np.ceil(np.log10(max(np.nanmax(error) for error in errors))))
    _scale(page, norm, right)
    for index, row in enumerate(rows):
        top = HEADER + index * (row_height + CAPTION)
        _pair(page.axes(EDGE, top, 2 * IMAGE + GAP, image_height), row, size)
        for place, side in enumerate(SIDES):
            x = right + place * (DETAIL + GAP)
            if detail is not None:
                _enlarged(page.axes(x, top, DETAIL, DETAIL), row, side, detail)
            if row.error:
                height = round(DETAIL * size[1] / size[0])
                _heat(page.axes(x, top + row_height - height, DETAIL, height), row.error[side], norm)
        page.text(EDGE, top + row_height + 22, row.label, size=14, weight="bold")
        page.text(EDGE + 2 * IMAGE + GAP, top + row_height + 22, _rows(row), size=13, align="right")
        if row.error:
            page.text(
                right,
                top + row_height + 22,
                f"off by a distance of {_range(row.measured['coordinate_error'])}",
                size=13,
            )
    page.figure.savefig(file, dpi=DPI)


class _Page:
    """A figure whose places are px from its upper left corner."""

    def __init__(self, width, height):
        self.width, self.height = width, height
        self.figure = Figure((width / DPI, height / DPI), dpi=DPI, facecolor="white")

    def axes(self, x, y, width, height):
        place = x / self.width, 1 - (y + height) / self.height, width / self.width, height / self.height
        axes = self.figure.add_axes(place)
        axes.set_axis_off()
        return axes

    def text(self, x, y, text, *, size, weight="normal", colour=_INK, align="left"):
        self.figure.text(
            x / self.width, 1 - y / self.height, text, size=size, weight=weight, color=colour, ha=align, va="baseline"
        )


def _pair(axes, row, size):
    width, height = size
    gap = GAP * width / IMAGE
    for left, side in zip((0, width + gap), SIDES):
        axes.imshow(row.images[side], cmap="gray", vmin=0, vmax=255, extent=(left, left + width, height, 0))
    axes.hlines((np.arange(LINES) + 0.5) * height / LINES, 0, 2 * width + gap, colors=_LINE, linewidths=0.9)
    axes.set(xlim=(0, 2 * width + gap), ylim=(height, 0))


def _enlarged(axes, row, side, detail):
    """The neighbourhood of a point, around the row on which the left image has it."""
    (x, y), line = row.points[side][detail], row.points["left"][detail][1]
    axes.imshow(row.images[side], cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    axes.axhline(line, color=_LINE, linewidth=1.6)
    axes.plot(x, y, "+", color=_MARK, markersize=17, markeredgewidth=2.2)
    axes.set(xlim=(x - REACH, x + REACH), ylim=(line + REACH, line - REACH))


def _heat(axes, error, norm):
    """Each cell shows the largest error in it."""
    step = -(-max(error.shape) // CELLS)
    height, width = (-(-length // step) * step for length in error.shape)
    padded = np.full((height, width), -1.0)
    padded[: error.shape[0], : error.shape[1]] = np.nan_to_num(error, nan=-1.0)
    cells = padded.reshape(height // step, step, width // step, step).max(axis=(1, 3))
    axes.imshow(
        np.ma.masked_less(cells, 0).clip(norm.vmin), cmap=_COLOURS, norm=norm, interpolation="nearest", aspect="auto"
    )


def _scale(page, norm, x):
    page.text(x, 40, "coordinate error, px, logarithmic; gray: not counted", size=13)
    axes = page.axes(x, 54, 2 * DETAIL + GAP, 16)
    axes.set_axis_on()
    page.figure.colorbar(ScalarMappable(norm, _COLOURS), cax=axes, orientation="horizontal")
    axes.tick_params(labelsize=12)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _rows(row):
    """The row difference, in words."""
    difference = row.measured["row_difference"]
    points = {"truth": "known points", "chessboard": "chessboard corners"}.get(row.measured["points_by"], "features")
    if not difference:
        return "no point is found in both images"
    return f"rows of {row.measured['points']} {points} differ by {_range(difference)}"


def _range(statistics):
    mean, largest = (f"{value:.{3 if value < 1 else 1}f} px" for value in (statistics["mean"], statistics["max"]))
    return f"{mean} on average, {largest} at most"
