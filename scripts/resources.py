"""``python -m scripts.resources``: what each datapath's core takes on a Virtex-7, next to the paper's Table 2."""

import dataclasses
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rich_click as click
from rich.console import Console
from rich.table import Table

from hdl import calibration
from hdl.cli import SizeType, run, steps
from hdl.core import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.rectification import rectify
from scripts import readme
from scripts.synthesis import conditions, synthesise

# Hyun and Moon 2015, Table 2 (Virtex-7); it does not tell DSP and block RAM.
PAPER = {"conventional": (12837, 9508), "proposed": (593, 3718)}
HEADINGS = ("core", "FF", "LUT", "DSP", "RAMB18", "RAMB36", "rows", "error u, v")


@click.command()
@click.option("--size", type=SizeType(), default="640x480", show_default=True, help="Frame size, px.")
@click.option(
    "--json",
    "json_file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write the rows to FILE.",
)
@click.option("--readme", "update", is_flag=True, help="Write the table into the README.")
@click.option("--check", is_flag=True, help="Fail if the README's table is not this one.")
@click.option(
    "--cache",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("build/cache"),
    show_default=True,
    help="Where results of synthesis are kept.",
)
def resources(size, json_file, update, check, cache):
    """Synthesise the core of every datapath for the embedded rig's left camera, with and without DSP blocks."""
    with steps() as progress:
        rows = measure(size, cache, progress)
    if json_file:
        json_file.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    text = as_markdown(rows, size)
    if update:
        readme.update("resources", text)
    if check and not readme.is_current("resources", text):
        click.echo("README.md: the table of resources is stale; `make readme` renews it", err=True)
        sys.exit(1)
    table = Table(title=caption(size), title_justify="left")
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "core" else "right")
    for row in table_rows(rows):
        table.add_row(*row)
    Console().print(table)


def measure(size, cache, progress):
    """One dict a run: datapath, lens, scope, frame, whether DSP blocks were allowed, the cells, and the core's
    error."""
    rig = calibration.embedded(size)
    cores = {}
    for lens in (False, True):
        view = rectify(rig, lens=lens)["left"]
        for name, kind in DATAPATHS.items():
            if lens and not kind.supports_lens:
                continue
            try:
                cores[name, lens] = build(
                    view, Options(name), f"rectify_{name}", lambda step, name=name: progress(f"{name}: {step}")
                )
            except InputError as refusal:
                print(f"{name} {'with' if lens else 'without'} the lens is left out: {refusal}", file=sys.stderr)
    progress(f"synthesis of {2 * len(cores)} cores")
    runs = [(name, lens, core, dsp) for (name, lens), core in cores.items() for dsp in (False, True)]
    with ThreadPoolExecutor(2) as pool:
        cells = pool.map(lambda job: synthesise(job[2].verilog, job[2].plan.top, dsp=job[3], cache=cache), runs)
        return [
            {
                "datapath": name,
                "lens": lens,
                "scope": "core",
                "width": size[0],
                "height": size[1],
                "dsp_allowed": dsp,
                **dataclasses.asdict(found),
                "error": {axis: getattr(core.plan.error, axis).max for axis in "uv"},
                "rows": core.plan.line_buffer.rows,
            }
            for (name, lens, core, dsp), found in zip(runs, cells)
        ]


def table_rows(rows):
    """The rows of the table, as text, the paper's first."""
    for name, (ff, lut) in PAPER.items():
        yield f"{name}, the paper's", str(ff), str(lut), *["?"] * 4, "-" if name == "conventional" else "3, 2"
    for row in rows:
        # Where nothing can be put into DSP blocks the second run would be the first again.
        if row["dsp_allowed"] and not row["dsp"]:
            continue
        yield (
            row["datapath"] + (", lens" if row["lens"] else "") + (", with DSP" if row["dsp"] else ""),
            *(str(row[cell]) for cell in ("ff", "lut", "dsp", "ramb18", "ramb36", "rows")),
            "{u:.3f}, {v:.3f}".format(**row["error"]),
        )


def caption(size):
    """The conditions of the figures."""
    return (
        f"Whole cores with AXI4-Stream, line buffer and borders, {size[0]}x{size[1]}, 8 bit, embedded rig, left "
        f"camera. {conditions(dsp=False)} (without -nodsp where DSP blocks are allowed); LUT: inverters and the "
        "SRL included. Error: largest, px."
    )


def as_markdown(rows, size):
    """The README's table."""
    table = readme.markdown(HEADINGS, table_rows(rows))
    return f"{table}\n\n{caption(size)} The paper's rows: its Table 2, and Table 1 for the error."


if __name__ == "__main__":
    run(resources)
