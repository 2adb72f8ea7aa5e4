"""How the house is built: which floor may know of which, and how large a file may grow."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 350  # lines
# Numbers, not code.
DATA = {"tests/rig_numbers.py"}


def lint_imports(folder):
    return subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_each_floor_imports_only_from_those_below_it():
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr


def test_an_import_from_a_floor_above_is_found(tmp_path):
    for name in ("pyproject.toml", "hdl"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "hdl").unlink()
    for file in (ROOT / "hdl").rglob("*.py"):
        copy = tmp_path / file.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(file.read_text())
    with (tmp_path / "hdl/arithmetic/fixedpoint.py").open("a") as file:
        file.write("\nimport hdl.core.plan\n")
    result = lint_imports(tmp_path)
    assert result.returncode == 1
    assert "hdl.arithmetic.fixedpoint -> hdl.core.plan" in result.stdout


@pytest.mark.parametrize("folder", ["hdl", "sim", "scripts", "tests", "examples"])
def test_no_file_is_longer_than_a_reader_likes(folder):
    lengths = {
        str(file.relative_to(ROOT)): len(file.read_text().splitlines()) for file in (ROOT / folder).rglob("*.py")
    }
    assert lengths
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST and name not in DATA} == {}
