"""The simulation command: its own pictures and the user's, cores built for it and those of a folder."""

import json
import re

import cv2
import numpy as np
import pytest

from hdl.calibration import embedded
from hdl.cli import run
from hdl.generate import generate
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


def names(directory):
    return sorted(path.name for path in directory.iterdir())


SMALL = "--size 64x48 --datapath proposed"


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


def test_simulation_runs_the_cores_of_a_folder_as_they_are(folder, run_command):
    run_command(generate, "--size 64x48 --datapath proposed --output rtl --top mine")
    before = {file.name: file.read_bytes() for file in (folder / "rtl").iterdir()}
    status, out, err = run_command(simulate, "--cores rtl --output pictures --json")
    assert (status, err) == (0, "")
    cameras = json.loads(out)["cameras"]
    assert {camera["verilog"] for camera in cameras.values()} == {"rtl/mine_left.v", "rtl/mine_right.v"}
    assert {side: camera["plan"]["top"] for side, camera in cameras.items()} == {
        "left": "mine_left",
        "right": "mine_right",
    }
    assert all(camera["pixels_different_from_model"] == 0 for camera in cameras.values())
    assert {file.name: file.read_bytes() for file in (folder / "rtl").iterdir()} == before
    assert not (folder / "pictures/mine_left.v").exists()
    # Without --output all goes beside the cores.
    (folder / "build").write_text("where nothing goes")
    status, out, err = run_command(simulate, "--cores rtl")
    assert (status, err) == (0, "") and names(folder) == ["build", "pictures", "rtl"]
    listed = [line.split()[-1] for line in out.splitlines() if line.endswith((".v", ".png"))]
    assert sorted(listed) == sorted(f"rtl/{name}" for name in names(folder / "rtl") if name.endswith((".v", ".png")))
    assert len(listed) == 8


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
    assert (status, err) == (0, "") and rows["after"]["n"] >= 30
    assert rows["after"]["mean"] < 0.3 < 3 < rows["before"]["mean"]
    cv2.imwrite("moved.png", np.roll(pair["right"], 5, axis=0))
    _, _, err = run_command(simulate, arguments.format("left.png", "moved.png"))
    assert re.match(
        r"note: left\.png, moved\.png: rows of matched points still differ by \d\.\d px on average; is the", err
    )


def noise(name, size=(64, 48), values=256, dtype=np.uint8):
    """An image of so many px, of values up to so many."""
    assert cv2.imwrite(name, np.random.default_rng(0).integers(0, values, size[::-1]).astype(dtype))
    return name


@pytest.mark.parametrize(
    "image, refusal",
    [
        ({"size": (96, 72)}, r"the cores take 64x48; (--size 96x72) scales the calibration"),
        ({"values": 4096, "dtype": np.uint16}, r"do not fit 8 bits; (--pixel-bits 12) does"),
    ],
    ids=["size", "bits"],
)
def test_the_option_that_a_refused_image_needs_helps(folder, run_command, image, refusal):
    noise("L.png", **image)
    arguments = f"{SMALL} --left L.png --right L.png --output out"
    status, out, err = run_command(simulate, arguments)
    found = re.search(refusal, err)
    assert (status, out, err.count("\n")) == (2, "", 1) and names(folder) == ["L.png"]
    assert run_command(simulate, f"{arguments} {found[1]}")[0] == 0
    # Cores that are there already must be generated anew.
    run_command(generate, f"{SMALL} --output rtl")
    status, _, err = run_command(simulate, "--cores rtl --left L.png --right L.png")
    assert status == 2 and f"generate {'them' if 'size' in found[1] else 'the cores'} with {found[1]}\n" in err
    run_command(generate, f"{SMALL} {found[1]} --output rtl")
    assert run_command(simulate, "--cores rtl --left L.png --right L.png")[0] == 0


def test_16_bits_that_hold_8_give_no_pixel_unlike_cv2s(folder, run_command):
    for side in "LR":
        noise(f"{side}8.png")
        noise(f"{side}16.png", dtype=np.uint16)
    results = []
    for bits in (8, 16):
        images = f"--left L{bits}.png --right R{bits}.png"
        status, out, _ = run_command(simulate, f"{SMALL} {images} --output out --json")
        results.append([camera["pixels_different_from_cv2_remap"] for camera in json.loads(out)["cameras"].values()])
        assert status == 0
    assert results == [[0, 0], [0, 0]]


def test_images_that_bear_no_figure_are_given_none(folder, run_command):
    noise("L.png")
    status, out, err = run_command(simulate, f"{SMALL} --left L.png --right L.png --output out")
    assert status == 0 and err.endswith("note: L.png, L.png: the two images are the same\n")
    assert "How far rows differ cannot be said: the two images are the same." in " ".join(out.split())
    status, out, _ = run_command(simulate, f"{SMALL} --left L.png --right L.png --output out --json")
    found = json.loads(out)
    assert found["row_difference"] is None and found["row_difference_withheld"] == "the two images are the same"
