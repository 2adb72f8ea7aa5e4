"""The report's charts, as SVG for the page: text stays text, and colours follow the page's light or dark scheme.

matplotlib draws them: its SVG needs no script, where an interactive library would bring its own into the page.
"""

import io
import re
from html import escape

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

# Stand-ins for the page's custom properties, which matplotlib does not know.
INK, MUTED, GRID, VOID, SURFACE = "#010203", "#010204", "#010205", "#010206", "#010207"
LEFT, RIGHT, ACCENT = "#010208", "#010209", "#01020a"
_PROPERTIES = {
    INK: "ink",
    MUTED: "muted",
    GRID: "grid",
    VOID: "void",
    SURFACE: "surface",
    LEFT: "left",
    RIGHT: "right",
    ACCENT: "accent",
}
UNKNOWN = "calibration's unit"
SIDE_COLOURS = {"left": LEFT, "right": RIGHT}
_WIDTH, _HEIGHT = 4.6, 3.3  # inches of 72 units
_CELLS = 160  # of a heat map, along its longer side
_STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "report",
    "text.parse_math": False,
    "font.size": 9,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}


def heat_map(name, title, error, peak, limit):
    """Magnitudes of a coordinate error; each cell shows the largest of its pixels.

    Parameters
    ----------
    name : str
        Unique on the page, an identifier.
    title : str
        For those who do not see the chart.
    error : (height, width)
        px, NaN where not counted.
    peak : `hdl.report.figures.Largest`
    limit : float
        End of the colour scale, px: the same for all that are to be compared.
    """
    height, width = error.shape
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(_WIDTH, _WIDTH * 0.8 * height / width + 0.3)
        axes.grid(False)
        axes.set_facecolor(VOID)
        image = axes.imshow(
            _cells(np.abs(error), cell_size(error.shape)),
            cmap="cividis",
            vmin=0,
            vmax=limit,
            extent=(-0.5, width - 0.5, height - 0.5, -0.5),
            interpolation="none",
        )
        for radius, colour, line in ((0.032, "black", 3.2), (0.032, "white", 1.4)):
            axes.add_patch(Circle((peak.x, peak.y), radius * width, fill=False, ec=colour, lw=line, clip_on=False))
        axes.spines[:].set_visible(False)
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
        bar = figure.colorbar(image, cax=axes.inset_axes([1.03, 0, 0.045, 1]))
        bar.set_label("error, px")
        bar.outline.set_visible(False)
        bar.ax.yaxis.set_major_locator(MaxNLocator(5))
        return _svg(figure, name, title)


def ladder(name, title, ladders, chosen):
    """Error against cost of the datapaths that were considered.

    Parameters
    ----------
    ladders : {side: `hdl.report.figures.Ladder`}
    chosen : {side: str}
        The datapath in the core.
    """
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure()
        markers, tips = {"left": "o", "right": "s"}, {}
        labels = {}
        for side, ladder in ladders.items():
            shown = [entry for entry in ladder.entries if entry.cost and entry.error]
            for entry in shown:
                x, y = entry.cost.weight(), entry.error
                taken = entry.name == chosen[side]
                (point,) = axes.plot(
                    x,
                    y,
                    markers[side],
                    ms=9 if taken else 6.5,
                    mfc=SIDE_COLOURS[side] if taken else SURFACE,
                    mec=SIDE_COLOURS[side],
                    mew=1.5,
                    label=side if taken else None,
                )
                point.set_gid(f"{side}-{entry.name}")
                tips[f"{side}-{entry.name}"] = (
                    f"{entry.name}, {side} camera: {y:.4f} px, {entry.cost.lut} LUT, {entry.cost.ff} FF, "
                    f"{entry.cost.ramb18} RAMB18, {entry.cost.dsp} DSP; {entry.verdict}"
                )
                # One label for both cameras where both have the datapath: their points are near each other.
                labels.setdefault(entry.name, (x, y, taken))
        for budget in sorted({ladder.budget for ladder in ladders.values()}):
            axes.axhline(budget, color=ACCENT, lw=1.2, dashes=(4, 2), label=f"budget {budget:g} px", zorder=1)
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            _roomy(axis, 0.35)
            _plain_log(axis)
        _label_points(figure, axes, labels)
        axes.set_xlabel("cost of the coordinates, LUT and what is worth as many")
        axes.set_ylabel("largest error, px")
        axes.legend(loc="lower right", ncols=3, columnspacing=1.2, borderaxespad=0, bbox_to_anchor=(1, 1.01))
        return _svg(figure, name, title, tips)


def row_needs(name, title, low, high, window, side):
    """Source rows that each output row needs, relative to the output row, between D_lo and D_hi.

    Parameters
    ----------
    low, high : (height,)
        From `hdl.report.figures.row_needs`.
    window : `hdl.geometry.coordinates.Window`
    side : str
    """
    rows = np.arange(len(low))
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(_WIDTH, 3.0)
        colour = SIDE_COLOURS[side]
        axes.fill_between(rows, low, high, color=colour, alpha=0.28, lw=0, step="mid")
        axes.step(rows, low, color=colour, lw=1.3, where="mid")
        axes.step(rows, high, color=colour, lw=1.3, where="mid")
        axes.axhline(0, color=MUTED, lw=0.8)
        reach = max(window.rows, 4)
        for value, label, up in ((window.d_hi, "D_hi", True), (window.d_lo, "D_lo", False)):
            axes.axhline(value, color=INK, lw=0.9, dashes=(4, 2))
            axes.annotate(
                f"{label} = {value:+d}",
                (0.5, value),
                xycoords=("axes fraction", "data"),
                xytext=(0, 3 if up else -3),
                textcoords="offset points",
                ha="center",
                va="bottom" if up else "top",
                color=INK,
            )
        axes.set_ylim(min(window.d_lo, 0) - 0.22 * reach, max(window.d_hi, 0) + 0.22 * reach)
        axes.set_xlim(0, len(low) - 1)
        axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:+.0f}" if value else "0"))
        axes.set_xlabel("output row")
        axes.set_ylabel("source row - output row")
        return _svg(figure, name, title)


def depth(name, title, entries, focal, baseline, matching, unit):
    """Depth error against distance, mean and largest, and what ``matching`` px of a matcher's own error make of it.

    Parameters
    ----------
    entries : list of `hdl.report.stereo.AtDistance`
    """
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure()
        at = np.array([entry.distance for entry in entries])
        axes.plot(at, matching * at**2 / (focal * baseline), color=MUTED, lw=1.2, dashes=(4, 2))
        axes.plot(at, [entry.depth_max for entry in entries], "o-", color=RIGHT, lw=1.6, ms=5)
        axes.plot(at, [entry.depth_mean for entry in entries], "s-", color=LEFT, lw=1.6, ms=5)
        axes.legend(
            [f"{matching:g} px of matching, for comparison", "cores, largest", "cores, mean"],
            loc="upper left",
            borderaxespad=0,
        )
        axes.set_xscale("log")
        axes.set_yscale("log")
        _roomy(axes.yaxis, 0.5)
        axes.set_xticks(at, [f"{value:,.6g}" for value in at])
        axes.minorticks_off()
        _plain_log(axes.yaxis)
        axes.set_xlabel(f"distance, {unit or UNKNOWN}")
        axes.set_ylabel(f"depth error, {unit or UNKNOWN}")
        return _svg(figure, name, title)


def _figure(width=_WIDTH, height=_HEIGHT):
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()


def _label_points(figure, axes, labels):
    """Write names beside points, {name: (x, y, bold)}, where they cover neither each other nor a point."""
    figure.draw_without_rendering()
    points = {name: axes.transData.transform(at[:2]) * 72 / figure.dpi for name, at in labels.items()}
    taken = [(x - 5, y - 5, x + 5, y + 5) for x, y in points.values()]
    for name, (x, y, bold) in sorted(labels.items(), key=lambda item: not item[1][2]):
        text = f"{name}, chosen" if bold else name
        half = 2.8 * len(text)
        places = [(0, up) for up in (11, -11, 22, -22, 33, -33)] + [(half + 9, 0), (-half - 9, 0)]

        def box(place, half=half, at=points[name]):
            middle, up = at + np.array(place)
            return middle - half, up - 5, middle + half, up + 5

        place = next((place for place in places if not any(_overlap(box(place), other) for other in taken)), places[0])
        taken.append(box(place))
        axes.annotate(
            text,
            (x, y),
            xytext=place,
            textcoords="offset points",
            ha="center",
            va="center",
            color=INK,
            fontweight="bold" if bold else "normal",
            arrowprops={"arrowstyle": "-", "color": MUTED, "lw": 0.6, "shrinkA": 0, "shrinkB": 4},
        )


def _overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def cell_size(shape):
    """Side of a heat map's cells, px, for a frame of (height, width)."""
    return -(-max(shape) // _CELLS)


def _cells(magnitude, size):
    """The largest value in each square of ``size`` px; NaN, masked, where there is none."""
    height, width = magnitude.shape
    padded = np.full((-(-height // size) * size, -(-width // size) * size), -np.inf)
    padded[:height, :width] = np.where(np.isnan(magnitude), -np.inf, magnitude)
    cells = padded.reshape(padded.shape[0] // size, size, -1, size).max(axis=(1, 3))
    return np.ma.masked_invalid(cells)


def _roomy(axis, decades):
    """Widen a logarithmic axis so that labels at its ends have room."""
    low, high = axis.get_view_interval()
    axis.set_view_interval(low / 10**decades, high * 10**decades, ignore=True)


def _plain_log(axis):
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 300 * low else (1,)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}" if value >= 1 else f"{value:g}"))


def _svg(figure, name, title, tips=()):
    """The chart as an <svg> element that says what it is; its ids begin with ``name``.

    ``tips``: texts to show over the elements of these ids.
    """
    stream = io.StringIO()
    figure.savefig(stream, format="svg", bbox_inches="tight", pad_inches=0.03, metadata={"Date": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    # matplotlib's rules would apply to the whole page, and its metadata name addresses.
    text = re.sub(r"<(metadata|style)\b.*?</\1>", "", text, flags=re.DOTALL)
    text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
    for part, tip in dict(tips).items():
        text = text.replace(f'<g id="{part}">', f'<g id="{part}"><title>{escape(tip)}</title>')
    text = re.sub(r'\bid="([^"]*)"', rf'id="{name}-\1"', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    for colour, custom_property in _PROPERTIES.items():
        text = text.replace(colour, f"var(--{custom_property})")
    return text.replace("<svg", f'<svg class="chart" role="img" aria-label="{escape(title)}"', 1)
