"""``python -m scripts.resources``: Table 2, what each datapath's core takes on a Virtex-7, next to the paper's figures.

And the ladder: what the coordinates alone take, and how exact they are.
"""

import dataclasses
import json
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import reduce
from itertools import product
from operator import sub

import rich_click as click

from hdl import calibration, files
from hdl.arithmetic.cuts import COMPACT
from hdl.cli import SizeType, run, steps
from hdl.core.build import Core, Options, build
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import fitted_budget
from hdl.errors import BudgetError, InputError
from hdl.geometry.rectification import rectify
from hdl.tools import yosys
from hdl.tools.synthesis import conditions, synthesise, synthesise_block
from scripts import readme, record
from scripts.tables import cache_option, json_option, show, write_json

SIZE = 640, 480  # of the README's tables
# Hyun and Moon 2015, Table 2 (Virtex-7): flip-flops and LUT; it does not tell DSP and block RAM.
PAPER = {"conventional": (12837, 9508), "proposed": (593, 3718)}
# Submodules of a core, as blocks that people know.
BLOCKS = {"datapath": "coordinates", "line_buffer": "line buffer", "bilinear": "interpolator"}
REST = "stream"
CELLS = ("ff", "lut", "srl", "lut_ram", "carry4", "dsp", "ramb18", "ramb36")
CELL_HEADINGS = ("FF", "LUT", "SRL", "LUT RAM", "CARRY4", "DSP", "RAMB18", "RAMB36")
HEADINGS = ("core", "pipeline", *CELL_HEADINGS, "rows", "error u, v")
LADDER_HEADINGS = ("datapath", "pipeline", "error u, v", *CELL_HEADINGS[:2], "DSP", "RAMB18", "latency")
RECORD = record.ROOT / "docs" / "resources.json"
PIPELINES = COMPACT.name, Options.pipeline


@dataclass(frozen=True)
class Job:
    """A core to synthesise.

    Members
    -------
    datapath : str
    lens : bool
    dsp_allowed : bool
    pipeline : str
    core : hdl.core.build.Core
    """

    datapath: str
    lens: bool
    dsp_allowed: bool
    pipeline: str
    core: Core


@click.command()
@click.option("--size", type=SizeType(), default="{}x{}".format(*SIZE), show_default=True, help="Frame size, px.")
@click.option(
    "--datapath", "names", multiple=True, type=click.Choice(list(DATAPATHS)), help="Only this one; may be repeated."
)
@json_option
@click.option("--readme", "update", is_flag=True, help="Write docs/resources.json and the README's tables.")
@click.option("--check", is_flag=True, help="Fail if they are not of these cores; nothing is measured.")
@cache_option
def resources(size, names, json_file, update, check, cache):
    """Synthesise the core of every datapath for the embedded rig's left camera, with and without DSP blocks.

    And each of its blocks by itself.
    """
    if (update or check) and names:
        raise InputError("--datapath", None, ", ".join(names), "the README's tables have all of them")
    if (update or check) and size != SIZE:
        raise InputError("--size", None, f"{size[0]}x{size[1]}", f"the README's tables are of {SIZE[0]}x{SIZE[1]}")
    if update:
        readme.check_writable()
        files.check_targets("--readme", [RECORD])
    with steps() as progress:
        jobs, refusals = cores(size, names or DATAPATHS, progress)
        digests = {name_of(job): record.digest(job.core.verilog) for job in jobs}
        if check:
            problem = record.stale(RECORD, parts, versions(), lambda found: found["digests"], digests, "make readme")
            problem = problem or _other_figures(jobs)
            if problem:
                click.echo(problem, err=True)
            return 1 if problem else 0
        rows = measure(jobs, cache, progress)
    write_json(json_file, rows)
    if update:
        measured_with = {yosys.PACKAGE: yosys.version()}
        found = {"versions": measured_with, "digests": digests, "refusals": refusals, "rows": rows}
        files.write({RECORD: json.dumps(found, indent=1, allow_nan=False) + "\n"})
        for name, text in parts(found).items():
            readme.update(name, text)
    show(caption(size), HEADINGS, core_rows(rows), texts=2)
    title = f"Blocks, each by itself; {REST}: the rest of the core, less what is saved where blocks meet"
    show(title, ("core", "pipeline", "block", *CELL_HEADINGS), block_rows(rows), texts=3)
    show("Coordinates alone", LADDER_HEADINGS, ladder_rows(rows), texts=2)
    for line in (*refusals, ratios(rows)):
        click.echo(line)


def versions():
    """Of the tool that measures, as it should be."""
    return record.pinned(yosys.PACKAGE)


def parts(found):
    """The README's parts of a record."""
    rows = found["rows"]
    return {"resources": as_markdown(rows, found["refusals"], SIZE), "ladder": ladder_as_markdown(rows, SIZE)}


def name_of(job):
    """What tells the cores of a record apart."""
    return f"{record.title(vars(job))}, {job.pipeline}"


def cores(size, names, progress):
    """A `Job` for each core that can be built, and a line for each datapath that builds none."""
    jobs, refusals = [], []
    for lens in (False, True):
        view = rectify(calibration.embedded(size), lens=lens)["left"]
        for name in names:
            if lens and not DATAPATHS[name].supports_lens:
                continue
            try:
                jobs += _jobs(view, name, progress)
            except InputError as refusal:
                refusals.append(f"{name}, {'with' if lens else 'without'} the lens: {refusal.problem}")
    return jobs, refusals


def measure(jobs, cache, progress):
    """The measured rows.

    A row is a dict: datapath, lens, pipeline, scope ("core" or a block), width, height, whether DSP blocks were
    allowed, and the cells; for the core also its largest error, the rows of its line buffer and the datapath's latency.
    """
    rows = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for number, found in enumerate(pool.map(lambda job: list(cells(job, cache)), jobs)):
            progress(f"synthesis: {number + 1} of {len(jobs)} cores")
            rows += found
    return rows


def _jobs(view, name, progress):
    for dsp, pipeline in product((False, True), PIPELINES):
        progress(f"{name}, {pipeline}, {'with' if view.lens else 'without'} the lens")
        options = Options(name, fitted_budget(Options.fraction_bits), dsp=dsp, pipeline=pipeline)
        core = within_budget(view, options)
        if core.plan.cost.dsp or not dsp:
            yield Job(name, view.lens, dsp, pipeline, core)


def within_budget(view, options):
    """The core within the budget that all have in common; without one where the rig and not the hardware decides."""
    try:
        return build(view, options, "core")
    except BudgetError:
        return build(view, dataclasses.replace(options, max_error=None), "core")


def cells(job, cache):
    """The rows of one core, as `measure` returns them."""
    top = job.core.plan.top
    whole = synthesise(job.core.verilog, top, dsp=job.dsp_allowed, cache=cache)
    blocks = {
        title: synthesise_block(job.core.verilog, f"{top}_{module}", dsp=job.dsp_allowed, cache=cache)
        for module, title in BLOCKS.items()
    }
    blocks[REST] = reduce(sub, blocks.values(), whole)
    plan = job.core.plan
    common = {
        "datapath": job.datapath,
        "lens": job.lens,
        "width": plan.width,
        "height": plan.height,
        "dsp_allowed": job.dsp_allowed,
        "pipeline": job.pipeline,
    }
    yield {
        **common,
        "scope": "core",
        **dataclasses.asdict(whole),
        **_known(job.core),
    }
    for block, taken in blocks.items():
        yield {**common, "scope": block, **dataclasses.asdict(taken)}


def _known(core):
    """The figures of a core that need no synthesis."""
    return {
        "error": {axis: getattr(core.plan.error, axis).max for axis in "uv"},
        "rows": core.plan.line_buffer.rows,
        "latency": core.parameters.datapath.latency,
    }


def _other_figures(jobs):
    """Of which core the record has other figures of those that need no synthesis, in one line; "" for none.

    Errors may differ by as much as the README's numbers: constants are not in the digests.
    """
    rows = {
        f"{record.title(row)}, {row['pipeline']}": row
        for row in record.load(RECORD, parts)["rows"]
        if row["scope"] == "core"
    }
    for job in jobs:
        row, known = rows[name_of(job)], _known(job.core)
        same = all(math.isclose(row["error"][axis], known["error"][axis], rel_tol=readme.SAME) for axis in "uv")
        if not same or any(row[name] != known[name] for name in ("rows", "latency")):
            return f"{RECORD.name} has other figures of {name_of(job)}; `make readme` brings it up to date"
    return ""


def _error(row):
    return "{u:.3f}, {v:.3f}".format(**row["error"])


def _of(rows, *scopes):
    """The rows of these scopes; without those in which DSP blocks were allowed and the core has use for none."""
    useful = {record.title(row) for row in rows if row["scope"] == "core" and (row["dsp"] or not row["dsp_allowed"])}
    return [row for row in rows if row["scope"] in scopes and record.title(row) in useful]


def core_rows(rows):
    """The rows of Table 2, as text, the paper's first."""
    for name, (ff, lut) in PAPER.items():
        yield f"{name}, the paper's", "?", ff, lut, *["?"] * 7, "-"
    for row in _of(rows, "core"):
        yield record.title(row), row["pipeline"], *(row[cell] for cell in CELLS), row["rows"], _error(row)


def block_rows(rows):
    """What each block takes, as text."""
    for row in _of(rows, *BLOCKS.values(), REST):
        yield record.title(row), row["pipeline"], row["scope"], *(row[cell] for cell in CELLS)


def ladder_rows(rows):
    """The rows of the ladder, as text: coordinates alone, the errors they make."""
    cores = {(record.title(row), row["pipeline"]): row for row in _of(rows, "core")}
    for row in _of(rows, "coordinates"):
        core = cores[record.title(row), row["pipeline"]]
        ramb18 = row["ramb18"] + 2 * row["ramb36"]
        taken = row["ff"], row["lut"], row["dsp"], ramb18, core["latency"]
        yield record.title(row), row["pipeline"], _error(core), *taken


def ratios(rows):
    """What `proposed` takes of `conventional`, both compact, here and in the paper; empty unless both were measured."""
    found = {
        row["datapath"]: (row["ff"], row["lut"])
        for row in _of(rows, "core")
        if not row["lens"] and not row["dsp_allowed"] and row["pipeline"] == COMPACT.name
    }
    if not PAPER.keys() <= found.keys():
        return ""

    def share(figures):
        ff, lut = (100 * ours / theirs for ours, theirs in zip(figures["proposed"], figures["conventional"]))
        return f"{ff:.0f} % of the flip-flops and {lut:.0f} % of the LUT"

    return f"Compact, proposed takes {share(found)} of conventional; in the paper {share(PAPER)}."


def caption(size):
    """The conditions of the figures."""
    return (
        f"Whole cores with AXI4-Stream, line buffer and borders, {size[0]}x{size[1]}, 8 bit, embedded rig, left "
        f"camera, each within {fitted_budget(Options.fraction_bits):g} px where the datapath can be. "
        f"{conditions(dsp=False)}; with DSP: without -nodsp. LUT: all of them, inverters, "
        "shift registers (SRL) and memory (LUT RAM) included. Error: largest, px."
    )


def as_markdown(rows, refusals, size):
    """Table 2 as the README has it."""
    table = readme.markdown(HEADINGS, core_rows(rows))
    sentences = [caption(size), "The paper's rows: its Table 2.", ratios(rows)]
    sentences += [f"Not built: {refusal}." for refusal in refusals]
    return f"{table}\n\n{' '.join(sentences)}"


def ladder_as_markdown(rows, size):
    """The ladder as the README has it."""
    table = readme.markdown(LADDER_HEADINGS, ladder_rows(rows))
    return (
        f"{table}\n\nCoordinates alone, both of them: {size[0]}x{size[1]}, embedded rig, left camera, "
        "otherwise as above. RAMB18: a RAMB36 counts as two. Latency in clocks."
    )


if __name__ == "__main__":
    run(resources)
