"""``python -m sim.run``: real frames through the generated cores, and how exact they came out."""

import json
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import rich_click as click
from click.core import ParameterSource
from rich.console import Console

from hdl import files
from hdl.calibration.rig import SIDES
from hdl.cli import camera_table, note, run, steps
from hdl.core.options import OUTPUT, core_options
from hdl.core.plan_file import load_folder, stereo_rig
from hdl.errors import InputError
from hdl.generate import build_cores, check_targets, load_rig, write
from sim.compiler import compile_core
from sim.frame import frame_through
from sim.images import in_8_bits, read_image
from sim.overlay import column_overlay, epipolar_overlay
from sim.rows import rows_of_frames
from sim.scene import render

PICTURES = [f"{what}_{stage}" for stage in ("source", "rectified") for what in (*SIDES, "epipolar")]


@click.command()
@core_options
@click.option("--left", type=click.Path(path_type=Path, exists=True, dir_okay=False), help="Image of the left camera.")
@click.option(
    "--right", type=click.Path(path_type=Path, exists=True, dir_okay=False), help="Image of the right camera."
)
@click.option(
    "--cores",
    "folder",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Run the cores of both cameras that hdl.generate wrote into DIR; without CALIBRATION and its options. "
    "Pictures go there, too, unless --output says otherwise.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON instead of tables.")
@click.pass_context
def simulate(ctx, calibrations, size, file_format, select, lens_model, folder, left, right, as_json, output, **choices):
    """Run a frame of each camera through the Verilog of its core, built for it or taken from a folder.

    Give your own pair with --left and --right, as large as the calibration's images (or as --size). Without them, a
    scene is rendered as the two cameras would see it; there the true row of every point is known, before and after.

    \b
    python -m sim.run
    python -m sim.run rig.yml --left L.png --right R.png --output build/mine
    python -m sim.run --cores build --left L.png --right R.png
    """
    if (left is None) != (right is None):
        raise InputError("--right" if left else "--left", None, None, "give both images or neither")
    images = {"left": left, "right": right} if left else {}
    planned = _planned(ctx, folder) if folder else {}
    output = output or folder or OUTPUT
    read = (*calibrations, *images.values(), *(file for one in planned.values() for file in one.files))
    files.check_targets("--output", [output / f"{name}.png" for name in PICTURES], read)
    files.check_folder("--output", output / "cache")
    if not planned:
        check_targets(None, choices["top"], output, read)
    with steps() as progress:
        progress("calibration")
        rig = stereo_rig(planned) if planned else load_rig(calibrations, size, file_format, select, lens_model)
        plan = planned["left"].plan if planned else None
        pixel_bits, channels = (
            getattr(plan, name) if plan else int(choices[name]) for name in ("pixel_bits", "channels")
        )
        sources = {
            side: read_image(file, (rig.width, rig.height), pixel_bits, channels, built=bool(planned))
            for side, file in images.items()
        }
        if planned:
            cores = {side: one.rebuild(progress) for side, one in planned.items()}
        else:
            cores = dict(zip(SIDES, build_cores(None, progress, rig, **choices)))
        if not sources:
            progress("rendering the scene")
            sources = render(rig, cores["left"].plan.lens, bits=pixel_bits, channels=channels)
        if not planned:
            _note_replaced(cores, output)
            write(cores.values(), output)
        progress("compiling the Verilog for simulation")
        with ThreadPoolExecutor() as pool:
            compiled = dict(zip(SIDES, pool.map(lambda core: _compile(core, output / "cache"), cores.values())))
        progress("running the frames")
        results = {side: frame_through(cores[side], *compiled[side], sources[side]) for side in SIDES}
        progress("row differences and pictures")
        found = rows_of_frames(results, None if left else rig)
        pictures = write_pictures(results, output)
    verilog = {side: (folder or output) / f"{core.plan.top}.v" for side, core in cores.items()}
    if left and found.suspicious:
        note(f"{left}, {right}: {found.suspicious}")
    if as_json:
        click.echo(json.dumps(as_dict(results, found, verilog, pictures), indent=2))
    else:
        _print(results, found, verilog, pictures)
    return 1 if any(result.broken for result in results.values()) else 0


def _planned(ctx, folder):
    """The cores in a folder, {side: `PlannedCore`}; raises InputError unless both are there, unchanged."""
    allowed = {"folder", "left", "right", "as_json", "output"}
    for parameter in ctx.command.params:
        if parameter.name not in allowed and ctx.get_parameter_source(parameter.name) is ParameterSource.COMMANDLINE:
            problem = f"the cores are built already: {parameter.opts[0]} cannot change them"
            raise InputError("--cores", None, folder, problem)
    planned = load_folder(folder)
    for side in SIDES:
        if side not in planned:
            raise InputError("--cores", None, folder, f"has no core for the {side} camera")
    return planned


def _note_replaced(cores, output):
    """Say which cores in the folder are replaced by others."""
    for core in cores.values():
        file = output / f"{core.plan.top}.json"
        if file.is_file() and file.read_text(errors="replace") != core.plan.to_json():
            note(f"{file}: replaced, and its Verilog; --cores {output} runs the cores that are there")


def _compile(core, cache):
    start = time.perf_counter()
    return compile_core(core.verilog, core.plan.top, cache=cache), time.perf_counter() - start


def write_pictures(results, directory):
    """Write the source and the rectified images and the epipolar overlays; returns their paths by name."""
    images, bits = {}, results["left"].core.plan.pixel_bits
    for stage in ("source", "rectified"):
        pair = [getattr(results[side], stage) for side in SIDES]
        images.update({f"{side}_{stage}": image for side, image in zip(SIDES, pair)})
        overlay = epipolar_overlay if results["left"].core.plan.rectification.aligned == "rows" else column_overlay
        images[f"epipolar_{stage}"] = overlay(*(in_8_bits(image, bits) for image in pair))
    paths = {name: directory / f"{name}.png" for name in PICTURES}
    files.write({paths[name]: cv2.imencode(".png", image)[1].tobytes() for name, image in images.items()})
    return paths


def as_dict(results, found, verilog, pictures):
    """The results for machines."""
    return {
        "cameras": {
            side: {
                "verilog": str(verilog[side]),
                "plan": result.core.plan.model_dump(),
                "pixels_different_from_model": result.model_differences,
                "pixels_different_from_cv2_remap": result.cv2_differences,
                "mean_gray_difference_from_exact_map": result.exact_difference,
                "cycles": result.cycles,
                "seconds": result.seconds,
                "compile_seconds": result.compile_seconds,
            }
            for side, result in results.items()
        },
        **found.as_dict(),
        "pictures": {name: str(path) for name, path in pictures.items()},
    }


def _print(results, found, verilog, pictures):
    console = Console(highlight=False)
    plan = results["left"].core.plan
    total = plan.width * plan.height
    lens = f"{'with' if plan.lens else 'without'} the lens"
    rows_of_table = (
        ("datapath", lambda r: r.core.plan.datapath),
        ("pixels unlike the integer model's", lambda r: f"{r.model_differences} of {total}"),
        (
            "pixels unlike cv2.remap's",
            lambda r: "not comparable" if r.cv2_differences is None else f"{r.cv2_differences} of {total}",
        ),
        ("mean gray-level error, exact map", lambda r: f"{r.exact_difference:.3f}"),
        ("coordinate error u, v: mean", lambda r: f"{r.core.plan.error.u.mean:.4f}, {r.core.plan.error.v.mean:.4f} px"),
        ("coordinate error u, v: max", lambda r: f"{r.core.plan.error.u.max:.4f}, {r.core.plan.error.v.max:.4f} px"),
        ("line buffer", lambda r: f"{r.core.plan.line_buffer.rows} rows"),
        ("clocks for the frame", lambda r: f"{r.cycles}"),
        ("simulated in", lambda r: f"{r.seconds:.2f} s"),
    )
    console.print(
        camera_table(
            f"A frame through each core's Verilog: {plan.width}x{plan.height}, {lens}",
            SIDES,
            [(name, [text(results[side]) for side in SIDES]) for name, text in rows_of_table],
        )
    )
    console.print(found.sentence())
    for side, path in verilog.items():
        console.print(f"{side + ' Verilog':>18}  {path}", markup=False)
    for name, path in pictures.items():
        console.print(f"{name.replace('_', ' '):>18}  {path}", markup=False)


if __name__ == "__main__":
    run(simulate)
