"""The command line: what it writes, and what it says when it cannot."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import rich_click as click

from hdl.calibration import convert, embedded
from hdl.cli import run
from hdl.core.plan import Plan
from hdl.generate import generate
from hdl.tools.synthesis import synthesise


@pytest.fixture
def run_command(capsys):
    """Runs a command line; gives its exit status, standard output and standard error."""

    def call(command, arguments):
        with pytest.raises(SystemExit) as end:
            run(command, arguments.split())
        return end.value.code, *capsys.readouterr()

    return call


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


REST = "up to 64 letters, digits and underscores"


def names(directory):
    return sorted(path.name for path in directory.iterdir())


def test_one_camera_gives_exactly_one_core_and_one_plan(folder, run_command):
    status, _, err = run_command(generate, "--camera left --datapath proposed --top eye --output out --size 64x48")
    assert (status, err) == (0, "")
    assert names(folder / "out") == ["eye.json", "eye.v"]
    assert "module eye(" in (folder / "out/eye.v").read_text()


def test_both_cameras_by_default(folder, run_command):
    run_command(generate, "--datapath proposed --size 64x48")
    assert names(folder / "build") == [f"rectify_{side}.{kind}" for side in ("left", "right") for kind in ("json", "v")]


def test_the_plan_holds_what_it_promises(folder, run_command):
    run_command(generate, "--camera right --datapath accumulate --max-error 0.05 --size 160x120 --output out --top t")
    plan = json.loads((folder / "out/t.json").read_text())
    assert Plan.model_validate(plan).to_json() == (folder / "out/t.json").read_text()
    assert (plan["top"], plan["camera"]["side"], plan["width"], plan["height"]) == ("t", "right", 160, 120)
    assert (plan["datapath"], plan["lens"], plan["max_error_requested"]) == ("accumulate", False, 0.05)
    assert np.shape(plan["camera"]["K"]) == np.shape(plan["rectification"]["R"]) == (3, 3)
    assert np.shape(plan["rectification"]["P"]) == (3, 4)
    assert max(plan["error"][axis]["max"] for axis in "uv") <= 0.05
    assert plan["error"]["euclidean_max"] >= max(plan["error"][axis]["max"] for axis in "uv")
    assert all(re.fullmatch(r"U?Q-?\d+\.-?\d+", text) for text in plan["formats"].values())
    spread = plan["line_buffer"]["d_hi"] - plan["line_buffer"]["d_lo"]
    assert spread < plan["line_buffer"]["rows"] <= spread + 4


@pytest.mark.parametrize("lens", ["--lens", "--no-lens"])
def test_the_plan_says_what_leaving_out_the_lens_drops(folder, run_command, lens):
    _, out, _ = run_command(generate, f"--camera left --size 160x120 --output out --top t {lens}")
    plan = json.loads((folder / "out/t.json").read_text())
    if lens == "--lens":
        assert plan["distortion_dropped"] is None and "lens left out" not in out
        return
    K, R, P = np.array(plan["camera"]["K"]), np.array(plan["rectification"]["R"]), np.array(plan["rectification"]["P"])
    with_lens, without = (
        cv2.initUndistortRectifyMap(K, D, R, P, (160, 120), cv2.CV_32FC1) for D in (np.array(plan["camera"]["D"]), None)
    )
    inside = np.logical_and.reduce([(w >= 0) & (w <= size - 1) for w, size in zip(with_lens, (160, 120))])
    for axis, bent, straight in zip("uv", with_lens, without):
        shift = np.abs(bent - straight)[inside]
        assert plan["distortion_dropped"][axis]["max"] == pytest.approx(shift.max(), abs=1e-3)
        assert plan["distortion_dropped"][axis]["mean"] == pytest.approx(shift.mean(), abs=1e-3)
    assert "lens left out" in out


def test_the_plan_has_the_rows_before_and_after_they_were_minimised(folder, run_command):
    _, _, err = run_command(generate, "--size 160x120 --datapath proposed --minimise rows --output out --top t")
    entries = [json.loads((folder / f"out/t_{side}.json").read_text())["rectification"] for side in ("left", "right")]
    for when in ("before", "after"):
        assert " + ".join(str(entry["minimised"][f"rows_{when}"]) for entry in entries) in err
    assert all(entry["origin"] == "computed, --minimise" and entry["unit"] is None for entry in entries)
    assert all(entry["minimised"]["rows_after"] < entry["minimised"]["rows_before"] for entry in entries)
    assert all(0 <= entry["minimised"]["lost"] <= 0.05 for entry in entries)


def test_auto_says_what_it_considered_and_takes_the_cheapest(folder, run_command):
    status, out, _ = run_command(generate, "--camera left --size 320x240 --output out --top t")
    assert status == 0
    considered = json.loads((folder / "out/t.json").read_text())["considered"]
    assert considered[0]["datapath"] == "spline" and considered[0]["verdict"] == "chosen"
    assert "spline" in out and "chosen" in out


def test_two_runs_write_the_same_bytes(folder, run_command):
    for output in ("a", "b"):
        run_command(generate, f"--camera left --datapath proposed --size 64x48 --output {output}")
    for name in names(folder / "a"):
        assert (folder / "a" / name).read_bytes() == (folder / "b" / name).read_bytes()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ("nothing.yml", "nothing.yml: cannot be read: No such file or directory"),
        ("--size 0x480", "--size: 0x480: width and height must be 32 to 8192"),
        ("--size wide", "--size: wide: must be WIDTHxHEIGHT, for example 640x480"),
        ("--max-error nan", "--max-error: nan: must be a positive number of pixels"),
        (
            "--max-error 0.01",
            "--max-error: 0.01: rounding to 5 fraction bits alone costs up to 0.015625 px; more --fraction-bits help",
        ),
        (
            "--datapath proposed --max-error 0.1",
            "--max-error: 0.1: proposed for the left camera reaches 2.93 px and no less",
        ),
        (
            "--datapath spline --size 64x48",
            "--max-error: 0.05, the default: spline for the left camera reaches 0.069 px and no less",
        ),
        (
            "--max-error 0.0157",
            "--max-error: 0.0157: no datapath meets it for the left camera; conventional comes closest with 0.0158 px",
        ),
        (
            "--channels 3 --pixel-bits 12",
            "--pixel-bits: 12 for --channels 3: 1 channel has 8, 10, 12 or 16 bits, 3 channels have 8 each",
        ),
        ("--border constant:256", "--border: constant:256: does not fit into 8 bits"),
        ("--border mirror", "--border: mirror: must be constant, constant:VALUE or replicate"),
        *(
            (f"--top {word} --camera left", f"--top: {word}: must be a Verilog identifier of {REST}")
            for word in ("2nd", "a-b", "a" * 65)
        ),
        *(
            (
                f"--top {word} --camera left",
                f"--top: {word}: is a keyword of Verilog or SystemVerilog; choose another name",
            )
            for word in ("endmodule", "real", "specify", "class", "logic")
        ),
        ("--camera both", "Invalid value for '--camera': 'both' is not one of 'left', 'right'."),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(folder, run_command, arguments, message):
    before = folder / "build" / "rectify_left.v"
    before.parent.mkdir()
    before.write_text("kept")
    status, out, err = run_command(generate, arguments)
    assert (status, out, err) == (2, "", f"error: {message}\n")
    assert names(folder / "build") == ["rectify_left.v"] and before.read_text() == "kept"


def test_a_lens_is_refused_by_datapaths_that_have_none(folder, run_command):
    status, _, err = run_command(generate, "--datapath proposed --lens")
    assert status == 2
    assert re.fullmatch(r"error: --lens: proposed computes no lens; these do: auto, .*spline.*\n", err)


def test_the_module_runs_as_a_command():
    help_text = subprocess.run(
        [sys.executable, "-m", "hdl.generate", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert "--max-error" in help_text and "--datapath" in help_text


def test_a_yosys_that_fails_shows_its_own_error_line_and_its_log(folder, run_command):
    command = click.Command("broken", callback=lambda: synthesise("module core(;\nendmodule\n", "core", cache=folder))
    status, _, err = run_command(command, "")
    assert status == 1
    log = re.fullmatch(r"error: Yosys: core\.v:1: ERROR: syntax error.* \(log: (\S+)\)\n", err).group(1)
    assert "syntax error" in Path(log).read_text()


SMALL = "--size 64x48 --datapath proposed --camera left"


@pytest.mark.parametrize(
    "arguments, message",
    [
        ("--select left", "--select: left: there is no CALIBRATION to read; the example rig needs none"),
        ("--format kitti", "--format: kitti: there is no CALIBRATION to read; the example rig needs none"),
        (
            "--lens-model radtan",
            "--lens-model: radtan: there is no CALIBRATION to read; the example rig needs none",
        ),
        ("--optimise ff", "--optimise: ff: decides among datapaths; proposed was named already"),
        ("--pipeline fast --clock 100", "--pipeline: fast: --clock chooses the pipeline; give one of the two"),
        ("--clock 0", "--clock: 0.0: must be a positive number of MHz"),
        ("--clock nan", "--clock: nan: must be a positive number of MHz"),
        ("--output=", "--output: an empty name; . is the folder here"),
        (
            f"--border constant:{'9' * 5000}",
            f"--border: constant:{'9' * 68}...: must be constant, constant:VALUE or replicate",
        ),
        ("--border constant:-1", "--border: constant:-1: must be constant, constant:VALUE or replicate"),
        (r"\[/]", r"\[/]: cannot be read: No such file or directory"),
    ],
)
def test_options_without_effect_and_odd_texts_are_refused_in_one_line(folder, run_command, arguments, message):
    assert run_command(generate, f"{SMALL} {arguments}") == (2, "", f"error: {message}\n")
    assert names(folder) == []


def test_the_calibration_is_not_overwritten(folder, run_command):
    rig = convert.to_opencv(embedded((64, 48)), None)
    (folder / "eye.json").write_text(rig)
    status, _, err = run_command(generate, f"eye.json {SMALL} --top eye --output .")
    assert (status, err) == (2, "error: --output: eye.json: is one of the files that are read; choose another name\n")
    assert (folder / "eye.json").read_text() == rig and names(folder) == ["eye.json"]


def test_a_folder_in_the_way_is_named_and_the_old_files_stay(folder, run_command):
    (folder / "out/eye.v").mkdir(parents=True)
    status, _, err = run_command(generate, f"{SMALL} --top eye --output out")
    assert (status, err) == (2, "error: --output: out/eye.v: is a folder\n") and names(folder / "out") == ["eye.v"]


def test_folders_are_printed_as_they_are_named(folder, run_command):
    status, out, _ = run_command(generate, f"{SMALL} --output a[/]b[red]")
    assert status == 0 and "a[/]b[red]" in out


def test_a_lens_that_folds_back_is_warned_of(folder, run_command):
    rig = embedded((64, 48))
    left = replace(rig.left, D=np.array([-1.2, 0, 0, 0, 0]))
    (folder / "rig.yml").write_text(convert.to_opencv(replace(rig, left=left), None))
    _, _, err = run_command(generate, "rig.yml --camera left --output out --max-error 0.5 --alpha 1")
    assert re.search(
        r"note: rig\.yml: D1 = \[-1\.2, .*: the lens folds back in the rectified frame: [\d.]+ % of it", err
    )


def test_a_size_that_stretches_the_images_is_warned_of(folder, run_command):
    _, _, err = run_command(generate, "--size 96x48 --datapath proposed --camera left --output out")
    assert err.startswith("note: --size: 96x48: stretches the 640x480 images by 50 %; where a sensor crops them ")
