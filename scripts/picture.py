"""``python -m scripts.picture``: the README's picture, from the pixels of the cores' own Verilog."""

from pathlib import Path

import cv2
import numpy as np
import rich_click as click

from hdl import calibration, files
from hdl.cli import FileType, run, steps
from hdl.core.build import Options, build
from hdl.geometry.rectification import rectify
from sim.compiler import compile_core
from sim.frame import frame_through
from sim.overlay import epipolar_overlay
from sim.scene import render

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "rectified.jpg"
WIDTH = 1200  # px
QUALITY = 88  # of the JPEG


@click.command()
@click.option("--output", type=FileType((".jpg", ".jpeg")), default=PICTURE, help="Where it goes.")
def picture(output):
    """Draw the example rig's frames before and after the cores, the lens included, with epipolar lines."""
    with steps() as progress:
        rig = calibration.embedded()
        sources = render(rig, lens=True)
        rectified = {}
        for side, view in rectify(rig, lens=True).items():
            core = build(view, Options(), f"rectify_{side}", progress)
            compiled = compile_core(core.verilog, core.plan.top)
            rectified[side] = frame_through(core, compiled, 0.0, sources[side]).rectified
        rows = [epipolar_overlay(pair["left"], pair["right"]) for pair in (sources, rectified)]
    stacked = np.vstack([rows[0], np.full((8, rows[0].shape[1], 3), 255, np.uint8), rows[1]])
    height = round(stacked.shape[0] * WIDTH / stacked.shape[1])
    small = cv2.resize(stacked, (WIDTH, height), interpolation=cv2.INTER_AREA)
    files.write({output: cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()})
    click.echo(output)


if __name__ == "__main__":
    run(picture)
