"""``python -m hdl.generate``: Verilog and plan of the rectifiers for a calibrated stereo camera."""

import json

import rich_click as click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hdl import calibration, files
from hdl.calibration.rig import SIDES
from hdl.cli import camera_table, note, run, steps
from hdl.core.build import AUTO, Options, build, refuse_other_size, refuse_whole_frames
from hdl.core.line_memory import LineMemoryError, in_kib, refuse_early, remedy
from hdl.core.options import OUTPUT, core_options
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.notes import notes, warnings
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.tools.verilog_keywords import VERILOG_KEYWORDS, is_identifier


@click.command()
@core_options
@click.option("--camera", type=click.Choice(SIDES), help="Build this camera only. Default: both.")
@click.option("--json", "as_json", is_flag=True, help="Print the plans as JSON instead of a table.")
def generate(calibrations, size, file_format, select, lens_model, camera, as_json, output, **choices):
    """Write the Verilog of streaming rectification cores, and a plan that says how exact each one is.

    CALIBRATION is the stereo calibration that your tool wrote: one file, a folder, or the files of one pair of cameras.
    Without one, cores for an embedded example rig are built.

    \b
    python -m hdl.generate                                    both cameras of the example rig, under build/
    python -m hdl.generate rig.yml --camera left --output rtl
    python -m hdl.generate rig.yml --datapath accumulate --max-error 0.05
    """
    output = output or OUTPUT
    check_targets(camera, choices["top"], output, calibrations)
    with steps() as progress:
        progress("calibration")
        sides = [camera] if camera else SIDES
        rig = load_rig(calibrations, size, file_format, select, lens_model, sides)
        cores = build_cores(camera, progress, rig, **choices)
    write(cores, output)
    if as_json:
        click.echo(json.dumps([core.plan.model_dump() for core in cores], indent=2))
        return
    console = Console()
    for core in cores:
        if core.plan.considered:
            console.print(considered(core.plan))
    console.print(summary(cores, output))


def build_cores(
    camera,
    progress,
    rig,
    *,
    datapath,
    optimise,
    pipeline,
    clock,
    family,
    dsp,
    max_error,
    lens,
    pixel_bits,
    channels,
    fraction_bits,
    border,
    max_line_buffer_kib,
    top,
    **rectification,
):
    """The cores that the command line asks for; ``camera`` None for both. Raises InputError.

    ``rectification``: the arguments of `RectificationOptions`.
    """
    if optimise not in (Options.optimise, "lut") and datapath != AUTO:
        raise InputError("--optimise", None, optimise, f"decides among datapaths; {datapath} was named already")
    if pipeline and clock is not None:
        raise InputError("--pipeline", None, pipeline, "--clock chooses the pipeline; give one of the two")
    tops = top_names(camera, top)
    options = Options(
        datapath=datapath,
        max_error=max_error,
        pixel_bits=int(pixel_bits),
        channels=int(channels),
        fraction_bits=fraction_bits,
        border=border,
        max_line_buffer_kib=max_line_buffer_kib,
        optimise=optimise,
        dsp=dsp,
        pipeline=pipeline or Options.pipeline,
        clock=clock,
        family=family,
    )
    able = [AUTO, *(name for name, candidate in DATAPATHS.items() if candidate.supports_lens)]
    if lens and datapath not in able:
        raise InputError("--lens", None, None, f"{datapath} computes no lens; these do: {', '.join(able)}")
    choices = RectificationOptions(**rectification)
    if choices.minimise:
        progress("rectification with the fewest rows")
    lens = datapath in able if lens is None else lens
    views = rectify(rig, choices, lens=lens)
    refuse_whole_frames(rig, views, choices, tops)
    for text in (*warnings(rig, views, choices), *notes(rig, choices, views)):
        note(text)
    try:
        for side in tops:
            refuse_early(views[side], options)
        return [
            build(views[side], options, name, lambda step, side=side: progress(f"{side} camera: {step}"))
            for side, name in tops.items()
        ]
    except LineMemoryError as refusal:
        progress("a view that needs fewer rows")
        raise refusal.with_remedy(remedy(rig, choices, options, lens=lens)) from None


def top_names(camera, top):
    """{side: name of its core}; ``camera`` None for both, ``top`` None for the default. Raises InputError."""
    tops = {side: top if camera and top else f"{top or 'rectify'}_{side}" for side in ([camera] if camera else SIDES)}
    for name in tops.values():
        if name in VERILOG_KEYWORDS:
            raise InputError("--top", None, name, "is a keyword of Verilog or SystemVerilog; choose another name")
        if not is_identifier(name):
            problem = "must be a Verilog identifier of up to 64 letters, digits and underscores"
            raise InputError("--top", None, name, problem)
    return tops


def check_targets(camera, top, directory, read):
    """Raise InputError, before any work, where `write` will not be able to write the cores of these names, or they are
    files that are ``read``."""
    names = top_names(camera, top).values()
    files.check_targets("--output", [directory / f"{name}{end}" for name in names for end in (".v", ".json")], read)


def load_rig(paths, size, file_format, select, lens_model, sides=SIDES):
    """The rig of the given calibration files, or the embedded one, at ``size`` (width, height) or its own.

    Raises InputError, too, where no core can be built for one of ``sides`` because of the sizes of the images.
    """
    if paths:
        rig = calibration.load(*paths, size=size, format=file_format, select=select, lens_model=lens_model)
        for side in sides:
            refuse_other_size(rig.fault, side, rig.camera(side).size, (rig.width, rig.height))
        return rig
    for option, value in (("--format", file_format), ("--select", select), ("--lens-model", lens_model)):
        if value is not None:
            raise InputError(option, None, value, "there is no CALIBRATION to read; the example rig needs none")
    return calibration.embedded(size)


def write(cores, directory):
    """Write TOP.v and TOP.json of each core into ``directory``: all of them or, on an error, none."""
    contents = {}
    for core in cores:
        contents[directory / f"{core.plan.top}.v"] = core.verilog
        contents[directory / f"{core.plan.top}.json"] = core.plan.to_json()
    files.write(contents)


def considered(plan):
    """A table of the datapaths that were considered for a core, the chosen one first."""
    title = f"Datapaths for the {plan.camera.side} camera; cost of the coordinates, estimated"
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("datapath")
    for heading in ("error px", "LUT", "FF", "RAMB18", "DSP"):
        table.add_column(heading, justify="right")
    table.add_column("")
    for entry in plan.considered:
        cost = [str(getattr(entry.cost, name)) if entry.cost else "" for name in ("lut", "ff", "ramb18", "dsp")]
        error = "" if entry.error is None else f"{entry.error:.4f}"
        table.add_row(entry.datapath, error, *cost, entry.verdict)
    return table


def estimate(cost):
    """A `CostEntry` in words, without what there is none of."""
    units = (("lut", "LUT"), ("ff", "FF"), ("ramb18", "RAMB18"), ("dsp", "DSP"))
    return ", ".join(f"{getattr(cost, name)} {unit}" for name, unit in units if getattr(cost, name))


def dropped(plan):
    """How far the lens that was left out moves pixels, in words."""
    size = plan.distortion_dropped
    return f"{size.u.max:.1f}, {size.v.max:.1f} px" if size else "no lens"


def summary(cores, directory):
    """A table of what was built."""
    plans = [core.plan for core in cores]
    return camera_table(
        f"Written to {escape(str(directory))}",
        [plan.camera.side for plan in plans],
        [
            ("camera", [plan.camera.source for plan in plans]),
            ("Verilog", [f"{plan.top}.v" for plan in plans]),
            ("plan", [f"{plan.top}.json" for plan in plans]),
            ("frame", [f"{plan.width}x{plan.height}" for plan in plans]),
            ("datapath", [f"{plan.datapath}, {'with' if plan.lens else 'without'} the lens" for plan in plans]),
            (
                "line buffer",
                [
                    f"{plan.line_buffer.rows} rows, {in_kib(core.parameters.line_buffer.bits / 8192)} KiB"
                    for core, plan in zip(cores, plans)
                ],
            ),
            ("pipeline", [f"{plan.pipeline.name}, {plan.pipeline.mhz:.0f} MHz" for plan in plans]),
            ("coordinates, estimated", [estimate(plan.cost) for plan in plans]),
            ("latency", [f"{plan.latency_cycles} clocks" for plan in plans]),
            *(
                [("lens left out, up to", [dropped(plan) for plan in plans])]
                if any(plan.distortion_dropped for plan in plans)
                else []
            ),
            ("coordinate error u, v: mean", [f"{plan.error.u.mean:.4f}, {plan.error.v.mean:.4f} px" for plan in plans]),
            ("coordinate error u, v: max", [f"{plan.error.u.max:.4f}, {plan.error.v.max:.4f} px" for plan in plans]),
        ],
    )


if __name__ == "__main__":
    run(generate)
