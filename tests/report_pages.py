"""Folders with cores to report on, and what is measured of them; small and without synthesis."""

import json
from pathlib import Path

from hdl import calibration
from hdl.core.build import Options, build
from hdl.core.plan_file import load_folder
from hdl.generate import write
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.report.measure import measure

SIDES = ("left", "right")
CACHE = Path("build/cache").resolve()


def write_cores(directory, options=Options(), *, sides=SIDES, size=(96, 64), lens=True, alpha=None):
    """The embedded rig's cores, as `hdl.generate` writes them; returns the directory."""
    views = rectify(calibration.embedded(size), RectificationOptions(alpha=alpha), lens=lens)
    write([build(views[side], options, f"rectify_{side}") for side in sides], directory)
    return directory


def measured(directory, **choices):
    """The `Report` of a folder."""
    settings = {"images": {}, "clock_mhz": 100.0, "distances": None, "synthesis": False, "cache": CACHE}
    return measure(load_folder(directory), **settings | choices)


def edit(directory, change, top="rectify_left"):
    """Apply ``change`` to the dict of a plan, in its file."""
    file = directory / f"{top}.json"
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
