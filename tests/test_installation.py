"""What an installation holds, and its command."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import hdl

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    folder = tmp_path_factory.mktemp("installed")
    zipfile.ZipFile(wheel).extractall(folder)
    return folder


def stereo_rectifier(arguments, cwd, *path):
    """The command, with packages from ``path`` alone."""
    return subprocess.run(
        [sys.executable, "-c", "import stereo_rectifier_cli; stereo_rectifier_cli.main()", *arguments.split()],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path)), "PYTHONSAFEPATH": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_wheel_has_every_file_of_the_packages_and_nothing_else(wheel):
    files = [file for folder in ("hdl", "sim") for file in (ROOT / folder).rglob("*") if file.is_file()]
    names = {file.relative_to(ROOT).as_posix() for file in files if file.parent.name != "__pycache__"}
    found = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert {"hdl/report/page.html", "sim/harness.cpp", "hdl/py.typed", "hdl/calibration/opencv_samples.yml"} <= found
    assert found == names | {"stereo_rectifier_cli.py"}


def test_an_installation_generates_and_has_its_version(installed, tmp_path):
    result = stereo_rectifier("generate --size 64x48 --no-lens --datapath proposed --camera left", tmp_path, installed)
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "build/rectify_left.v").exists()
    assert stereo_rectifier("--version", tmp_path, installed).stdout.endswith(f"version {hdl.__version__}\n")


def test_commands_are_listed_and_what_is_none_is_one_line(installed, tmp_path):
    shown = stereo_rectifier("", tmp_path, installed).stdout
    assert all(f" {name} " in shown for name in ("calibration", "generate", "report", "simulate"))
    result = stereo_rectifier("polish", tmp_path, installed)
    assert (result.returncode, result.stdout, result.stderr) == (2, "", "error: No such command 'polish'.\n")


@pytest.mark.parametrize("package", ["hdl", "sim"])
def test_another_package_of_that_name_is_named(installed, tmp_path, package):
    (tmp_path / package).mkdir()
    (tmp_path / package / "__init__.py").touch()
    result = stereo_rectifier("generate", tmp_path, tmp_path, installed)
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == (
        f"error: {tmp_path / package}: hides the package {package} of stereo-rectifier; take it off the PYTHONPATH\n"
    )


def test_a_package_that_another_program_wrote_over_is_said(installed, tmp_path):
    for file in installed.rglob("*.py"):
        copy = tmp_path / "other" / file.relative_to(installed)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(file.read_bytes())
    (tmp_path / "other/hdl/__init__.py").write_text("")
    result = stereo_rectifier("generate", tmp_path, tmp_path / "other")
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr.startswith("error: ") and result.stderr.endswith(
        "; install stereo-rectification-cores anew, in an environment of its own\n"
    )
    assert result.stderr.count("\n") == 1
