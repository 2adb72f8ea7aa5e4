"""``python -m scripts.minimise_rows``: what ``--minimise rows`` saves of the line buffers of real rigs."""

import time
from dataclasses import replace

import rich_click as click

from hdl.calibration import SIDES, Rig
from hdl.cli import run, steps
from hdl.geometry.choices import MAX_FOV_LOSS
from hdl.geometry.notes import row_disagreement
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.geometry.row_minimisation import loss
from scripts import reference_rigs
from scripts.tables import json_option, show, write_json

HEADINGS = ("rig", "frame", "lens", "rows before", "rows after", "saved", "lost", "filled after", "rows agree", "s")


@click.command()
@click.argument("names", nargs=-1, metavar="[RIG]...")
@click.option(
    "--max-fov-loss",
    type=float,
    default=MAX_FOV_LOSS,
    show_default=True,
    metavar="SHARE",
    help="What of the view may be given up.",
)
@reference_rigs.data_option
@json_option
def minimise_rows(names, max_fov_loss, data, json_file):
    """Rows of line buffer of every reference rig, or of the named ones, before and after --minimise rows."""
    reference_rigs.check(data)
    options = RectificationOptions(minimise="rows", max_fov_loss=max_fov_loss)
    rows = []
    with steps() as progress:
        for name in names or reference_rigs.CALIBRATIONS:
            if name not in reference_rigs.CALIBRATIONS:
                raise click.UsageError(f"{name}: the rigs are {', '.join(reference_rigs.CALIBRATIONS)}")
            progress(name)
            rig = reference_rigs.load(name, data)
            rows += [{"rig": name, **measure(rig, options, lens)} for lens in (True, False)]
    write_json(json_file, rows)
    title = f"Rows of line buffer, left and right, with at most {max_fov_loss:.0%} of the view lost"
    show(title, HEADINGS, map(as_text, rows))


def measure(rig: Rig, options: RectificationOptions, lens: bool) -> dict:
    """What ``options``, with ``minimise``, make of ``rig``: rows, exhaustively counted, and the price of it."""
    before = rectify(rig, replace(options, minimise=None, max_fov_loss=None), lens=lens)
    start = time.perf_counter()
    after = rectify(rig, options, lens=lens)
    seconds = time.perf_counter() - start
    return {
        "width": rig.width,
        "height": rig.height,
        "lens": lens,
        "before": {side: before[side].window.rows for side in SIDES},
        "after": {side: after[side].window.rows for side in SIDES},
        "lost": loss(before, after),
        "filled": {side: float(after[side].inside.mean()) for side in SIDES},
        "row_disagreement": row_disagreement(rig, after),
        "seconds": seconds,
    }


def as_text(row):
    """The cells of one row of the table."""
    before, after = (sum(row[when].values()) for when in ("before", "after"))
    return (
        row["rig"],
        f"{row['width']}x{row['height']}",
        "yes" if row["lens"] else "no",
        "{left}, {right}".format(**row["before"]),
        "{left}, {right}".format(**row["after"]),
        f"{1 - after / before:.0%}",
        f"{row['lost']:.1%}",
        "{left:.1%}, {right:.1%}".format(**row["filled"]),
        f"{row['row_disagreement']:.0e} px",
        f"{row['seconds']:.1f}",
    )


if __name__ == "__main__":
    run(minimise_rows)
