"""``python -m hdl.calibration``: what it says is what the rig is, and what it converts reads back the same."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from calibration_files import EXTRINSICS, INTRINSICS, RECTIFICATION, RIG, as_yaml, write

from hdl import cli
from hdl.calibration import SIDES, convert, embedded, load
from hdl.calibration.__main__ import describe
from hdl.errors import InputError
from hdl.geometry.notes import row_disagreement
from hdl.geometry.rectification import RectificationOptions, rectify
from scripts import reference_rigs

needs_rigs = pytest.mark.skipif(
    not reference_rigs.FOLDER.is_dir(), reason="the reference data, ../shared/data, is not here"
)
SIZE = {"image_width": 160, "image_height": 120}
SMALL = {
    **SIZE,
    "M1": (3, 3, ["125.5", "0.", "80.25", "0.", "125.25", "60.125", "0.", "0.", "1."]),
    "D1": RIG["D1"],
    "M2": (3, 3, ["124.5", "0.", "79.5", "0.", "124.75", "59.5", "0.", "0.", "1."]),
    "D2": RIG["D2"],
    "R": RIG["R"],
    "T": RIG["T"],
}
OWN = SMALL | {
    name: (rows, cols, [str(float(number) / 4) for number in data[:8]] + data[8:]) if name in ("P1", "P2") else given
    for name, given in RECTIFICATION.items()
    for rows, cols, data in [given]
}


@pytest.fixture(autouse=True)
def in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")


@pytest.fixture
def command(monkeypatch, capsys):
    """Runs the command as the shell does: (exit status, stdout, stderr)."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["hdl.calibration", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.run(describe)
        captured = capsys.readouterr()
        return ended.value.code, captured.out, captured.err

    return run


def same(rig, other):
    """The numbers of both, to the last bit; the rotation as near as loading finds the rotation nearest to it."""
    for side in SIDES:
        camera, its = rig.camera(side), other.camera(side)
        assert camera.model == its.model
        assert np.array_equal(camera.K, its.K) and np.array_equal(camera.D, its.D)
    assert np.array_equal(rig.T, other.T)
    assert np.abs(rig.R - other.R).max() < 1e-15
    assert (rig.width, rig.height, rig.unit) == (other.width, other.height, other.unit)
    assert (rig.rectification is None) == (other.rectification is None)
    for side in rig.rectification or ():
        for matrix, its in zip(rig.rectification[side], other.rectification[side]):
            assert np.array_equal(matrix, its)


def as_opencv_reads(path):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    return {name: storage.getNode(name).mat() for name in ("M1", "D1", "M2", "D2", "R", "T", "R1", "P1", "R2", "P2")}


@pytest.mark.parametrize("fields", [SMALL, OWN], ids=["computed", "own rectification"])
def test_json_is_the_rig_and_the_rows_of_its_maps(fields, command):
    status, out, err = command(write(as_yaml(fields)), "--json")
    assert (status, err) == (0, "")
    rig, content = load("rig.yml"), json.loads(out)
    assert list(content) == ["width", "height", "left", "right", "R", "T", "unit", "rectification", "rows", "warnings"]
    assert (content["width"], content["height"], content["unit"]) == (160, 120, None)
    assert content["R"] == rig.R.tolist() and content["T"] == rig.T.tolist()
    views = {lens: rectify(rig, lens=lens) for lens in (True, False)}
    for side in SIDES:
        camera = rig.camera(side)
        assert content[side] == {
            "source": "M1 of rig.yml" if side == "left" else "M2 of rig.yml", "width": 160, "height": 120,
            "model": camera.model, "K": camera.K.tolist(), "D": camera.D.tolist(),
        }  # fmt: skip
        view = views[True][side]
        assert content["rectification"][side] == {"R": view.R.tolist(), "P": view.P.tolist()}
        assert content["rows"][side] == {
            "lens": view.window.rows, "no_lens": views[False][side].window.rows
        }  # fmt: skip
    assert content["warnings"] == list(rig.warnings)


def test_lens_without_a_name_is_that_of_the_option(command):
    four = (1, 4, ["-0.013", "-0.005", "0.006", "-0.003"])
    path = write(as_yaml(SMALL | {"D1": four, "D2": four}))
    guessed, radtan = (json.loads(command(path, "--json", *more)[1]) for more in ((), ("--lens-model", "radtan")))
    assert (guessed["left"]["model"], radtan["left"]["model"]) == ("equidistant", "radtan")
    assert "--lens-model radtan if they are k1, k2, p1, p2" in guessed["warnings"][0]
    assert not [line for line in radtan["warnings"] if "lens" in line]
    status, out, err = command(path, "--lens-model", "rational-polynomial")
    assert (status, out, err.count("\n")) == (2, "", 1) and "--lens-model" in err
    status, out, err = command(write(as_yaml(SMALL)), "--lens-model", "equidistant")
    message = "--lens-model: equidistant: rig.yml: D1 has 5 coefficients, and such a lens 4"
    assert (status, out, err) == (2, "", f"error: {message}\n")


def test_table_says_what_was_understood(command):
    status, out, err = command(write(as_yaml(SMALL)))
    assert (status, err) == (0, "")
    lines = [" ".join(line.replace("│", " ").split()) for line in out.splitlines()]
    views = list(rectify(load("rig.yml"), lens=True).values())
    left, right = (view.window.rows for view in views)
    f = views[0].P[0, 0]
    for expected in (
        "rig.yml",
        "format OpenCV FileStorage (YAML, XML, JSON)",
        "images 160x120 px",
        "baseline 100.012 (the file does not say of what)",
        "T, x_right = R x_left + T -100, 1.5, -0.5",
        "angle between the cameras 1.146 degrees",
        "rectification computed, default",
        "focal length x, y 125.500, 125.250 px 124.500, 124.750 px",
        "lens radtan radtan",
        "lens coefficients k1 -0.25 k1 -0.26",
        "p2 -0.0005 p2 0.0002",
        "k3 0.01",
        f"rectified focal length {f:.3f} px {f:.3f} px",
        f"rows, with the lens {left} rows {right} rows",
    ):
        assert expected in lines
    filled = " ".join(f"{100 * view.inside.mean():.2f} %" for view in views)
    assert f"filled, with the lens {filled}" in lines
    assert not any("warning" in line for line in lines)


def test_unit_is_converted_too():
    rig = replace(load(write(as_yaml(SMALL))), unit="m")
    convert.write(Path("out.yml"), convert.to_opencv(rig))
    same(rig, load("out.yml"))


def test_own_rectification_is_told_and_put_aside_when_another_is_chosen(command):
    write(as_yaml(OWN))
    assert "the file's own" in command("rig.yml")[1]
    status, out, _ = command("rig.yml", "--focal", "110", "--center", "79.5,59.5")
    assert status == 0
    assert "computed, --focal, --center" in out
    assert "note: rig.yml: the rectification in the file is not used as it stands, because of --focal, --center" in out
    content = json.loads(command("rig.yml", "--focal", "110", "--center", "79.5,59.5", "--json")[1])
    assert content["rectification"]["right"]["P"][0][:3] == [110, 0, 79.5]


def test_warnings_are_in_the_table_and_in_json(command):
    far = SMALL | {"M1": (3, 3, ["125.5", "0.", "30.", "0.", "125.25", "60.125", "0.", "0.", "1."])}
    status, out, err = command(write(as_yaml(far)))
    assert (status, err) == (0, "")
    (line,) = [line for line in out.splitlines() if line.startswith("warning: ")]
    assert line.startswith("warning: rig.yml: M1 = cx 30: ")
    assert json.loads(command("rig.yml", "--json")[1])["warnings"] == [line.removeprefix("warning: ")]


def test_size_scales_and_format_forces(command):
    write(as_yaml(SMALL))
    content = json.loads(command("rig.yml", "--size", "320x240", "--json")[1])
    assert (content["width"], content["height"]) == (320, 240)
    assert content["left"]["K"][0] == [251.0, 0.0, 161.0]
    assert command("rig.yml", "--format", "opencv", "--json")[0] == 0
    status, out, err = command("rig.yml", "--format", "euroc")
    assert (status, out) == (2, "")
    assert err.startswith("error: rig.yml: ") and err.count("\n") == 1


def test_selection_where_there_is_none_to_make_is_refused(command):
    status, out, err = command(write(as_yaml(SMALL)), "--select", "1,2")
    assert (status, out) == (2, "")
    assert err.startswith("error: --select: 1,2: ") and err.count("\n") == 1


def test_two_files_are_one_rig(command):
    write(as_yaml(SIZE | {name: SMALL[name] for name in INTRINSICS}), "intrinsics.yml")
    write(as_yaml({name: SMALL[name] for name in EXTRINSICS}), "extrinsics.yml")
    status, out, _ = command("extrinsics.yml", "intrinsics.yml", "--json")
    assert status == 0
    assert json.loads(out)["T"] == [-100.0, 1.5, -0.5]


@pytest.mark.parametrize("fields", [SMALL, OWN], ids=["without rectification", "with rectification"])
@pytest.mark.parametrize("lens", ["model: equidistant\n", ""])
def test_converted_file_reads_back_the_same_here_and_in_opencv(fields, lens, command):
    if lens:
        four = (1, 4, ["-0.0135", "-0.0323", "5.3e-2", "-3.67e-02"])
        fields = fields | {"D1": four, "D2": four}
    status, out, _ = command(write(as_yaml(fields) + lens), "--convert", "out.yml")
    assert status == 0 and out.endswith("Written to out.yml\n")
    rig = load("rig.yml")
    same(rig, load("out.yml"))
    expected = {"M1": rig.left.K, "D1": rig.left.D, "M2": rig.right.K, "D2": rig.right.D, "R": rig.R, "T": rig.T}
    if rig.rectification:
        (R1, P1), (R2, P2) = (rig.rectification[side] for side in SIDES)
        expected |= {"R1": R1, "P1": P1, "R2": R2, "P2": P2}
    for name, matrix in as_opencv_reads("out.yml").items():
        assert (matrix is None) == (name not in expected)
        assert matrix is None or np.array_equal(matrix.ravel(), expected[name].ravel())
    assert sorted(path.name for path in Path().iterdir()) == ["out.yml", "rig.yml"]


def test_numbers_of_any_magnitude_keep_their_last_bit():
    numbers = [1e-300, -5e-324, 1.7976931348623157e308, 1 / 3, -0.0, 123456789012345680.0, 1e22, 1e-5, 4.0]
    rig = replace(embedded(), T=np.array(numbers[:3]), R=np.array(numbers).reshape(3, 3))
    Path("odd.yml").write_text(convert.to_opencv(rig))
    read = as_opencv_reads("odd.yml")
    assert read["R"].ravel().tolist() == numbers and read["T"].ravel().tolist() == numbers[:3]


def test_chosen_rectification_is_converted_too(command):
    write(as_yaml(SMALL))
    status, out, _ = command("rig.yml", "--minimise", "rows", "--convert", "out.yml")
    assert status == 0 and "note: --minimise rows: line buffers of " in out
    rows = json.loads(command("out.yml", "--json")[1])["rows"]
    before = json.loads(command("rig.yml", "--json")[1])["rows"]
    options = RectificationOptions(minimise="rows")
    rig = load("rig.yml")
    for side, view in rectify(rig, options, lens=True).items():
        assert rows[side]["lens"] == view.window.rows
    assert sum(rows[side]["lens"] for side in SIDES) < sum(before[side]["lens"] for side in SIDES)
    converted = load("out.yml")
    assert converted.rectification and not converted.warnings
    assert row_disagreement(converted, rectify(converted, lens=True)) < 1e-6


@pytest.mark.parametrize(
    "target, message",
    [
        ("out.json", "--convert: out.json: the name must end in .yml or .yaml"),
        ("rig.yml", "--convert: rig.yml: is one of the files that are read; choose another name"),
    ],
)
def test_conversion_to_an_unsuitable_name_is_refused(target, message, command):
    text = as_yaml(SMALL)
    status, out, err = command(write(text), "--convert", target)
    assert (status, out, err) == (2, "", f"error: {message}\n")
    assert [path.name for path in Path().iterdir()] == ["rig.yml"]
    assert Path("rig.yml").read_text() == text


def test_conversion_that_fails_leaves_what_was_there(command, monkeypatch):
    def full(self, data):
        with self.open("wb") as file:
            file.write(data[:20])
        raise OSError(28, "No space left on device")

    write(as_yaml(SMALL))
    write("before", "out.yml")
    monkeypatch.setattr(Path, "write_bytes", full)
    status, _, err = command("rig.yml", "--convert", "out.yml")
    assert status == 2 and "No space left on device" in err and err.count("\n") == 1
    assert Path("out.yml").read_text() == "before"
    assert sorted(path.name for path in Path().iterdir()) == ["out.yml", "rig.yml"]


def test_conversion_makes_the_folder_that_it_is_to_go_to_unless_a_file_is_there(command):
    status, _, err = command(write(as_yaml(SMALL)), "--convert", "new/out.yml")
    assert (status, err) == (0, "") and Path("new/out.yml").exists()
    status, _, err = command("rig.yml", "--convert", "rig.yml/out.yml")
    assert (status, err) == (2, "error: --convert: rig.yml/out.yml: rig.yml is no folder\n")


def test_lenses_of_two_kinds_do_not_fit_into_opencvs_format():
    rig = embedded()
    mixed = replace(rig, right=replace(rig.right, model="equidistant", D=np.zeros(4)))
    with pytest.raises(InputError) as caught:
        convert.to_opencv(mixed)
    assert str(caught.value) == (
        "opencv_samples.yml: lens models = radtan, equidistant: OpenCV's format holds one kind for both cameras"
    )


@pytest.mark.parametrize(
    "arguments, message",
    [
        ([], "error: Missing argument 'FILE...'."),
        (["missing.yml"], "error: missing.yml: cannot be read: No such file or directory"),
        (["rig.yml", "--alpha", "2"], "error: --alpha: 2.0: a number from 0 to 1 is needed"),
        (["rig.yml", "--center", "80"], "error: --center: 80: must be X,Y in px, for example 319.5,239.5"),
        (["rig.yml", "--center", "x,y"], "error: --center: x,y: must be X,Y in px, for example 319.5,239.5"),
    ],
    ids=str,
)
def test_errors_are_one_line_with_exit_status_2(arguments, message, command):
    write(as_yaml(SMALL))
    assert command(*arguments) == (2, "", message + "\n")


@needs_rigs
@pytest.mark.parametrize("name", reference_rigs.CALIBRATIONS)
def test_real_rigs_convert_and_read_back_the_same(name):
    rig = reference_rigs.load(name)
    convert.write(Path("out.yml"), convert.to_opencv(rig, rig.rectification))
    same(rig, load("out.yml"))


@needs_rigs
def test_real_rig_in_metres_is_described(command):
    files = [reference_rigs.FOLDER / file for file in reference_rigs.CALIBRATIONS["EuRoC"]]
    content = json.loads(command(*files, "--json")[1])
    assert content["unit"] == "m"
    assert np.linalg.norm(content["T"]) == pytest.approx(0.110, abs=5e-4)
    assert content["rows"] == {"left": {"lens": 94, "no_lens": 30}, "right": {"lens": 94, "no_lens": 28}}
    assert "0.110078 m" in command(*files)[1]
