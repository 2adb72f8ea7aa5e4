"""``python -m scripts.cost_model``: the estimates by which ``--datapath auto`` chooses, against Yosys."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import rich_click as click

from hdl import calibration
from hdl.cli import run, steps
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from hdl.tools.synthesis import conditions, synthesise_block
from scripts import reference_rigs
from scripts.tables import cache_option, json_option, show, write_json

SIZES = ((160, 120), (640, 480), (1280, 960))  # px, of the embedded rig
HEADINGS = (
    *("rig", "datapath", "lens", "DSP allowed", "LUT", "Yosys", "off", "FF", "Yosys", "off"),
    *("RAMB18", "Yosys", "DSP", "Yosys"),
)
CELLS = ("lut", "ff", "ramb18", "dsp")


@click.command()
@click.option(
    "--datapath", "names", multiple=True, type=click.Choice(list(DATAPATHS)), help="Only this one; may be repeated."
)
@reference_rigs.data_option
@json_option
@cache_option
def cost_model(names, data, json_file, cache):
    """Estimated and synthesised cost of the coordinate hardware, for the embedded rig at several sizes and, where they
    are there, for the reference rigs."""
    with steps() as progress:
        rows = measure(_rigs(data), names or DATAPATHS, cache, progress)
    write_json(json_file, rows)
    show(f"Coordinates alone. {conditions(dsp=False)}", HEADINGS, map(as_text, rows), texts=4)
    for line in summary(rows):
        click.echo(line)


def _rigs(data):
    """(name, Rig) of each."""
    for size in SIZES:
        yield f"embedded, {size[0]}x{size[1]}", calibration.embedded(size)
    if data.is_dir():
        for name in reference_rigs.CALIBRATIONS:
            yield name, reference_rigs.load(name, data)


def measure(rigs, names, cache, progress):
    """One dict a core: rig, side, datapath, lens, whether DSP blocks were allowed, and the ``estimated`` and
    ``synthesised`` cells."""
    jobs = []
    for rig_name, rig in rigs:
        for lens in (False, True):
            view = rectify(rig, lens=lens)["left"]
            for name in names:
                if lens and not DATAPATHS[name].supports_lens:
                    continue
                for dsp in (False, True):
                    progress(f"{rig_name}: {name}")
                    try:
                        core = build(view, Options(name, dsp=dsp), "core")
                    except InputError:
                        break  # this datapath cannot do it for this rig, so nobody chooses by its cost
                    if not dsp or core.parameters.datapath.cost.dsp:
                        jobs.append((rig_name, view, core))
    rows = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cells = pool.map(lambda job: _coordinates(job[2], cache), jobs)
        for (rig_name, view, core), found in zip(jobs, cells):
            progress(f"synthesis: {len(rows) + 1} of {len(jobs)}")
            cost = core.parameters.datapath.cost
            rows.append(
                {
                    "rig": rig_name,
                    "side": view.side,
                    "datapath": core.plan.datapath,
                    "lens": view.lens,
                    "dsp_allowed": core.plan.dsp,
                    "estimated": {cell: getattr(cost, cell) for cell in CELLS},
                    "synthesised": {
                        "lut": found.lut, "ff": found.ff, "ramb18": found.ramb18 + 2 * found.ramb36, "dsp": found.dsp
                    },
                }
            )  # fmt: skip
    return rows


def _coordinates(core, cache):
    return synthesise_block(core.verilog, "core_datapath", dsp=core.plan.dsp, cache=cache)


def off(row, cell):
    """The estimate's relative error; of nothing, the number that was estimated."""
    found = row["synthesised"][cell]
    return (row["estimated"][cell] - found) / max(found, 1)


def as_text(row):
    """A row of the table."""
    estimated, synthesised = row["estimated"], row["synthesised"]
    logic = [
        text
        for cell in ("lut", "ff")
        for text in (estimated[cell], synthesised[cell], f"{100 * off(row, cell):+.0f} %")
    ]
    others = [side[cell] for cell in ("ramb18", "dsp") for side in (estimated, synthesised)]
    flags = ("yes" if row[name] else "no" for name in ("lens", "dsp_allowed"))
    return row["rig"], row["datapath"], *flags, *logic, *others


def summary(rows):
    """A line for each datapath: how far off the estimate is."""
    for name in dict.fromkeys(row["datapath"] for row in rows):
        own = [row for row in rows if row["datapath"] == name]
        figures = []
        for cell in CELLS:
            if not any(row[kind][cell] for row in own for kind in ("estimated", "synthesised")):
                continue
            errors = np.abs([off(row, cell) for row in own])
            figures.append(
                f"{cell.upper()} off by {100 * errors.mean():.1f} % on average, {100 * errors.max():.0f} % at most"
            )
        yield f"{name}, {len(own)} cores: {'; '.join(figures)}"


if __name__ == "__main__":
    run(cost_model)
