"""What was measured of the clock of cores: `hdl.core.clock`, the README's table of it, and whether both are current."""

from hdl.core import clock
from hdl.tools import nextpnr, yosys
from hdl.tools.xc7_timing import MODEL
from scripts import readme, record

RECORD = record.ROOT / "hdl" / "core" / clock.RECORD
HEADINGS = ("core", "pipeline", "frame", "FF", "LUT", "RAMB18", "model ns", "model MHz", "ECP5-6 MHz", "with OUTREG",
            "critical path on ECP5: ns by block")  # fmt: skip
TEXTS = 3  # of them are texts


def versions():
    """Of the tools that measure, as they should be."""
    return record.pinned(yosys.PACKAGE, nextpnr.PACKAGE)


def frame(row):
    return f"{row['width']}x{row['height']}"


def table_rows(rows):
    """The rows of the table, as text."""
    for row in rows:
        model, routed, registered = row["xc7"], row["ecp5"], row["ecp5_outreg"]
        path = (registered or routed or {"path": []})["path"]
        yield (
            record.title(row),
            row["pipeline"],
            frame(row),
            model["ff"],
            model["lut"],
            model["ramb18"] + 2 * model["ramb36"],
            f"{model['ns']:.2f}",
            f"{1000 / model['ns']:.0f}",
            _mhz(routed) if routed else "too large",
            _mhz(registered) if registered else "-",
            " > ".join(f"{block} {ns:.1f}" for block, ns in path) or "-",
        )


def _mhz(routed):
    return f"{routed['median']:.0f} ({max(routed['mhz'].values()):.0f})"


def as_markdown(found):
    """The table as the README has it."""
    conditions = found["conditions"]
    sentences = [
        "Whole cores, 8 bit, embedded rig, left camera; -nodsp, but for those with DSP. A frame of another shape than",
        "640x480 is the middle of one of that shape.",
        f"FF, LUT, RAMB18 (a RAMB36 counts as two): {conditions['xc7']}. Model: of that netlist, {MODEL}.",
        f"ECP5-6: {conditions['ecp5']}; the median of {len(found['seeds'])} seeds, and the best of them.",
        "With OUTREG: with the registers behind block RAM taken into it, as Lattice's tools do and Yosys does not; the",
        "path then is of that.",
        *(f"Not built: {refusal}." for refusal in found["refusals"]),
        "`python -m scripts.clock` measures other frames and pipelines.",
    ]
    return f"{readme.markdown(HEADINGS, table_rows(found['rows']))}\n\n{' '.join(sentences)}"


def stale(digests):
    """What is not current, in one line; "" where all is.

    Parameters
    ----------
    digests : dict of str to str
        `hdl.core.clock`'s cores as they are built now, by `name`.
    """

    def measured(found):
        return {name(row): row["digest"] for row in found["rows"]}

    return record.stale(RECORD, parts, versions(), measured, digests, "make clock")


def parts(found):
    """The README's parts of a record."""
    return {"clock": as_markdown(found)}


def name(row):
    """What tells the cores of a record apart."""
    return f"{record.title(row)}, {row['pipeline']}, {frame(row)}"
