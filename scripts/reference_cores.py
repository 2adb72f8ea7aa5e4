"""``python -m scripts.reference_cores``: the cheapest core for each real rig, as synthesised."""

import dataclasses
import os
from concurrent.futures import ThreadPoolExecutor

import rich_click as click

from hdl.cli import run, steps
from hdl.core.build import Options, build
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from hdl.tools.synthesis import conditions, synthesise, synthesise_block
from scripts import reference_rigs
from scripts.tables import cache_option, json_option, show, write_json

HEADINGS = ("rig", "frame", "lens", "datapath", "error", "FF", "LUT", "DSP", "coordinates: FF", "LUT", "RAMB18",
            "line buffer: RAMB18", "rows")  # fmt: skip


@click.command()
@click.argument("names", nargs=-1, metavar="[RIG]...")
@click.option("--camera", type=click.Choice(["left", "right"]), default="left", show_default=True)
@click.option("--max-error", type=float, metavar="PX", help="Budget, px. Default: hdl.generate's.")
@click.option("--fraction-bits", type=click.IntRange(3, 8), default=Options.fraction_bits, show_default=True)
@reference_rigs.data_option
@json_option
@cache_option
def reference_cores(names, camera, max_error, fraction_bits, data, json_file, cache):
    """Build the core that --datapath auto chooses for every reference rig, or for the named ones, with the lens and
    without it, and synthesise it."""
    reference_rigs.check(data)
    unknown = [name for name in names if name not in reference_rigs.CALIBRATIONS]
    if unknown:
        raise InputError("RIG", None, unknown[0], f"the rigs are {', '.join(reference_rigs.CALIBRATIONS)}")
    options = Options(max_error=max_error, fraction_bits=fraction_bits)
    cores = []
    with steps() as progress:
        for name in names or reference_rigs.CALIBRATIONS:
            rig = reference_rigs.load(name, data)
            for lens in (False, True):
                progress(f"{name}, {'with' if lens else 'without'} the lens")
                cores.append((name, build(rectify(rig, lens=lens)[camera], options, "core")))
        progress(f"synthesis of {len(cores)} cores")
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            rows = list(pool.map(lambda named: measure(*named, cache), cores))
    write_json(json_file, rows)
    show(f"Whole cores, {camera} camera, 8 bit. {conditions(dsp=False)}.", HEADINGS, map(as_text, rows))


def measure(name, core, cache):
    """A dict: rig, what its plan says, and the cells of the whole ``core`` and of its ``coordinates``."""
    plan = core.plan
    return {
        "rig": name,
        "side": plan.camera.side,
        "width": plan.width,
        "height": plan.height,
        "lens": plan.lens,
        "datapath": plan.datapath,
        "error": max(plan.error.u.max, plan.error.v.max),
        "rows": plan.line_buffer.rows,
        "core": dataclasses.asdict(synthesise(core.verilog, "core", cache=cache)),
        "coordinates": dataclasses.asdict(synthesise_block(core.verilog, "core_datapath", cache=cache)),
    }


def as_text(row):
    """A row of the table."""
    core, coordinates = row["core"], row["coordinates"]
    whole, own = (cells["ramb18"] + 2 * cells["ramb36"] for cells in (core, coordinates))
    return (
        row["rig"], f"{row['width']}x{row['height']}", "yes" if row["lens"] else "no", row["datapath"],
        f"{row['error']:.3f}", core["ff"], core["lut"], core["dsp"], coordinates["ff"], coordinates["lut"], own,
        whole - own, row["rows"],
    )  # fmt: skip


if __name__ == "__main__":
    run(reference_cores)
