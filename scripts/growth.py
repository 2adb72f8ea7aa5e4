"""``python -m scripts.growth``: what a core takes as the frame grows to 3840x2160, next to the memory of a table."""

import dataclasses
import io
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib
import rich_click as click
from matplotlib.figure import Figure

from hdl import calibration, files
from hdl.cli import FileType, run, steps
from hdl.core.build import Options, build
from hdl.datapaths.table import Table
from hdl.geometry.rectification import rectify
from hdl.tools.synthesis import conditions, synthesise
from scripts.tables import cache_option, json_option, show, write_json

SIZES = ((320, 240), (640, 480), (1280, 960), (1920, 1440), (3840, 2160))
CORES = (("proposed", False), ("spline", True))
PLOTS = (".svg", ".png", ".pdf", ".eps", ".ps")
HEADINGS = ("core", "frame", "FF", "LUT", "line buffer, RAMB18", "coordinates, RAMB18", "latency", "error, px")


@click.command()
@json_option
@click.option(
    "--plot",
    type=FileType(PLOTS),
    default=Path("build/growth.svg"),
    show_default=True,
    help="Where the plot goes; the name's end says in which format.",
)
@cache_option
def growth(json_file, plot, cache):
    """Resources and latency of cores for the embedded rig's left camera, scaled to ever larger frames.

    Of `table`, which stores every coordinate, the memory is computed and not synthesised: that of a large frame is more
    than an FPGA has.
    """
    with steps() as progress:
        rows = measure(progress, cache)
        progress("plot")
        draw(rows, plot)
    write_json(json_file, rows)
    show(caption(), HEADINGS, map(as_text, rows), texts=2)
    click.echo(f"Plot: {plot}")


def measure(progress, cache):
    """One dict a core: datapath, lens, width, height, the cells, the block RAM of the coordinates among them, latency
    in clocks and largest error in px. Of `table`, the estimate for the coordinates."""
    cores = []
    for size in SIZES:
        for name, lens in CORES:
            progress(f"{size[0]}x{size[1]}: {name}")
            view = rectify(calibration.embedded(size), lens=lens)["left"]
            cores.append(build(view, Options(name), f"rectify_{name}"))
    progress(f"synthesis of {len(cores)} cores")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cells = list(pool.map(lambda core: synthesise(core.verilog, core.plan.top, cache=cache), cores))
    rows = []
    for core, found in zip(cores, cells):
        plan = core.plan
        rows.append(
            {
                **_frame(plan.datapath, plan.lens, plan.width, plan.height),
                "scope": "core",
                "estimated": False,
                **dataclasses.asdict(found),
                "coordinate_ramb18": core.parameters.datapath.cost.ramb18,
                "latency": plan.latency_cycles,
                "error": max(plan.error.u.max, plan.error.v.max),
            }
        )
    return rows + [table(size) for size in SIZES]


def _frame(datapath, lens, width, height):
    return {"datapath": datapath, "lens": lens, "width": width, "height": height, "dsp_allowed": False}


def table(size):
    """The row of `table`, estimated: that of its coordinates, with the lens."""
    view = rectify(calibration.embedded(size), lens=True)["left"]
    stored = Table.of(view, Options.fraction_bits)
    error = stored.coordinates.error(*view.map(), view.source_size)
    return {
        **_frame("table", True, *size),
        "scope": "coordinates",
        "estimated": True,
        **dataclasses.asdict(stored.cost),
        "ramb36": 0,
        "coordinate_ramb18": stored.cost.ramb18,
        "latency": None,
        "error": max(error[axis]["max"] for axis in "uv"),
    }


def as_text(row):
    """A row of the table."""
    memory = row["ramb18"] + 2 * row["ramb36"]
    return (
        row["datapath"] + (", lens" if row["lens"] else ""),
        f"{row['width']}x{row['height']}",
        *((f"({row['ff']})", f"({row['lut']})") if row["estimated"] else (row["ff"], row["lut"])),
        "" if row["estimated"] else memory - row["coordinate_ramb18"],
        row["coordinate_ramb18"],
        "" if row["latency"] is None else row["latency"],
        f"{row['error']:.3f}",
    )


def caption():
    """The conditions of the figures."""
    return (
        f"Embedded rig, left camera, 8 bit. {conditions(dsp=False)}. Of table, estimates for the coordinates alone. "
        "Latency in clocks, from a frame's first pixel in to its first pixel out. The rig is one of 4:3: at 16:9 its "
        "pixels are stretched, and rows bend further."
    )


def draw(rows, file):
    """Plot the four columns that grow over the pixels of the frame."""
    figure = Figure(figsize=(15, 4), layout="constrained")
    axes = figure.subplots(1, 4)
    columns = (
        ("LUT", lambda row: row["lut"]),
        ("flip-flops", lambda row: row["ff"]),
        ("block RAM, RAMB18", lambda row: row["ramb18"] + 2 * row["ramb36"]),
        ("latency, clocks", lambda row: row["latency"]),
    )
    for panel, (title, value) in zip(axes, columns):
        for (name, lens), marker in zip((*CORES, ("table", True)), "os^"):
            own = [row for row in rows if row["datapath"] == name and value(row) is not None]
            label = name + (", lens" if lens else "") + (" (estimated, coordinates alone)" if name == "table" else "")
            if own:
                panel.plot(
                    [row["width"] * row["height"] for row in own],
                    [value(row) for row in own],
                    marker + "-",
                    label=label,
                )
        panel.set(title=title, xlabel="pixels of a frame", xscale="log", yscale="log")
        panel.grid(True, which="both", alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    form, plot = file.suffix[1:].lower(), io.BytesIO()
    # The same bytes on every run.
    with matplotlib.rc_context({"svg.hashsalt": "growth"}):
        figure.savefig(plot, format=form, metadata={"Date": None} if form == "svg" else None)
    files.write({file: plot.getvalue()})


if __name__ == "__main__":
    run(growth)
