"""``python -m hdl.calibration``: what a calibration file says, as it was understood."""

import json
import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import rich_click as click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hdl import calibration, files
from hdl.calibration import SIDES, Camera, Rig, convert
from hdl.calibration.options import lens_model_option
from hdl.cli import FileType, SizeType, camera_table, run
from hdl.geometry.notes import notes, row_disagreement, warnings
from hdl.geometry.options import rectification_options
from hdl.geometry.rectification import RectificationOptions, View, rectify
from hdl.lens import LENS_MODELS


@click.command("calibration")
@click.argument("read", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option(
    "--format",
    type=click.Choice([reader.NAME for reader in calibration.FORMATS]),
    metavar="NAME",
    help="Take the files to be of this format, instead of looking into them: "
    + "; ".join(f"{reader.NAME}, {reader.TITLE}" for reader in calibration.FORMATS)
    + ".",
)
@click.option(
    "--select",
    metavar="WHICH",
    help="The cameras or the resolution to take, where a file holds several. "
    + " ".join(f"{reader.NAME}: {reader.SELECT}." for reader in calibration.FORMATS if reader.SELECT),
)
@lens_model_option
@click.option(
    "--size",
    type=SizeType(),
    help="Frame size, px; scales the calibration, or chooses from one with several resolutions.",
)
@rectification_options
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
@click.option(
    "--convert",
    "target",
    type=FileType(convert.SUFFIXES),
    metavar="OUT.yml",
    help="Write the calibration to OUT.yml in OpenCV's format; the rectification too if the file has one or "
    "an option chooses one. Lenses that OpenCV does not know are written so that this program reads them again.",
)
def describe(read, format, select, lens_model, size, as_json, target, **choices):
    """Show what was understood of a calibration: cameras, lenses, baseline, rectification, rows of line buffer.

    FILE is what your calibration tool wrote; several files if it takes them to describe one pair of cameras.

    \b
    python -m hdl.calibration rig.yml
    python -m hdl.calibration calib_cam_to_cam.txt --select 2,3 --json
    python -m hdl.calibration left.yaml right.yaml --minimise rows --convert rig.yml
    """
    options = RectificationOptions(**choices)
    if target:
        below = (path for folder in read if folder.is_dir() for path in folder.iterdir() if path.is_dir())
        files.check_targets("--convert", [target], [*read, *below])
    rig = calibration.load(*read, size=size, format=format, select=select, lens_model=lens_model)
    description = Description(rig, options)
    content = description.as_json()  # before anything is written: it refuses what cannot be rectified
    if target:
        chosen = {side: (view.R, view.P) for side, view in description.views.items()}
        convert.write(target, convert.to_opencv(rig, chosen if rig.rectification or options.given else None))
    if as_json:
        click.echo(compact(content))
        return
    console = Console()
    for table in description.tables():
        console.print(table)
    for line in warnings(rig, description.views, options):
        console.print("[bold yellow]warning:[/]", escape(line), soft_wrap=True, highlight=False)
    for line in notes(rig, options, description.views):
        console.print("[bold]note:[/]", escape(line), soft_wrap=True, highlight=False)
    if target:
        console.print(f"Written to {escape(str(target))}", highlight=False)


@dataclass(frozen=True)
class Description:
    """A rig, rectified with ``options``, in words and numbers. Raises InputError for what cannot be rectified."""

    rig: Rig
    options: RectificationOptions

    @cached_property
    def views(self) -> dict[str, View]:
        """With the lens."""
        return rectify(self.rig, self.options, lens=True)

    @cached_property
    def plain(self) -> dict[str, View]:
        """Of the same rectification, without the lens."""
        return {side: replace(view, lens=False) for side, view in self.views.items()}

    def as_json(self) -> dict:
        rig = self.rig
        cameras = {side: rig.camera(side) for side in SIDES}
        return {
            "width": rig.width,
            "height": rig.height,
            **{
                side: {
                    "source": rig.origins[side],
                    "width": camera.size[0],
                    "height": camera.size[1],
                    "model": camera.model,
                    "K": camera.K.tolist(),
                    "D": camera.D.tolist(),
                }
                for side, camera in cameras.items()
            },
            "R": rig.R.tolist(),
            "T": rig.T.tolist(),
            "unit": rig.unit,
            "rectification": {side: {"R": view.R.tolist(), "P": view.P.tolist()} for side, view in self.views.items()},
            "rows": {
                side: {"lens": self.views[side].window.rows, "no_lens": self.plain[side].window.rows} for side in SIDES
            },
            "warnings": warnings(rig, self.views, self.options),
        }

    def tables(self) -> list[Table]:
        return [self._pair(), self._cameras()]

    def _pair(self):
        rig = self.rig
        table = Table(title=escape(rig.source), title_justify="left", title_style="bold", show_header=False)
        unit = rig.unit or "(the file does not say of what)"
        turn = np.degrees(np.linalg.norm(cv2.Rodrigues(rig.R)[0]))
        table.add_row("format", next((each.TITLE for each in calibration.FORMATS if each.NAME == rig.format), "none"))
        table.add_row("images", f"{rig.width}x{rig.height} px" if len(rig.sizes) == 1 else "of two sizes")
        table.add_row("baseline", f"{np.linalg.norm(rig.T):.6g} {unit}")
        table.add_row("T, x_right = R x_left + T", f"{_numbers(rig.T)} {rig.unit or ''}".rstrip())
        table.add_row("angle between the cameras", f"{turn:.3f} degrees")
        table.add_row("rectification", self.views["left"].origin)
        aligned = self.views["left"].aligned
        table.add_row(f"{aligned} of a point agree within", f"{row_disagreement(rig, self.views):.2g} px")
        return table

    def _cameras(self):
        cameras = [self.rig.camera(side) for side in SIDES]
        views, plain = ([pair[side] for side in SIDES] for pair in (self.views, self.plain))
        rows = [("read from", [self.rig.origins[side] for side in SIDES])]
        if len(self.rig.sizes) > 1:
            rows += [
                ("image", ["{}x{} px".format(*camera.size) for camera in cameras]),
                ("rectified image", [f"{view.width}x{view.height} px" for view in views]),
            ]
        rows += [
            ("focal length x, y", [f"{K[0, 0]:.3f}, {K[1, 1]:.3f} px" for K in (camera.K for camera in cameras)]),
            ("principal point x, y", [f"{K[0, 2]:.3f}, {K[1, 2]:.3f} px" for K in (camera.K for camera in cameras)]),
        ]
        if any(camera.K[0, 1] for camera in cameras):
            rows.append(("skew", [f"{camera.K[0, 1]:.4g} px" for camera in cameras]))
        rows += [
            ("lens", [camera.model for camera in cameras]),
            ("lens coefficients", [coefficients(camera) for camera in cameras]),
            ("the lens shifts pixels", [f"up to {np.hypot(*view.distortion).max():.1f} px" for view in views]),
            ("turn about x, y, z", [f"{_angles(view.R)} degrees" for view in views]),
            ("rectified focal length", [f"{view.P[0, 0]:.3f} px" for view in views]),
            ("rectified centre", [f"{view.P[0, 2]:.3f}, {view.P[1, 2]:.3f} px" for view in views]),
            ("rows, with the lens", [f"{view.window.rows} rows" for view in views]),
            ("rows, without it", [f"{view.window.rows} rows" for view in plain]),
            ("filled, with the lens", [f"{100 * view.inside.mean():.2f} %" for view in views]),
            ("filled, without it", [f"{100 * view.inside.mean():.2f} %" for view in plain]),
        ]
        return camera_table("", SIDES, rows)


def coefficients(camera: Camera) -> str:
    """One ``name value`` a line, without the zeros at the end."""
    names = LENS_MODELS[camera.model].coefficients
    used = int(np.max(np.flatnonzero(camera.D), initial=-1)) + 1
    return "\n".join(f"{name} {value: .6g}" for name, value in zip(names, camera.D[:used])) or "none"


def compact(content) -> str:
    """JSON text with one matrix row a line."""
    text = json.dumps(content, indent=2, allow_nan=False)
    return re.sub(r"\[[-+.eE\d\s,]*\]", lambda row: " ".join(row.group().split()), text)


def _numbers(values):
    return ", ".join(f"{value:.6g}" for value in values)


def _angles(R):
    """Turns about x, y and z, degrees: the rotation vector."""
    return ", ".join(f"{angle:.3f}" for angle in np.degrees(cv2.Rodrigues(R)[0].ravel()))


if __name__ == "__main__":
    run(describe)
