"""Where results cannot be written is said before they are computed, by every command and script."""

import shutil
from pathlib import Path

import pytest
from report_pages import write_cores

from hdl import cli
from hdl.calibration import convert, embedded
from hdl.calibration.__main__ import describe
from hdl.core.build import Options
from hdl.generate import generate
from hdl.report.__main__ import report
from scripts import (
    clock,
    cost_model,
    figure5,
    growth,
    minimise_rows,
    picture,
    readme,
    reference_cores,
    resources,
    row_difference,
    table1,
)
from sim.run import simulate


@pytest.fixture(scope="module")
def cores(tmp_path_factory):
    return write_cores(tmp_path_factory.mktemp("cores"), Options("proposed"), size=(64, 48), lens=False)


@pytest.fixture
def run_command(cores, capsys, tmp_path, monkeypatch):
    """Runs a command in a folder with a file, `file`, and a calibration; any work that it begins fails the test."""
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("kept")
    shutil.copytree(cores, "cores")
    Path("rig.yml").write_text(convert.to_opencv(embedded((64, 48))))

    def begun(*arguments, **options):
        raise AssertionError("work was begun")

    for name in (
        "hdl.calibration.load",
        "hdl.calibration.embedded",
        "hdl.report.__main__.measure",
        "sim.run.stereo_rig",
        "scripts.reference_rigs.load",
        "scripts.figure5.pairs",
        "scripts.cost_model.measure",
    ):
        monkeypatch.setattr(name, begun)

    def call(command, arguments):
        with pytest.raises(SystemExit) as end:
            cli.run(command, arguments.split())
        return end.value.code, capsys.readouterr().err

    return call


IN_THE_WAY = "file/x: file is no folder"
PROC = "no file can be made in /proc: No such file or directory"


@pytest.mark.parametrize(
    "command, arguments, message",
    [
        (generate, "rig.yml --output file", "--output: file: file is no folder"),
        (generate, "rig.yml --output file/x", f"--output: {IN_THE_WAY}"),
        (generate, "rig.yml --output /proc/x", f"--output: /proc/x: {PROC}"),
        (generate, "rig.yml --output . --top folder", "--output: folder_left.v: is a folder"),
        (simulate, "rig.yml --output /proc/x", f"--output: /proc/x: {PROC}"),
        (simulate, "rig.yml --output taken", "--output: taken/cache: taken/cache is no folder"),
        (simulate, "rig.yml --output . --top folder", "--output: folder_left.v: is a folder"),
        (simulate, "--cores cores --output file/x", f"--output: {IN_THE_WAY}"),
        (describe, "rig.yml --convert file/x.yml", "--convert: file/x.yml: file is no folder"),
        (describe, "rig.yml --convert x.foo", "--convert: x.foo: the name must end in .yml or .yaml"),
        (describe, "rig.yml --convert /proc/x.yml", f"--convert: /proc/x.yml: {PROC}"),
        (report, "cores --output file/x", f"--output: {IN_THE_WAY}"),
        (report, "cores --output cores", "--output: cores: is a folder"),
        (report, "cores --json /proc/x", f"--json: /proc/x: {PROC}"),
        (report, "cores --json=", "--json: an empty name"),
        (growth.growth, "--plot x.foo", "--plot: x.foo: the name must end in .svg, .png, .pdf, .eps or .ps"),
        (growth.growth, "--plot file/x.svg", "--plot: file/x.svg: file is no folder"),
        (growth.growth, "--cache file/x", f"--cache: {IN_THE_WAY}"),
        (picture.picture, "--output x.xyz", "--output: x.xyz: the name must end in .jpg or .jpeg"),
        (picture.picture, "--output /proc/x.jpg", f"--output: /proc/x.jpg: {PROC}"),
        (figure5.figure5, "--output file/x", f"--output: {IN_THE_WAY}"),
        (resources.resources, "--readme", "--readme: folder: is a folder"),
        (table1.table1, "--readme", "--readme: folder: is a folder"),
        (clock.clock, "--readme", "--readme: folder: is a folder"),
        *(
            (script, "--json file/x", f"--json: {IN_THE_WAY}")
            for script in (
                clock.clock,
                cost_model.cost_model,
                figure5.figure5,
                growth.growth,
                minimise_rows.minimise_rows,
                reference_cores.reference_cores,
                resources.resources,
                row_difference.row_difference,
                table1.table1,
            )
        ),
    ],
    ids=lambda value: getattr(value, "name", value if isinstance(value, str) else None),
)
def test_what_cannot_be_written_is_refused_before_the_work(run_command, monkeypatch, command, arguments, message):
    for name in ("folder", "folder_left.v", "taken"):
        Path(name).mkdir()
    Path("taken/cache").touch()
    monkeypatch.setattr(readme, "README", Path("folder"))
    assert run_command(command, arguments) == (2, f"error: {message}\n")
    assert Path("file").read_text() == "kept"
