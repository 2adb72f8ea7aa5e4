"""The command line's options about the rectified view and the border."""

import rich_click as click

from hdl.errors import InputError
from hdl.geometry.choices import MAX_FOV_LOSS
from hdl.geometry.coordinates import Border


class CenterType(click.ParamType):
    """X,Y in px."""

    name = "X,Y"

    def convert(self, value, param, ctx):
        if not isinstance(value, str):
            return value
        try:
            x, y = (float(part) for part in value.split(","))
        except ValueError:
            raise InputError("--center", None, value, "must be X,Y in px, for example 319.5,239.5") from None
        return x, y


class BorderType(click.ParamType):
    """constant, constant:VALUE or replicate."""

    name = "constant[:V]|replicate"

    def convert(self, value, param, ctx):
        return value if isinstance(value, Border) else Border.parse(value)


def rectification_options(command):
    """The options of a command that rectifies; together they are the arguments of `hdl.geometry.rectification`'s
    RectificationOptions."""
    for option in reversed(
        (
            click.option(
                "--alpha",
                type=float,
                metavar="A",
                help="cv2.stereoRectify's alpha: 0 shows valid pixels only, 1 all source pixels. Default: 0. With "
                "any of --alpha, --focal, --fov, --center a rectification in the file is not used.",
            ),
            click.option("--focal", type=float, metavar="PX", help="Focal length of the rectified views."),
            click.option("--fov", type=float, metavar="DEG", help="Horizontal field of view, in place of --focal."),
            click.option("--center", type=CenterType(), help="Principal point of both rectified views, px."),
            click.option(
                "--minimise",
                type=click.Choice(["rows"]),
                help="Choose what is left free (rotation about the baseline, row of the principal point, focal "
                "length) so that the line buffers have the fewest rows.",
            ),
            click.option(
                "--max-fov-loss",
                type=float,
                metavar="SHARE",
                help="Field of view, filled frame or focal length that --minimise may give up. "
                f"Default: {MAX_FOV_LOSS:g}.",
            ),
        )
    ):
        command = option(command)
    return command
