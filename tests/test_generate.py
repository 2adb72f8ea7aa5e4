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
from sim.run import simulate
from sim.scene import render


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
            "--datapath proposed --max-line-buffer-kib 1",
            "--max-line-buffer-kib: 1: the left camera's map bends rows so far that 24 rows are needed, 15 KiB",
        ),
        (
            "--channels 3 --pixel-bits 12",
            "--pixel-bits: 12 for --channels 3: 1 channel has 8, 10, 12 or 16 bits, 3 channels have 8 each",
        ),
        ("--border constant:256", "--border: constant:256: does not fit into 8 bits"),
        ("--border mirror", "--border: mirror: must be constant, constant:VALUE or replicate"),
        *(
            (f"--top {word} --camera left", f"--top: {word}: must be a Verilog identifier of {REST}")
            for word in ("endmodule", "real", "specify", "class", "2nd", "a-b", "a" * 65)
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


def test_simulation_finds_every_pixel_right_and_writes_pictures(folder, run_command):
    status, out, err = run_command(simulate, "--size 160x120 --output out --json")
    assert (status, err) == (0, "")
    result = json.loads(out)
    for camera in result["cameras"].values():
        assert camera["pixels_different_from_model"] == camera["pixels_different_from_cv2_remap"] == 0
    assert result["row_difference"]["after"]["mean"] < 0.05 < 1 < result["row_difference"]["before"]["mean"]
    for name in ("left_rectified", "right_rectified", "epipolar_source", "epipolar_rectified"):
        assert (folder / result["pictures"][name]).stat().st_size > 1000


def test_simulation_needs_both_images_of_the_right_size(folder, run_command):
    cv2.imwrite("small.png", np.zeros((10, 20), np.uint8))
    (folder / "text.png").write_text("no image")
    assert run_command(simulate, "--left small.png")[2] == "error: --right: give both images or neither\n"
    assert run_command(simulate, "--left small.png --right small.png")[2] == (
        "error: small.png: size = 20x10: the cores take 640x480\n"
    )
    assert run_command(simulate, "--left text.png --right text.png")[2] == (
        "error: text.png: is not an image that OpenCV can read\n"
    )


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
        ("--optimise lut", "--optimise: lut: decides among datapaths; proposed was named already"),
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


def test_simulation_keeps_its_inputs_and_refuses_half_an_image(folder, run_command):
    image = np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8)
    for name in ("left_source.png", "whole.jpg", "half.jpg"):
        cv2.imwrite(name, image)
    half = (folder / "half.jpg").read_bytes()
    (folder / "half.jpg").write_bytes(half[: len(half) // 2])
    before = (folder / "left_source.png").read_bytes()
    arguments = "--size 64x48 --datapath proposed --left {} --right whole.jpg --output ."
    assert run_command(simulate, arguments.format("left_source.png"))[2] == (
        "error: --output: left_source.png: is one of the files that are read; choose another name\n"
    )
    assert (folder / "left_source.png").read_bytes() == before
    assert "half.jpg: ends in the middle of the image" in run_command(simulate, arguments.format("half.jpg"))[2]
    cv2.imwrite("float.tiff", image.astype(np.float32))
    assert run_command(simulate, arguments.format("float.tiff"))[2] == (
        "error: float.tiff: pixels = float32: 8 or 16 bits without a sign are needed\n"
    )


def test_simulation_runs_the_cores_of_a_folder_as_they_are(folder, run_command):
    run_command(generate, "--size 64x48 --datapath proposed --output rtl --top mine")
    before = {file.name: file.read_bytes() for file in (folder / "rtl").iterdir()}
    status, out, err = run_command(simulate, "--cores rtl --output pictures --json")
    assert (status, err) == (0, "")
    cameras = json.loads(out)["cameras"]
    assert {side: camera["plan"]["top"] for side, camera in cameras.items()} == {
        "left": "mine_left",
        "right": "mine_right",
    }
    assert all(camera["pixels_different_from_model"] == 0 for camera in cameras.values())
    assert {file.name: file.read_bytes() for file in (folder / "rtl").iterdir()} == before
    assert not (folder / "pictures/mine_left.v").exists()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ("--cores rtl --datapath spline", "--cores: rtl: the cores are built already: --datapath cannot change them"),
        ("--cores rtl rig.yml", "--cores: rtl: the cores are built already: calibrations cannot change them"),
        ("--cores rtl", "--cores: rtl: has no core for the right camera"),
        ("--cores nothing", "nothing: there is no such folder"),
    ],
)
def test_cores_to_simulate_are_both_there_and_not_to_be_changed(folder, run_command, arguments, message):
    run_command(generate, "--size 64x48 --datapath proposed --output rtl --camera left")
    assert run_command(simulate, arguments)[::2] == (2, f"error: {message}\n")


def test_simulation_says_which_cores_it_replaces(folder, run_command):
    run_command(generate, "--size 64x48 --datapath proposed --output out")
    _, _, err = run_command(simulate, "--size 64x48 --datapath proposed --output out")
    assert err == ""
    _, _, err = run_command(simulate, "--size 64x48 --datapath accumulate --output out")
    assert err == "".join(
        f"note: out/rectify_{side}.json: replaced, and its Verilog; --cores out runs the cores that are there\n"
        for side in ("left", "right")
    )


def test_simulation_measures_rows_of_matched_points_in_ones_own_images(folder, run_command):
    size = (320, 240)
    pair = render(embedded(size), lens=True)
    for side, image in pair.items():
        cv2.imwrite(f"{side}.png", image)
    arguments = "--size 320x240 --output out --json --left {} --right {}"
    status, out, err = run_command(simulate, arguments.format("left.png", "right.png"))
    rows = json.loads(out)["row_difference"]
    assert (status, err) == (0, "") and rows["after"]["n"] > 50
    assert rows["after"]["mean"] < 0.3 < 3 < rows["before"]["mean"]
    cv2.imwrite("moved.png", np.roll(pair["right"], 5, axis=0))
    _, _, err = run_command(simulate, arguments.format("left.png", "moved.png"))
    assert re.match(
        r"note: left\.png, moved\.png: rows of matched points still differ by \d\.\d px on average; is the", err
    )
