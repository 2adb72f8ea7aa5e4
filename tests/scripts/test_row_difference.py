"""Row differences in real image pairs: the statistics over several pairs, what is refused, and the result."""

import json
import sys

import numpy as np
import pytest
from pictures import HEIGHT, SIDES, WIDTH, board, rig, seen, texture

from hdl import cli
from hdl.errors import InputError
from scripts import minimise_rows, reference_rigs, row_difference

needs_rigs = pytest.mark.skipif(
    not reference_rigs.FOLDER.is_dir(), reason="the reference data, ../shared/data, is not here"
)
SHIFT = 7.0  # px, the right camera's image lies lower


def pair(picture, **pose):
    images = seen(picture, SHIFT, **pose)
    return tuple(images[side] for side in SIDES)


def test_pairs_are_measured_together_and_those_that_bear_no_figure_left_out():
    flat = np.full((HEIGHT, WIDTH), 90, np.uint8)
    result = row_difference.measure(rig(SHIFT), [pair(board()), (flat, flat), pair(board(), turn=-10), pair(texture())])
    assert result["points"] == "corners of a 9x6 chessboard, points that SIFT matches"
    assert (result["pairs"], result["pairs_measured"]) == (4, 3)
    assert result["before"]["mean"] == pytest.approx(SHIFT, abs=0.1)
    assert result["before"]["signed_mean"] == pytest.approx(-SHIFT, abs=0.1)
    assert result["after"]["mean"] < 0.1 and result["after"]["percentile_95"] < 0.3
    assert result["after"]["n"] > 2 * 54 + 30
    assert row_difference.measure(rig(SHIFT - 3), [pair(board())])["after"]["mean"] == pytest.approx(3, abs=0.2)


def test_images_of_another_size_and_without_points_are_refused():
    flat = np.full((HEIGHT, WIDTH), 90, np.uint8)
    for images, problem in (
        ([(flat[:100], flat)], "rig.yml: images = 320x100, 320x240: not the 320x240 of the calibration"),
        ([(flat, flat)], "rig.yml: images = 1: the two images are the same"),
    ):
        with pytest.raises(InputError) as caught:
            row_difference.measure(rig(), images)
        assert str(caught.value) == problem


@pytest.fixture
def script(monkeypatch, capsys):
    """Runs a script as the shell does: (exit status, stdout, stderr)."""

    def run(command, *arguments):
        monkeypatch.setenv("COLUMNS", "160")
        monkeypatch.setattr(sys, "argv", ["script", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.run(command)
        captured = capsys.readouterr()
        return ended.value.code, captured.out, captured.err

    return run


@pytest.mark.parametrize("command", [row_difference.row_difference, minimise_rows.minimise_rows], ids=lambda c: c.name)
def test_missing_reference_data_is_one_line(command, script, tmp_path):
    status, out, err = script(command, "--data", tmp_path / "missing")
    assert (status, out) == (2, "")
    assert err.startswith("error: --data: ") and err.count("\n") == 1


@needs_rigs
def test_real_pairs_are_row_aligned_to_less_than_a_third_of_a_pixel(script, tmp_path):
    status, out, _ = script(row_difference.row_difference, "--json", tmp_path / "rows.json")
    assert status == 0
    rows = {row["rig"]: row for row in json.loads((tmp_path / "rows.json").read_text())}
    assert list(rows) == ["OpenCV samples", "MRPT", "MYNT S JPL", "EuRoC"]
    for name, row in rows.items():
        assert name in out
        assert row["before"]["mean"] > 5
        assert row["after"]["mean"] < 0.3
        assert row["pairs_measured"] == row["pairs"]
    for name, corners in (("OpenCV samples", 13 * 54), ("MRPT", 4 * 54)):
        assert rows[name]["points"] == "corners of a 9x6 chessboard"
        assert corners - 2 <= rows[name]["after"]["n"] <= corners


@needs_rigs
def test_result_above_the_limit_is_an_exit_status(script, monkeypatch):
    monkeypatch.setattr(row_difference, "LIMIT", 0.01)
    monkeypatch.setattr(reference_rigs, "IMAGES", {"MRPT": reference_rigs.IMAGES["MRPT"]})
    status, out, err = script(row_difference.row_difference)
    assert status == 1 and "MRPT" in out
    assert err == "a mean of 0.01 px or more after rectification\n"


@needs_rigs
def test_rows_before_and_after_minimising_are_tabulated(script, tmp_path):
    status, out, _ = script(minimise_rows.minimise_rows, "RealSense D455", "--json", tmp_path / "rows.json")
    assert status == 0
    with_lens, without = json.loads((tmp_path / "rows.json").read_text())
    assert (with_lens["rig"], with_lens["lens"], without["lens"]) == ("RealSense D455", True, False)
    assert with_lens["before"] == {"left": 10, "right": 12}
    assert sum(with_lens["after"].values()) < 22
    assert with_lens["lost"] <= 0.05 and with_lens["row_disagreement"] < 1e-6
    assert "10, 12" in out
