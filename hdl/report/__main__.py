"""``python -m hdl.report``: one HTML page about the cores that ``hdl.generate`` wrote into a folder."""

import json
from pathlib import Path

import rich_click as click

from hdl import files
from hdl.cli import FileType, run, steps
from hdl.core.plan_file import load_folder
from hdl.errors import InputError
from hdl.report.measure import measure
from hdl.report.page import page


class DistancesType(click.ParamType):
    """Z,Z,... in the calibration's unit."""

    name = "Z,Z,..."

    def convert(self, value, param, ctx):
        if not isinstance(value, str):
            return value
        try:
            found = sorted({float(part) for part in value.split(",")})
        except ValueError:
            found = [0.0]
        if not all(1e-9 <= distance <= 1e12 for distance in found):
            raise InputError("--distances", None, value, "must be positive numbers, for example 0.5,1,2")
        return found


IMAGE = click.Path(path_type=Path, exists=True, dir_okay=False)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="PLAN_DIR")
@click.option(
    "--output",
    type=FileType(),
    metavar="FILE",
    help="Where the page goes. Default: PLAN_DIR/report.html.",
)
@click.option(
    "--json",
    "json_file",
    type=FileType(),
    metavar="FILE",
    help="Write the figures behind the page to FILE, too.",
)
@click.option("--left", type=IMAGE, help="Image of the left camera, in place of a rendered scene.")
@click.option("--right", type=IMAGE, help="Image of the right camera.")
@click.option(
    "--clock", type=float, default=100.0, show_default=True, metavar="MHZ", help="Clock for latency and frame rate."
)
@click.option(
    "--distances",
    type=DistancesType(),
    help="Distances for the depth error, in the calibration's unit. Default: from a disparity of a quarter of the "
    "width to one of 2 px.",
)
@click.option(
    "--synthesis/--no-synthesis",
    default=True,
    show_default=True,
    help="Measure LUT, FF, DSP and block RAM with Yosys: some 10 s a core, kept in a folder cache beside the page.",
)
def report(folder, output, json_file, left, right, clock, distances, synthesis):
    """Write one self-contained HTML page about the cores in PLAN_DIR, as hdl.generate wrote them.

    The folder's own Verilog is simulated for the pictures; everything else is computed from the core that its plan
    states, rebuilt and compared with the Verilog.

    \b
    python -m hdl.report build
    python -m hdl.report build --left L.png --right R.png --clock 150 --output mine.html
    """
    planned = load_folder(folder)
    images = {side: file for side, file in (("left", left), ("right", right)) if file}
    for side in sorted({*images, *planned} if images else []):
        if side not in planned:
            raise InputError(f"--{side}", None, images[side], f"{folder} has no core for the {side} camera")
        if side not in images:
            raise InputError(f"--{side}", None, None, "give an image for each camera or for none")
    output = output or folder / "report.html"
    if not 1e-3 <= clock <= 1e5:
        raise InputError("--clock", None, clock, "must be 0.001 to 100000 MHz")
    read = [*(file for one in planned.values() for file in one.files), *images.values()]
    files.check_targets("--output", [output], read)
    files.check_folder("--output", output.parent / "cache")
    if json_file:
        files.check_targets("--json", [json_file], [*read, output])
    with steps() as progress:
        found = measure(
            planned,
            images=images,
            clock_mhz=clock,
            distances=distances,
            synthesis=synthesis,
            cache=output.parent / "cache",
            progress=progress,
        )
        progress("page")
        contents = {output: page(found)}
        if json_file:
            contents[json_file] = json.dumps(found.figures(), indent=2, allow_nan=False) + "\n"
        files.write(contents)
    click.echo(output)
    return 1 if found.broken_pixels else 0


if __name__ == "__main__":
    run(report)
