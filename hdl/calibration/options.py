"""The command line's option about lenses, for every command that reads a calibration."""

import rich_click as click

from hdl.lens import LENS_MODELS

lens_model_option = click.option(
    "--lens-model",
    type=click.Choice(list(LENS_MODELS)),
    metavar="NAME",
    help="The lens of both cameras, where the calibration gives coefficients without saying of what: "
    + ", ".join(LENS_MODELS)
    + ". Without it a guess is made, and said.",
)
