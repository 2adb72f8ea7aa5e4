"""``stereo-rectifier``: the project's commands in one, as an installation has it.

Nobody else has a module of this name. There may be another `hdl` or `sim`, and then this one says so.
"""

import importlib
import importlib.util
import sys
from pathlib import Path


def main(arguments: list[str] | None = None) -> None:
    """Run the command and exit; ``arguments``: by default the process's own."""
    for package in ("hdl", "sim"):
        place = _place(package)
        if place != Path(__file__).resolve().parent / package:
            sys.exit(f"error: {place}: hides the package {package} of stereo-rectifier; take it off the PYTHONPATH")
    try:
        import hdl

        hdl.exit_when_interrupted()
        import rich_click as click

        from hdl import cli
    except (ImportError, AttributeError) as error:
        sys.exit(f"error: {error}; install stereo-rectification-cores anew, in an environment of its own")

    class Commands(click.RichGroup):
        """Imports what it runs."""

        COMMANDS = {
            "calibration": ("hdl.calibration.__main__", "describe"),
            "generate": ("hdl.generate", "generate"),
            "report": ("hdl.report.__main__", "report"),
            "simulate": ("sim.run", "simulate"),
        }

        def list_commands(self, ctx: click.Context) -> list[str]:
            return list(self.COMMANDS)

        def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
            if cmd_name not in self.COMMANDS:
                return None
            module, name = self.COMMANDS[cmd_name]
            command: click.Command = getattr(importlib.import_module(module), name)
            return command

    @click.group(cls=Commands, invoke_without_command=True)
    @click.version_option(hdl.__version__)
    @click.pass_context
    def commands(ctx: click.Context) -> None:
        """From a stereo calibration to streaming rectification cores in Verilog."""
        if not ctx.invoked_subcommand:
            click.echo(ctx.get_help())

    cli.run(commands, arguments)


def _place(package: str) -> Path | None:
    """Where a package would be imported from; None for nowhere."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        return None
    places = spec.submodule_search_locations
    return Path(places[0] if places else spec.origin or "").resolve()


if __name__ == "__main__":
    main()
