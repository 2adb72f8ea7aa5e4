"""``python -m scripts.table1``: pixel coordinate errors, next to the paper's Table 1.

The paper compares source coordinates of its Eq. 6 with those of the conventional method, both in whole pixels. Here
both come from the integer models of the datapaths; for the embedded rig the exported Verilog must use the same ones.
"""

import sys
from itertools import groupby

import numpy as np
import rich_click as click

from hdl import calibration
from hdl.calibration import SIDES
from hdl.cli import run, steps
from hdl.datapaths import DATAPATHS
from hdl.geometry.rectification import rectify
from scripts import readme, reference_rigs
from scripts.coordinate_errors import REFERENCE, measure
from scripts.tables import json_option, show, write_json
from scripts.turned_cameras import AXES, approximation_error, crossing, turned, worst_mean

# Hyun and Moon 2015, Table 1: px, the rounded measure.
PAPER = {
    "left": {"u": {"mean": 0.4465, "max": 2}, "v": {"mean": 0.2255, "max": 2}},
    "right": {"u": {"mean": 0.5028, "max": 3}, "v": {"mean": 0.2880, "max": 2}},
}
CLAIM = 1.0  # px: "the average pixel coordinate error is under 1 pixel"
PROPOSED = "proposed"  # whose error that is, against that of `REFERENCE`
EMBEDDED = "embedded"
ANGLES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # degrees
HEADINGS = ("rig", "coordinates", "camera", "mean u, v", "max", "unrounded: mean u, v", "max")
CLAIM_HEADINGS = ("rig", "frame", "camera", "pitch, yaw, roll", *HEADINGS[3:], f"mean < {CLAIM:g} px")
README_HEADINGS = ("coordinates", "left: mean u, v", "max", "right: mean u, v", "max", "unrounded: max u, v")


@click.command()
@click.option(
    "--rig",
    "names",
    type=click.Choice([EMBEDDED, *reference_rigs.CALIBRATIONS]),
    multiple=True,
    metavar="NAME",
    help=f"This rig alone, with every datapath; may be repeated: {EMBEDDED}, {', '.join(reference_rigs.CALIBRATIONS)}.",
)
@reference_rigs.data_option
@json_option
@click.option("--readme", "update", is_flag=True, help="Write the table of the embedded rig into the README.")
@click.option("--check", is_flag=True, help="Fail if the README's table is not this one.")
def table1(names, data, json_file, update, check):
    """Errors of source coordinates of `proposed` and the other datapaths against `conventional`, as in Table 1.

    With the lens they are against the exact map. Exit status 1 if the exported Verilog of the embedded rig's cores uses
    other coordinates than the integer models. --readme and --check measure the embedded rig alone.
    """
    for_readme = update or check
    if for_readme and set(names) - {EMBEDDED}:
        raise click.UsageError(f"the README's table is of the {EMBEDDED} rig: leave out --rig")
    if set(names) - {EMBEDDED}:
        reference_rigs.check(data)
    if update:
        readme.check_writable()
    others = tuple(reference_rigs.CALIBRATIONS) if data.is_dir() and not for_readme else ()
    rows, refusals = [], []
    with steps() as progress:
        for name in names or (EMBEDDED, *others):
            rig = calibration.embedded() if name == EMBEDDED else reference_rigs.load(name, data)
            measured = measure(
                name,
                rig,
                # Fits for a lens take seconds.
                lenses=(False, True) if names or name == EMBEDDED else (False,),
                datapaths=[kind for kind in DATAPATHS if names or name == EMBEDDED or is_quick(kind)],
                verilog=name == EMBEDDED,
                progress=lambda step, name=name: progress(f"{name}: {step}"),
            )
            rows += measured[0]
            refusals += measured[1]
        progress("turned cameras")
        sweep = measure_turns(rectify(calibration.embedded(), lens=False)["left"])
    write_json(json_file, rows)
    print_tables(rows, sweep)
    for line in closing_lines(rows, refusals, sweep, bool(names), bool(others)):
        click.echo(line)
    broken = [row for row in rows if row["verilog_unlike"]]
    for row in broken:
        click.echo(
            f"{label(row)}, {row['side']} camera: the Verilog's coordinates are not the integer model's at "
            f"{row['verilog_unlike']} pixels",
            err=True,
        )
    if broken:
        sys.exit(1)
    if for_readme:
        text = as_markdown(rows, sweep)
        if update:
            readme.update("table1", text)
        if check and not readme.is_current("table1", text):
            click.echo("README.md: the table of coordinate errors is stale; `make readme` renews it", err=True)
            sys.exit(1)


def is_quick(datapath):
    """Whether a datapath is fitted in a moment to any frame: those do not look at every pixel for every candidate."""
    return datapath == REFERENCE or not DATAPATHS[datapath].supports_lens


def measure_turns(view):
    """What z = 1 costs ``view`` turned about each axis: the angles from which the claim is wrong, {axis: degrees or
    None}, and {angle: {axis: errors}}."""
    errors_at = {angle: {axis: approximation_error(turned(view, axis, angle)) for axis in AXES} for angle in ANGLES}
    return {axis: crossing(view, axis, CLAIM) for axis in AXES}, errors_at


def distance(rows):
    """How far the errors of `PROPOSED`, ``rows`` of one rig, are from the paper's: the factor between the means of the
    rounded measure, as the geometric mean over both cameras and axes, 1 or more."""
    logarithms = [
        np.log(row["rounded"][axis]["mean"] / PAPER[row["side"]][axis]["mean"]) for row in rows for axis in "uv"
    ]
    return float(np.exp(np.abs(logarithms).mean()))


def of_proposed(rows):
    """The rows that correspond to the paper's, by rig."""
    rows = [row for row in rows if row["datapath"] == PROPOSED and not row["lens"]]
    return {rig: list(both) for rig, both in groupby(rows, key=lambda row: row["rig"])}


def holds(row):
    """Whether the paper's claim does."""
    return worst_mean(row) < CLAIM


def is_equal(row):
    """Whether the coordinates are those of the reference at every pixel that counts."""
    return not any(axis["max"] for axis in row["real"].values())


def label(row):
    return row["datapath"] + (", lens" if row["lens"] else "")


def pair(axes, kind, digits):
    """u and v of a statistic as text."""
    return ", ".join(f"{axes[axis][kind]:.{digits}f}" for axis in "uv")


def as_text(row):
    """The measured cells of a row."""
    return (
        pair(row["rounded"], "mean", 4),
        pair(row["rounded"], "max", 0),
        pair(row["real"], "mean", 4),
        pair(row["real"], "max", 3),
    )


def print_tables(rows, sweep):
    """The tables on the terminal."""
    paper = [("the paper's", "?", side, "?", pair(PAPER[side], "mean", 4), pair(PAPER[side], "max", 0), "?", "?", "yes")
             for side in SIDES]  # fmt: skip
    proposed = [
        (
            row["rig"],
            f"{row['width']}x{row['height']}",
            row["side"],
            ", ".join(f"{round(angle, 2) + 0.0:.2f}" for angle in row["rotation"].values()),
            *as_text(row),
            "yes" if holds(row) else "NO",
        )
        for both in of_proposed(rows).values()
        for row in both
    ]
    show(
        f"Errors of {PROPOSED} against {REFERENCE}, px; angles in degrees; no lens", CLAIM_HEADINGS, paper + proposed, 4
    )
    others = [
        (row["rig"], label(row), row["side"], *as_text(row))
        for row in rows
        if row["datapath"] != PROPOSED and label(row) != REFERENCE and not is_equal(row)
    ]
    show(
        f"Errors of the others, px, against {REFERENCE}, with the lens against the exact map",
        HEADINGS, others, 3,
    )  # fmt: skip
    show(
        f"Mean error of z = 1, u and v, px, with the {EMBEDDED} rig's left camera turned by one angle alone",
        ("degrees", *(f"about {axis} ({name})" for axis, name in AXES.items())),
        [(angle, *(pair(error["rounded"], "mean", 4) for error in axes.values())) for angle, axes in sweep[1].items()],
    )


def claim_by_angle(limits):
    """In words, from which angles on the paper's claim is wrong."""
    parts = [
        f"{limit:.2f} degrees about {axis} ({AXES[axis]})" if limit else f"no angle about {axis} ({AXES[axis]})"
        for axis, limit in limits.items()
    ]
    return f"the mean error of z = 1 reaches {CLAIM:g} px at {', '.join(parts[:-1])}, and at {parts[-1]}"


def closing_lines(rows, refusals, sweep, named, data):
    """What the tables do not say, a line each."""
    run = [row for row in rows if row["verilog_unlike"] is not None]
    if run and not any(row["verilog_unlike"] for row in run):
        pixels = run[0]["width"] * run[0]["height"]
        yield f"The exported Verilog of {len(run)} cores uses the integer models' coordinates at all {pixels} pixels."
    references = [row["real"][axis] for row in rows for axis in "uv" if label(row) == REFERENCE]
    if references:
        mean, largest = (max(axis[kind] for axis in references) for kind in ("mean", "max"))
        yield f"{REFERENCE} itself is within {largest:.4f} px of the float64 map, {mean:.4f} on average."
    for name in dict.fromkeys(label(row) for row in rows if is_equal(row)):
        views = [row for row in rows if label(row) == name]
        yield f"{name} has the reference's coordinates in {sum(map(is_equal, views))} of {len(views)} images."
    proposed = of_proposed(rows)
    if proposed:
        nearest = min(proposed, key=lambda rig: distance(proposed[rig]))
        yield (
            f"{'Nearest to the paper: ' if len(proposed) > 1 else ''}{nearest}, whose four means differ from the "
            f"paper's by a factor of {distance(proposed[nearest]):.2f} (geometric mean)."
        )
        for wanted, text in ((True, "below"), (False, "NOT below")):
            rigs = [rig for rig, both in proposed.items() if all(map(holds, both)) == wanted]
            if rigs:
                yield f"Means {text} {CLAIM:g} px in both images: {len(rigs)} of {len(proposed)}: {'; '.join(rigs)}."
    yield f"With the {EMBEDDED} rig's left camera {claim_by_angle(sweep[0])}."
    if not named:
        if data:
            quick = ", ".join(kind for kind in DATAPATHS if is_quick(kind))
            yield f"Of the reference rigs {quick} alone, without the lens, to save time; --rig NAME has all."
        else:
            yield "The reference rigs were left out."
    for refusal in refusals:
        yield f"Left out: {refusal}"


def as_markdown(rows, sweep):
    """The README's table."""
    rows = [row for row in rows if row["rig"] == EMBEDDED]
    itself = max(row["real"][axis]["max"] for row in rows for axis in "uv" if label(row) == REFERENCE)
    names = [name for name in dict.fromkeys(map(label, rows)) if name != REFERENCE]
    table = [
        (
            f"{PROPOSED}, the paper's",
            *(cell for side in SIDES for cell in (pair(PAPER[side], "mean", 4), pair(PAPER[side], "max", 0))),
            "?",
        )
    ]
    for name in sorted(names, key=lambda name: name != PROPOSED):
        cameras = [row for row in rows if label(row) == name]
        largest = {axis: {"max": max(row["real"][axis]["max"] for row in cameras)} for axis in "uv"}
        table.append((name, *(cell for row in cameras for cell in as_text(row)[:2]), pair(largest, "max", 3)))
    left_out = [name for name in DATAPATHS if name not in {row["datapath"] for row in rows}]
    caption = (
        f"Errors of source coordinates, px, over the pixels whose exact source is in the image: {EMBEDDED} rig, "
        f"{rows[0]['width']}x{rows[0]['height']}, against `{REFERENCE}` (itself within {itself:.3f} px of the exact "
        "map), with the lens against the exact map. Mean and max are the paper's measure: both coordinates rounded to "
        "whole px. The exported Verilog was run and uses these coordinates at every pixel. "
        + (f"Not built for frames this large: {', '.join(left_out)}. " if left_out else "")
        + f"How much the paper's method errs depends on how the cameras stand: with this rig's left one "
        f"{claim_by_angle(sweep[0])}. `python -m scripts.table1` measures other rigs."
    )
    return f"{readme.markdown(README_HEADINGS, table)}\n\n{caption}"


if __name__ == "__main__":
    run(table1)
