"""How the house is built: which floor may know of which, and how large a file may grow."""

import ast
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


def unnamed_signals(text):
    """Lines of several assignments at once whose last value is a signal without a name: Amaranth finds one in the code
    of Python up to 3.12, and none in that of 3.13, and the Verilog would be another."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Assign) or len(node.targets) == 1 and not isinstance(node.targets[0], ast.Tuple):
            continue
        last = node.value.elts[-1] if isinstance(node.value, ast.Tuple) else node.value
        if isinstance(last, ast.Call) and "Signal" in ast.unparse(last.func):
            if not any(keyword.arg == "name" for keyword in last.keywords):
                yield node.lineno


def test_signals_have_names_that_do_not_depend_on_the_version_of_python():
    files = [file for folder in ("hdl", "sim", "examples") for file in (ROOT / folder).rglob("*.py")]
    assert {str(file): lines for file in files if (lines := list(unnamed_signals(file.read_text())))} == {}
    text = "a = Signal()\na, b = Signal(), Signal(3)\na, b = 1, Signal.like(a, name='b')\n"
    assert list(unnamed_signals(text)) == [2]
    assert list(unnamed_signals("a = b = Signal()\n")) == [1]


@pytest.mark.parametrize("folder", ["hdl", "sim", "scripts", "tests", "examples"])
def test_no_file_is_longer_than_a_reader_likes(folder):
    lengths = {
        str(file.relative_to(ROOT)): len(file.read_text().splitlines()) for file in (ROOT / folder).rglob("*.py")
    }
    assert lengths
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST and name not in DATA} == {}
