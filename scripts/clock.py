"""``python -m scripts.clock``: how fast cores are, after place and route on an ECP5, and by a model of an Artix-7."""

import dataclasses
import json
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import rich_click as click

from hdl import calibration, files
from hdl.arithmetic.cuts import BALANCED, FAST, PIPELINES
from hdl.calibration.rig import SIDES
from hdl.cli import SizeType, run, steps
from hdl.core.build import Core, Options
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import fitted_budget
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from hdl.tools import nextpnr, yosys
from hdl.tools import place_and_route as ecp5
from hdl.tools.synthesis import Resources, conditions, netlist, xc7
from hdl.tools.xc7_timing import MODEL, longest_path
from scripts import clock_record, readme
from scripts.record import digest, title
from scripts.resources import within_budget
from scripts.tables import cache_option, json_option, show, write_json

VGA, FHD = (640, 480), (1920, 1080)
SEEDS = (1, 2, 3)
# Of a core that is asked for by its datapath: whether with the lens, and whether DSP blocks are allowed.
VARIANTS = {"conventional": ((False, True), (True, True)), "spline": ((True, False),)}
# Those that are shown in all pipelines, and in two frames.
SHOWN = ("proposed", "spline")


@dataclass(frozen=True)
class Case:
    """A core to measure.

    Members
    -------
    datapath : str
    lens, dsp_allowed : bool
    pipeline : str
    size : (width, height)
    """

    datapath: str
    lens: bool
    dsp_allowed: bool
    pipeline: str
    size: tuple[int, int]


def cases(names=DATAPATHS, pipelines=(BALANCED.name,), sizes=(VGA,)):
    """Those of all combinations."""
    return [
        Case(name, *variant, pipeline, size)
        for size in sizes
        for name in names
        for variant in VARIANTS.get(name, ((False, False),))
        for pipeline in pipelines
    ]


def table_cases():
    """Those of the README's table."""
    return list(dict.fromkeys([*cases(), *cases(SHOWN, PIPELINES), *cases(SHOWN, PIPELINES, [FHD])]))


@click.command()
@click.option(
    "--datapath", "names", multiple=True, type=click.Choice(list(DATAPATHS)), help="Only this one; may be repeated."
)
@click.option("--pipeline", "pipelines", multiple=True, type=click.Choice(list(PIPELINES)), help="Likewise.")
@click.option("--size", "sizes", multiple=True, type=SizeType(), help="Frame size, px; may be repeated.")
@json_option
@click.option("--readme", "update", is_flag=True, help="Write hdl/core/clock.json and the README's table.")
@click.option("--check", is_flag=True, help="Fail if they are not of these cores and tools; nothing is measured.")
@cache_option
def clock(names, pipelines, sizes, json_file, update, check, cache):
    """Place and route cores of the embedded rig's left camera on an ECP5, with three seeds, and time them by a model of
    an Artix-7. Without a choice: those of the README's table."""
    chosen = [
        (option, found[0])
        for option, found in (("--datapath", names), ("--pipeline", pipelines), ("--size", sizes))
        if found
    ]
    if (update or check) and chosen:
        option, value = chosen[0]
        text = "{}x{}".format(*value) if option == "--size" else value
        raise InputError(option, None, text, "the README's table has cores of its own")
    if update:
        readme.check_writable()
        files.check_targets("--readme", [clock_record.RECORD])
    if not check:
        nextpnr.version()
    wanted = table_cases() if not chosen else cases(names or DATAPATHS, pipelines or [BALANCED.name], sizes or [VGA])
    with steps() as progress:
        built, refusals = build_all(wanted, progress)
        if check:
            digests = {clock_record.name(row_of(case)): digest(core.verilog) for case, core in built}
            problem = clock_record.stale(digests)
            if problem:
                click.echo(problem, err=True)
            return 1 if problem else 0
        rows = measure(built, cache, progress)
    found = {
        "versions": {yosys.PACKAGE: yosys.version(), nextpnr.PACKAGE: nextpnr.version()},
        "conditions": {"xc7": conditions(dsp=False), "ecp5": ecp5.conditions()},
        "seeds": list(SEEDS),
        "refusals": refusals,
        "rows": rows,
    }
    write_json(json_file, rows)
    if update:
        files.write({clock_record.RECORD: json.dumps(found, indent=1, allow_nan=False) + "\n"})
        readme.update("clock", clock_record.as_markdown(found))
    heading = f"model: {MODEL}; {ecp5.conditions()}"
    show(heading, clock_record.HEADINGS, clock_record.table_rows(rows), texts=clock_record.TEXTS)
    for refusal in refusals:
        click.echo(f"Not built: {refusal}")


def build_all(wanted, progress):
    """(case, core) of those that can be built, and a line for each of the others."""
    built, refusals = [], []
    for number, case in enumerate(wanted):
        progress(f"cores: {number + 1} of {len(wanted)}")
        try:
            built.append((case, build(case)))
        except InputError as refusal:
            row = row_of(case)
            refusals.append(f"{title(row)}, {clock_record.frame(row)}: {refusal.problem}")
    return built, refusals


def build(case) -> Core:
    view = rectify(embedded(case.size), lens=case.lens)["left"]
    budget = fitted_budget(Options.fraction_bits)
    return within_budget(view, Options(case.datapath, budget, dsp=case.dsp_allowed, pipeline=case.pipeline))


def embedded(size):
    """The embedded rig with images of ``size``, px: the middle of what its cameras see, as video modes of a sensor of
    another shape are. Resampled, its pixels would not be square, and its lines would bend much further."""
    rig = calibration.embedded()
    scale = max(wanted / given for wanted, given in zip(size, (rig.width, rig.height)))
    whole = round(scale * rig.width), round(scale * rig.height)
    margin = np.zeros((3, 3))
    margin[:2, 2] = (np.array(whole) - size) / 2
    rig = calibration.embedded(whole)
    cameras = {side: dataclasses.replace(rig.camera(side), K=rig.camera(side).K - margin, size=size) for side in SIDES}
    return dataclasses.replace(rig, width=size[0], height=size[1], **cameras)


def measure(built, cache, progress):
    """The rows of `clock_record`, in the order of the cores; as many at a time as there are processors."""
    rows = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for number, row in enumerate(pool.map(lambda one: measured(*one, cache), built)):
            progress(f"synthesis, place and route: {number + 1} of {len(built)} cores")
            rows.append(row)
    return rows


def row_of(case):
    """A row's members that say what it is of."""
    width, height = case.size
    return {
        "datapath": case.datapath,
        "lens": case.lens,
        "dsp_allowed": case.dsp_allowed,
        "pipeline": case.pipeline,
        "width": width,
        "height": height,
    }


def measured(case, core, cache):
    """The row of one core.

    "xc7" has the cells, and the longest path by the model; "ecp5", None where the device is too small, what
    `hdl.tools.place_and_route.Routed` has, with the median and its path; so has "ecp5_outreg", None where the pipeline
    has no registers behind block RAM, too.
    """
    top, verilog = core.plan.top, core.verilog
    made = netlist(verilog, top, xc7(top, case.dsp_allowed), cache=cache)
    path = longest_path(made)

    def routed(outreg):
        try:
            found = ecp5.place_and_route(verilog, top, seeds=SEEDS, outreg=outreg, dsp=case.dsp_allowed, cache=cache)
        except ecp5.TooLarge:
            return None
        return {
            "median": found.median,
            "mhz": {str(seed): mhz for seed, mhz in found.mhz.items()},
            "path": found.path,
            **found.cells,
        }

    return {
        **row_of(case),
        "digest": digest(verilog),
        "xc7": {
            **dataclasses.asdict(Resources.of(made)),
            "ns": round(path.ns, 3),
            "path": list(path.via),
            "levels": path.levels,
        },
        "ecp5": routed(False),
        "ecp5_outreg": routed(True) if case.pipeline == FAST.name else None,
    }


if __name__ == "__main__":
    run(clock)
