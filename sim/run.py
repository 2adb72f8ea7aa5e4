"""``python -m sim.run``: real frames through the generated cores, and how exact they came out."""

import json
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import rich_click as click
from click.core import ParameterSource
from rich.console import Console

from hdl import files
from hdl.calibration.rig import SIDES
from hdl.cli import camera_table, note, run, steps
from hdl.core.plan_file import load_folder, stereo_rig
from hdl.errors import InputError
from hdl.generate import build_cores, core_options, load_rig, write
from sim import matching
from sim.alignment import row_difference
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core
from sim.overlay import column_overlay, epipolar_overlay
from sim.remap import cv2_remap, remap
from sim.scene import render, visible_points

KNOWN_POINTS = 4000
SUSPICIOUS = 1.0  # px between the rows of matched points after rectification; good calibrations leave a quarter of it
PICTURES = [f"{what}_{stage}" for stage in ("source", "rectified") for what in (*SIDES, "epipolar")]
# libjpeg fills up with gray what is missing of an image. Some programs write a little behind the end.
JPEG_START, JPEG_END, JPEG_TAIL = b"\xff\xd8", b"\xff\xd9", 4096


@dataclass(frozen=True)
class Result:
    """One camera's frame through its core.

    Members
    -------
    core : hdl.core.build.Core
    source, rectified : (H, W) or (H, W, 3)
        What went in and what the hardware gave out.
    model_differences : int
        Pixels that differ from the integer model's; 0 unless something is broken.
    cv2_differences : int or None
        Pixels that differ from cv2.remap's with the same fixed-point coordinates; None where OpenCV has no such
        arithmetic (pixels of more than 8 bits, other than 5 fraction bits).
    exact_difference : float
        Mean gray-level difference from the map in float64, in steps of the pixel's own scale.
    seconds, cycles, compile_seconds
        The frame's run, and making the simulator.
    """

    core: object
    source: np.ndarray
    rectified: np.ndarray
    model_differences: int
    cv2_differences: int | None
    exact_difference: float
    seconds: float
    cycles: int
    compile_seconds: float


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
    help="Run the cores of both cameras that hdl.generate wrote into DIR; without CALIBRATION and its options.",
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
    read = (*calibrations, *images.values(), *(file for one in planned.values() for file in one.files))
    files.refuse_overwriting("--output", [output / f"{name}.png" for name in PICTURES], read)
    with steps() as progress:
        progress("calibration")
        rig = stereo_rig(planned) if planned else load_rig(calibrations, size, file_format, select, lens_model)
        plan = planned["left"].plan if planned else None
        pixel_bits, channels = (
            getattr(plan, name) if plan else int(choices[name]) for name in ("pixel_bits", "channels")
        )
        sources = {side: read_image(file, rig, pixel_bits, channels) for side, file in images.items()}
        if planned:
            cores = {side: one.rebuild(progress) for side, one in planned.items()}
        else:
            cores = dict(zip(SIDES, build_cores(None, progress, rig, **choices)))
        if not sources:
            progress("rendering the scene")
            sources = render(rig, cores["left"].plan.lens, bits=pixel_bits, channels=channels)
        if not planned:
            _note_replaced(cores, output)
            write(cores.values(), output, read)
        progress("compiling the Verilog for simulation")
        with ThreadPoolExecutor() as pool:
            compiled = dict(zip(SIDES, pool.map(lambda core: _compile(core, output / "cache"), cores.values())))
        progress("running the frames")
        results = {side: frame_through(cores[side], *compiled[side], sources[side]) for side in SIDES}
        progress("row differences and pictures")
        rows = matched_rows(results) if left else known_rows(rig, results)
        pictures = write_pictures(results, output)
    if left and rows and rows["after"].mean > SUSPICIOUS:
        mean = rows["after"].mean
        note(
            f"{left}, {right}: {_aligned(results)} of matched points still differ by {mean:.1f} px on average; "
            "is the calibration of these cameras, and left the left one?"
        )

    broken = sum(result.model_differences + (result.cv2_differences or 0) for result in results.values())
    if as_json:
        click.echo(json.dumps(as_dict(results, rows, pictures), indent=2))
    else:
        _print(results, rows, "matched" if left else "known", pictures)
    return 1 if broken else 0


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


def read_image(file, frame, pixel_bits, channels):
    """An image as a source frame; raises InputError where it is none.

    Gray cores take colour images as gray. Images of 8 bits are scaled up for cores of more.

    Parameters
    ----------
    file : Path
    frame : Rig or Plan
        It has the ``width`` and ``height`` that the image must have, px.
    pixel_bits, channels : int
    """
    try:
        image = cv2.imread(str(file), cv2.IMREAD_COLOR if channels == 3 else cv2.IMREAD_ANYDEPTH)
    except cv2.error as error:
        raise InputError(file, None, None, f"OpenCV refuses this image: {error.err}") from None
    if image is None:
        raise InputError(file, None, None, "is not an image that OpenCV can read")
    data = file.read_bytes()
    if data.startswith(JPEG_START) and JPEG_END not in data[-JPEG_TAIL:]:
        raise InputError(file, None, None, "ends in the middle of the image")
    height, width = image.shape[:2]
    if (width, height) != (frame.width, frame.height):
        raise InputError(
            file,
            "size",
            f"{width}x{height}",
            f"the cores take {frame.width}x{frame.height}"
            + (
                f"; --size {width}x{height} scales the calibration"
                if width * frame.height == height * frame.width
                else ""
            ),
        )
    if image.dtype == np.uint8:
        return image if pixel_bits == 8 else image.astype(np.uint16) << (pixel_bits - 8)
    if image.dtype != np.uint16:
        raise InputError(file, "pixels", image.dtype, "8 or 16 bits without a sign are needed")
    if int(image.max()) >> pixel_bits:
        raise InputError(file, "pixels", f"up to {image.max()}", f"do not fit {pixel_bits} bits; see --pixel-bits")
    return image


def _compile(core, cache):
    start = time.perf_counter()
    return compile_core(core.verilog, core.plan.top, cache=cache), time.perf_counter() - start


def frame_through(core, compiled, compile_seconds, source):
    """Run one frame through a compiled core and compare; returns a `Result`."""
    plan, coordinates = core.plan, core.parameters.datapath.coordinates
    start = time.perf_counter()
    stream = compiled.run(to_beats(source, channels=plan.channels, pixel_bits=plan.pixel_bits))
    (rectified,) = to_frames(stream.beats, plan.width, plan.height, channels=plan.channels, pixel_bits=plan.pixel_bits)
    seconds = time.perf_counter() - start
    border = (plan.border.mode, plan.border.value)
    model = remap(source, coordinates.u, coordinates.v, plan.fraction_bits, *border)
    same_in_cv2 = plan.pixel_bits == 8 and plan.fraction_bits == 5
    cv2_pixels = cv2_remap(source, coordinates.u, coordinates.v, *border) if same_in_cv2 else None
    exact = cv2.remap(
        source,
        *(axis.astype(np.float32) for axis in core.exact),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE if border[0] == "replicate" else cv2.BORDER_CONSTANT,
        borderValue=[border[1]] * 3,
    )
    return Result(
        core,
        source,
        rectified,
        _different_pixels(rectified, model),
        None if cv2_pixels is None else _different_pixels(rectified, cv2_pixels),
        float(np.abs(rectified.astype(float) - exact).mean()),
        seconds,
        stream.cycles,
        compile_seconds,
    )


def _different_pixels(a, b):
    different = a != b
    return int(np.count_nonzero(different.any(axis=-1) if different.ndim == 3 else different))


def known_rows(rig, results):
    """True row differences of points of the rendered scene, before and after the hardware: two `RowDifference`."""
    _, points = visible_points(rig, results["left"].core.plan.lens, KNOWN_POINTS)
    maps = {}
    for side, result in results.items():
        coordinates = result.core.parameters.datapath.coordinates
        maps[side] = (coordinates.u * 2.0**-coordinates.fraction_bits, coordinates.v * 2.0**-coordinates.fraction_bits)
    aligned = _aligned(results)
    return {"before": row_difference(None, points, aligned), "after": row_difference(maps, points, aligned)}


def matched_rows(results):
    """Row differences of points that both cameras' images show, before and after the hardware: two `RowDifference`, or
    None where too few points are found."""
    plan = results["left"].core.plan
    pairs = {
        when: [(getattr(results[side], stage) >> (plan.pixel_bits - 8)).astype(np.uint8) for side in SIDES]
        for when, stage in (("before", "source"), ("after", "rectified"))
    }
    rows = {when: matching.matched_rows(*pair, _aligned(results)) for when, pair in pairs.items()}
    return rows if all(rows.values()) else None


def _aligned(results):
    """What the two cores align: "rows", or "columns" of cameras that stand one above the other."""
    return results["left"].core.plan.rectification.aligned


def write_pictures(results, directory):
    """Write the source and the rectified images and the epipolar overlays; returns their paths by name."""
    images = {}
    for stage in ("source", "rectified"):
        pair = [getattr(results[side], stage) for side in SIDES]
        images.update({f"{side}_{stage}": image for side, image in zip(SIDES, pair)})
        plan = results["left"].core.plan
        overlay = epipolar_overlay if _aligned(results) == "rows" else column_overlay
        images[f"epipolar_{stage}"] = overlay(*((image >> (plan.pixel_bits - 8)).astype(np.uint8) for image in pair))
    paths = {name: directory / f"{name}.png" for name in PICTURES}
    files.write({paths[name]: cv2.imencode(".png", image)[1].tobytes() for name, image in images.items()})
    return paths


def as_dict(results, rows, pictures):
    """The results for machines."""
    return {
        "cameras": {
            side: {
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
        f"{_aligned(results)[:-1]}_difference": rows and {stage: row._asdict() for stage, row in rows.items()},
        "pictures": {name: str(path) for name, path in pictures.items()},
    }


def _print(results, rows, points, pictures):
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
    if rows:
        before, after = rows["before"], rows["after"]
        console.print(
            f"{_aligned(results).capitalize()} of {after.n} {points} points in the left and right image differ by "
            f"{before.mean:.2f} px on average (at most {before.max:.2f}) before, {after.mean:.3f} px (at most "
            f"{after.max:.3f}) after."
        )
    for side in SIDES:
        core = results[side].core
        console.print(f"{side + ' Verilog':>18}  {pictures['left_source'].with_name(core.plan.top + '.v')}")
    for name, path in pictures.items():
        console.print(f"{name.replace('_', ' '):>18}  {path}")


if __name__ == "__main__":
    run(simulate)
