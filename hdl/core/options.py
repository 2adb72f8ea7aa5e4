"""The options of commands that build cores, as DESIGN section 7 names them."""

from pathlib import Path

import rich_click as click

from hdl import calibration
from hdl.arithmetic.cost import GOALS
from hdl.arithmetic.cuts import PIPELINES
from hdl.calibration.options import lens_model_option
from hdl.cli import FolderType, SizeType
from hdl.core.build import AUTO, Options
from hdl.core.clock import FAMILIES
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import default_budget, fitted_budget
from hdl.geometry.options import BorderType, rectification_options

OUTPUT = Path("build")


def core_options(command):
    """Decorate a command with them."""
    for option in reversed(
        (
            click.argument("calibrations", nargs=-1, type=click.Path(path_type=Path), metavar="[CALIBRATION]..."),
            click.option(
                "--format",
                "file_format",
                type=click.Choice([reader.NAME for reader in calibration.FORMATS]),
                metavar="NAME",
                help="Take the calibration to be of this format, instead of looking into it: "
                + ", ".join(reader.NAME for reader in calibration.FORMATS)
                + ".",
            ),
            click.option(
                "--select",
                metavar="WHICH",
                help="The cameras or the resolution to take, where a calibration holds several.",
            ),
            lens_model_option,
            click.option(
                "--datapath",
                type=click.Choice([AUTO, *DATAPATHS]),
                default=Options.datapath,
                show_default=True,
                metavar="NAME",
                help=f"How coordinates are computed. {AUTO}: the cheapest that meets the budget. "
                + " ".join(f"{name}: {datapath.summary}." for name, datapath in DATAPATHS.items()),
            ),
            click.option(
                "--optimise",
                type=click.Choice(list(GOALS)),
                default=Options.optimise,
                show_default=True,
                help=f"What {AUTO} saves. lut: the line buffer and the interpolator too, for more block RAM and "
                "flip-flops.",
            ),
            click.option(
                "--pipeline",
                type=click.Choice(list(PIPELINES)),
                show_default=Options.pipeline,
                metavar="NAME",
                help="Where registers are. " + " ".join(f"{name}: {p.summary}." for name, p in PIPELINES.items()),
            ),
            click.option(
                "--clock",
                type=float,
                metavar="MHZ",
                help="Take the pipeline with the fewest registers that reaches this clock, by what was measured of "
                "cores like these; the plan says how.",
            ),
            click.option(
                "--family",
                type=click.Choice(list(FAMILIES)),
                default=Options.family,
                show_default=True,
                help="What FPGA the clock is of. " + " ".join(f"{name}: {f.title}." for name, f in FAMILIES.items()),
            ),
            click.option(
                "--dsp/--no-dsp",
                default=Options.dsp,
                show_default=True,
                help="Leave multiplications to the tool, which puts them into DSP blocks, or make them from adders.",
            ),
            click.option(
                "--max-error",
                type=float,
                metavar="PX",
                help="Largest error of source coordinates allowed, px of the source image per axis, rounding included. "
                f"Default: {fitted_budget(Options.fraction_bits):g} for {AUTO} and fitted datapaths; "
                f"{default_budget(Options.fraction_bits):.4f} for those that compute what they name.",
            ),
            click.option(
                "--lens/--no-lens",
                default=None,
                help="Correct the lens distortion too, or leave it out as the paper does. Default: with the lens "
                "where the datapath can.",
            ),
            click.option(
                "--size", type=SizeType(), help="Frame size, px; scales the calibration. Default: the calibration's."
            ),
            rectification_options,
            click.option(
                "--pixel-bits",
                type=click.Choice(["8", "10", "12", "16"]),
                default="8",
                show_default=True,
                help="Bits of a channel.",
            ),
            click.option(
                "--channels",
                type=click.Choice(["1", "3"]),
                default="1",
                show_default=True,
                help="Channels of a pixel; 3 with 8 bits only.",
            ),
            click.option(
                "--fraction-bits",
                type=click.IntRange(3, 8),
                default=Options.fraction_bits,
                show_default=True,
                help="Fraction bits of the coordinates that are interpolated at; 5 as cv2.remap.",
            ),
            click.option(
                "--border",
                type=BorderType(),
                default="constant",
                show_default=True,
                help="What lies outside the source image: one value, or its nearest pixel.",
            ),
            click.option(
                "--max-line-buffer-kib",
                type=click.IntRange(1),
                default=Options.max_line_buffer_kib,
                show_default=True,
                metavar="KIB",
                help="Refuse cores with more line memory than this.",
            ),
            click.option(
                "--top",
                metavar="NAME",
                help="Name of the top module, and of the files; without --camera, _left and _right are appended. "
                "Default: rectify_left, rectify_right.",
            ),
            click.option(
                "--output",
                type=FolderType(),
                show_default=str(OUTPUT),
                metavar="DIR",
                help="Where the files go.",
            ),
        )
    ):
        command = option(command)
    return command
