"""The page: the template, filled with a `Report`."""

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hdl.core.line_memory import in_kib
from hdl.datapaths import DATAPATHS
from hdl.report import charts, figures, wiring
from hdl.report.diagram import diagrams
from hdl.report.measure import Report, jpeg
from hdl.report.video import FORMATS, margins
from hdl.tools.synthesis import conditions
from hdl.tools.xc7_timing import MODEL
from sim.rows import Rows, most

LINES = 16  # across the pair of pictures
MATCHING = 0.25  # px of a matcher's own error, for comparison


def page(report: Report) -> str:
    """The HTML of a report. It asks nothing of the network: pictures, style and script are in it."""
    environment = Environment(
        loader=PackageLoader("hdl.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = lambda value: f"{value:,.6g}"
    environment.filters["kib"] = in_kib
    environment.filters["figures3"] = lambda value: f"{value:,.3g}"
    cameras = report.cameras
    cores = {side: camera.core for side, camera in cameras.items()}
    unit = report.first.plan.rectification.unit
    return environment.get_template("page.html").render(
        report=report,
        cameras=cameras,
        plan=report.first.plan,
        headlines=headlines(report),
        line=report.line,
        pictures=pictures(cameras),
        lines=[(index + 0.5) / LINES for index in range(LINES)],
        diagrams=diagrams(cores),
        cell=charts.cell_size((report.first.plan.height, report.first.plan.width)),
        formats=list(dict.fromkeys(name for camera in cameras.values() for name in camera.plan.formats)),
        lensless=[name for name, kind in DATAPATHS.items() if report.first.plan.lens and not kind.supports_lens],
        maps=[(side, axis, camera) for side, camera in cameras.items() for axis in "uv"],
        charts=drawn(report),
        memory={side: figures.memory(core) for side, core in cores.items()},
        timing={side: figures.timing(core, report.clock_mhz) for side, core in cores.items()},
        ports={side: figures.ports(camera.planned) for side, camera in cameras.items()},
        example=wiring.example({side: camera.planned for side, camera in cameras.items()}),
        warnings=warnings(report),
        versions=figures.versions(),
        synthesis_conditions=conditions(dsp=report.first.plan.dsp),
        timing_model=MODEL,
        formats_of_video=FORMATS,
        slowest=min((camera.path.mhz for camera in cameras.values() if camera.path), default=None),
        margins={side: margins(camera.path.mhz) for side, camera in cameras.items() if camera.path},
        unit=unit or charts.UNKNOWN,
        matching=MATCHING,
    )


def warnings(report):
    """What a user of the cores should know, each one sentence."""
    found = [text for camera in report.cameras.values() for text in figures.warnings(camera.plan)]
    asked = report.rows and report.rows.suspicious
    return [f"{asked[0].upper()}{asked[1:]}", *found] if asked else found


def headlines(report):
    """The figures on top: (value, what it is, details)."""
    cameras = report.cameras.values()
    plan = report.first.plan
    memory = [figures.memory(camera.core) for camera in cameras]
    timing = [figures.timing(camera.core, report.clock_mhz) for camera in cameras]
    lines, times = ([f"{t[name]:,.1f}" for t in timing] for name in ("latency_lines", "latency_us"))
    worst = max(peak.value for camera in cameras for peak in camera.peaks.values())
    euclidean = max(camera.plan.error.euclidean_max for camera in cameras)
    found = [
        (
            f"{worst:.3f} px",
            "largest coordinate error",
            f"of the source image, per axis, at any pixel, rounding included; {euclidean:.3f} px as a distance",
        )
    ]
    if report.first.resources:
        used = [camera.resources for camera in cameras]
        found.append(
            (
                f"{_sum(r.lut for r in used)} LUT",
                "measured, whole core" + ("s" if len(used) > 1 else ""),
                f"{_sum(r.ff for r in used)} FF, {_sum(r.dsp for r in used)} DSP, "
                f"{_sum(r.ramb36 + r.ramb18 / 2 for r in used)} block RAM of 36 Kb",
            )
        )
    else:
        costs = [camera.core.parameters.datapath.cost for camera in cameras]
        found.append(
            (f"{_sum(c.lut for c in costs)} LUT", "estimated, coordinates alone", f"{_sum(c.ff for c in costs)} FF")
        )
    found += [
        (
            f"{_sum(m['rows'] for m in memory)} rows",
            "of line buffer",
            f"{' + '.join(in_kib(m['kib']) for m in memory)} KiB; a whole frame would be "
            f"{in_kib(memory[0]['frame_kib'])} KiB",
        ),
        (
            f"{', '.join(lines)} lines",
            "latency, left, right" if len(timing) > 1 else "latency",
            f"{', '.join(times)} \N{MICRO SIGN}s at {report.clock_mhz:g} MHz",
        ),
        (
            f"{timing[0]['frames_per_second']:,.0f} frames/s",
            f"{plan.width} x {plan.height} at {report.clock_mhz:g} MHz",
            "one pixel a clock, without blanking",
        ),
    ]
    if isinstance(report.rows, Rows):
        before, after = report.rows.before, report.rows.after
        found.append(
            (
                f"{after.mean:.3f} px",
                f"{report.rows.line} difference, {before.mean:.1f} px before",
                f"mean over {after.n} {report.rows.kind}; {most(after)} px",
            )
        )
    return found


def pictures(cameras):
    """{side: {"before", "after"}}: data URIs of the source and of the rectified frame."""
    return {
        side: {
            "before": jpeg(camera.result.source, camera.plan.pixel_bits),
            "after": jpeg(camera.result.rectified, camera.plan.pixel_bits),
        }
        for side, camera in cameras.items()
    }


def drawn(report):
    """The charts by name, ready for the page."""
    cameras = report.cameras
    limit = max(peak.value for camera in cameras.values() for peak in camera.peaks.values())
    found = {}
    for side, camera in cameras.items():
        for axis, error in camera.errors.items():
            peak = camera.peaks[axis]
            title = (
                f"Heat map of the error of {axis}, {side} camera: at most {peak.value:.4f} px, at column {peak.x}, "
                f"row {peak.y}"
            )
            found[f"error-{side}-{axis}"] = charts.heat_map(f"error-{side}-{axis}", title, error, peak, limit)
        window = camera.core.parameters.line_buffer.window
        title = (
            f"Source rows that each output row of the {side} camera needs, less the output row: from {window.d_lo} to "
            f"{window.d_hi}"
        )
        found[f"rows-{side}"] = charts.row_needs(f"rows-{side}", title, *camera.needs, window, side)
    chosen = {side: camera.plan.datapath for side, camera in cameras.items()}
    title = "Largest coordinate error against cost of the datapaths considered; the table has the same figures"
    found["ladder"] = charts.ladder("ladder", title, {s: c.ladder for s, c in cameras.items()}, chosen)
    if report.distances:
        title = "Depth error against distance; the table has the same figures"
        found["depth"] = charts.depth(
            "depth", title, report.distances, *report.geometry[:2], MATCHING, report.first.plan.rectification.unit
        )
    return {name: Markup(svg) for name, svg in found.items()}


def _sum(values):
    """Both cameras' numbers, left + right."""
    return " + ".join(f"{value:,g}" for value in values)
