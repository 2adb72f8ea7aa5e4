"""Too much line memory: refused before a datapath is fitted, with an option that keeps within it."""

import re

import numpy as np
import pytest

from hdl import calibration
from hdl.cli import run
from hdl.core import build as building
from hdl.core.build import Options, build
from hdl.core.line_memory import LineMemoryError, in_kib, refuse_early
from hdl.generate import generate
from hdl.geometry.coordinates import Border
from hdl.geometry.rectification import rectify

SIZE = 160, 120


def view(lens=True):
    return rectify(calibration.embedded(SIZE), lens=lens)["left"]


def kib(core):
    return core.parameters.line_buffer.bits / 8192


@pytest.fixture
def run_command(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(arguments):
        with pytest.raises(SystemExit) as end:
            run(generate, arguments.split())
        return end.value.code, capsys.readouterr().err

    return call


def test_nothing_is_fitted_where_the_map_alone_is_too_much(monkeypatch):
    def fitted(*_):
        raise AssertionError("a datapath was fitted")

    monkeypatch.setattr(building, "choose", fitted)
    monkeypatch.setattr(building, "fit", fitted)
    for options in (Options(max_line_buffer_kib=1), Options("spline", max_error=0.5, max_line_buffer_kib=1)):
        with pytest.raises(
            LineMemoryError, match=r"^--max-line-buffer-kib: 1: the left camera's map bends rows so far"
        ):
            build(view(), options, "core")
    with pytest.raises(AssertionError, match="a datapath was fitted"):
        build(view(), Options(max_line_buffer_kib=3), "core")


@pytest.mark.parametrize("border", ["constant", "replicate"])
@pytest.mark.parametrize("datapath, lens", [("spline", True), ("polynomial", False), ("proposed", False)])
def test_no_core_is_refused_that_has_as_much_as_it_may(datapath, lens, border):
    one, border = view(lens), Border(border)
    needed = kib(build(one, Options(datapath, max_error=0.07 if lens else None, border=border), "core"))
    enough, less = int(np.ceil(needed)), int(np.ceil(needed)) - 1
    refuse_early(one, Options(datapath, border=border, max_line_buffer_kib=enough))
    # The float map, which is looked at first, may need a row more or less at either end.
    with pytest.raises(LineMemoryError, match=rf"some \d+ rows are needed, |rows are needed, {in_kib(needed)} KiB$"):
        build(one, Options(datapath, max_error=0.07 if lens else None, border=border, max_line_buffer_kib=less), "core")


@pytest.mark.parametrize(
    "arguments, limit",
    [
        ("", 2),
        ("--lens --alpha 1", 2),
        ("--focal 300", 3),
        ("--no-lens --datapath proposed", 1),
        ("--minimise rows", 1),
    ],
)
def test_the_option_that_is_named_helps(run_command, arguments, limit):
    base = f"--size 160x120 --max-error 3 {arguments}"
    status, err = run_command(f"{base} --max-line-buffer-kib {limit}")
    refusal = err.splitlines()[-1]
    assert status == 2 and refusal.startswith(f"error: --max-line-buffer-kib: {limit}: ")
    advice = re.search(r"; (--[^;]*?)(?: in place of (--\w+))? (keeps within it|needs no more than (\d+) KiB)", refusal)
    options, instead, _, more = advice.groups()
    if instead:
        base = re.sub(rf"{instead} \S+", "", base)
    if "--minimise" in options:
        base = base.replace("--minimise rows", "")
    assert run_command(f"{base} {options} --max-line-buffer-kib {more or limit}")[0] == 0


def test_sizes_are_said_in_digits_that_tell_them_apart():
    assert [in_kib(size) for size in (0.19, 1.5, 9.96, 14.6, 1234.5)] == ["0.19", "1.5", "10", "15", "1,234"]
