"""What was measured of the clock of cores: `hdl.core.clock`, the README's table of it, and whether both are current."""

import hashlib
import json
import re
import tomllib

from hdl.core import clock
from hdl.tools import nextpnr, yosys
from hdl.tools.xc7_timing import MODEL
from scripts import readme

ROOT = readme.README.parent
RECORD = ROOT / "hdl" / "core" / clock.RECORD
HEADINGS = ("core", "pipeline", "frame", "FF", "LUT", "RAMB18", "model ns", "model MHz", "ECP5-6 MHz", "with OUTREG",
            "critical path on ECP5: ns by block")  # fmt: skip
TEXTS = 3  # of them are texts
_KEY = ("datapath", "lens", "dsp_allowed", "pipeline", "width", "height")


def digest(verilog):
    """SHA-256 of a core's Verilog, but for what its clock does not depend on.

    That is the comment above it, and the values of constants: on another processor fits end in other last digits.
    """
    body = re.sub(r"^//.*\n", "", verilog, flags=re.MULTILINE)
    return hashlib.sha256(re.sub(r"('s?[bdh])[0-9a-fA-FxzXZ_]+", r"\1", body).encode()).hexdigest()


def versions():
    """Of the tools that measure, as the project asks for them: nextpnr's need not be installed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["clock"]]
    pinned = dict(requirement.split("==") for requirement in wanted if "==" in requirement)
    return {package: pinned[package] for package in (yosys.PACKAGE, nextpnr.PACKAGE)}


def title(row):
    """What core a row is of: its datapath and what is with it."""
    return row["datapath"] + (", lens" if row["lens"] else "") + (", with DSP" if row["dsp_allowed"] else "")


def frame(row):
    return f"{row['width']}x{row['height']}"


def table_rows(rows):
    """The rows of the table, as text."""
    for row in rows:
        model, routed, registered = row["xc7"], row["ecp5"], row["ecp5_outreg"]
        path = (registered or routed or {"path": []})["path"]
        yield (
            title(row),
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


def as_markdown(record):
    """The table as the README has it."""
    conditions = record["conditions"]
    sentences = [
        "Whole cores, 8 bit, embedded rig, left camera; -nodsp, but for those with DSP. A frame of another shape than",
        "640x480 is the middle of one of that shape.",
        f"FF, LUT, RAMB18 (a RAMB36 counts as two): {conditions['xc7']}. Model: of that netlist, {MODEL}.",
        f"ECP5-6: {conditions['ecp5']}; the median of {len(record['seeds'])} seeds, and the best of them.",
        "With OUTREG: with the registers behind block RAM taken into it, as Lattice's tools do and Yosys does not; the",
        "path then is of that.",
        *(f"Not built: {refusal}." for refusal in record["refusals"]),
        "`python -m scripts.clock` measures other frames and pipelines.",
    ]
    return f"{readme.markdown(HEADINGS, table_rows(record['rows']))}\n\n{' '.join(sentences)}"


def load():
    """What `RECORD` holds; None where it holds no record."""
    try:
        record = json.loads(RECORD.read_text(encoding="utf-8"))
        as_markdown(record)
        return record if {"versions", "seeds"} <= record.keys() else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def stale(digests):
    """What is not current, in one line; "" where all is.

    Parameters
    ----------
    digests : {tuple: str}
        `digest` of the cores as they are built now, by `key`.
    """
    problem = _problem(digests)
    return f"{problem}; `make clock` brings it up to date" if problem else ""


def _problem(digests):
    record, pinned = load(), versions()
    if record is None:
        return f"{RECORD.name} is missing, or no record of measurements"
    others = [f"{tool} {version}" for tool, version in record["versions"].items() if pinned.get(tool) != version]
    if others:
        return f"{RECORD.name} was measured with {', '.join(others)}"
    measured = {key(row): row["digest"] for row in record["rows"]}
    changed = [core for core in {**digests, **measured} if measured.get(core) != digests.get(core)]
    if changed:
        row = dict(zip(_KEY, changed[0]))
        more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        core = f"{title(row)}, {row['pipeline']}, {frame(row)}"
        return f"{RECORD.name} was measured on cores that are others now: {core}{more}"
    if readme.replaced("clock", as_markdown(record)) != readme.README.read_text(encoding="utf-8"):
        return f"{readme.README.name}: the table of clock is not that of {RECORD.name}"
    return ""


def key(row):
    """What tells the cores of a record apart."""
    return tuple(row[name] for name in _KEY)
