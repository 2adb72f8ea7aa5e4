"""Row differences in images: the measurement on pictures with known shifts, and the result on those of real rigs."""

import json
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from hdl import cli
from hdl.calibration import Camera, Rig
from hdl.errors import InputError
from hdl.geometry.rectification import RectificationOptions, rectify
from scripts import minimise_rows, reference_rigs, row_difference

needs_rigs = pytest.mark.skipif(
    not reference_rigs.FOLDER.is_dir(), reason="the reference data, ../shared/data, is not here"
)
WIDTH, HEIGHT = 320, 240
BOARD = 9, 6
SHIFT = 7.0  # px, the right camera's image lies lower


def rig(shift=SHIFT):
    """Parallel cameras without a lens; the right one's principal point is ``shift`` px lower."""
    K = np.array([[300.0, 0, 159.5], [0, 300, 119.5], [0, 0, 1]])
    cameras = [Camera("radtan", K + [[0, 0, 0], [0, 0, low], [0, 0, 0]], np.zeros(0)) for low in (0, shift)]
    return Rig("rig.yml", WIDTH, HEIGHT, *cameras, np.eye(3), np.array([-0.1, 0, 0]))


def moved(image, x, y):
    return cv2.warpAffine(
        image, np.array([[1, 0, x], [0, 1, y]], dtype=float), (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR, borderValue=200
    )


def board(x=40, y=30, square=20):
    image = np.full((HEIGHT, WIDTH), 200, np.uint8)
    for row in range(BOARD[1] + 1):
        for column in range(BOARD[0] + 1):
            if (row + column) % 2 == 0:
                cv2.rectangle(
                    image,
                    (x + column * square, y + row * square),
                    (x + (column + 1) * square - 1, y + (row + 1) * square - 1),
                    20,
                    cv2.FILLED,
                )
    return cv2.GaussianBlur(image, (5, 5), 1)


def texture():
    rng = np.random.default_rng(4)
    small = rng.integers(0, 256, (HEIGHT // 4, WIDTH // 4), np.uint8)
    return cv2.GaussianBlur(cv2.resize(small, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC), (5, 5), 1.2)


@pytest.mark.parametrize("picture, corners", [(board(), BOARD), (texture(), None)], ids=["chessboard", "SIFT"])
def test_known_shift_is_measured_and_rectified_away(picture, corners):
    pair = picture, moved(picture, -12.5, SHIFT)
    result = row_difference.measure(rig(), [pair], corners)
    assert result["before"]["mean"] == pytest.approx(SHIFT, abs=0.1)
    assert result["before"]["signed_mean"] == pytest.approx(-SHIFT, abs=0.1)
    assert result["after"]["mean"] < 0.1
    assert result["after"]["percentile_95"] < 0.3
    assert (result["pairs"], result["before"]["pairs"], result["after"]["pairs"]) == (1, 1, 1)
    assert result["after"]["points"] >= (54 if corners else 100)


@pytest.mark.parametrize("picture, corners", [(board(), BOARD), (texture(), None)], ids=["chessboard", "SIFT"])
def test_wrong_calibration_is_not_hidden_by_the_rejection_of_outliers(picture, corners):
    pair = picture, moved(picture, -12.5, SHIFT)
    result = row_difference.measure(rig(SHIFT - 3), [pair], corners)
    assert result["after"]["mean"] == pytest.approx(3, abs=0.2)


def test_corners_come_in_one_order_when_one_detection_is_upside_down(monkeypatch):
    detect = row_difference._corners
    calls = []

    def second_is_turned(image, size):
        calls.append(detect(image, size))
        return calls[-1][::-1] if len(calls) == 2 else calls[-1]

    monkeypatch.setattr(row_difference, "_corners", second_is_turned)
    left, right = row_difference.corners(board(), moved(board(), -9.0, 2.0), BOARD)
    assert np.abs(left - right - [9, -2]).max() < 0.2


def test_board_that_is_not_seen_whole_is_looked_for_again_with_alpha_1(monkeypatch):
    lens = np.array([-0.3, 0.0, 0.0, 0.0])
    curved = replace(rig(0.0), left=replace(rig(0.0).left, D=lens), right=replace(rig(0.0).right, D=lens))
    whole = rectify(curved, RectificationOptions(alpha=1.0), lens=True)
    look, shown = row_difference.corners, []

    def cut_at_first(left, right, size):
        shown.append((left, right))
        return None if len(shown) == 2 else look(left, right, size)

    monkeypatch.setattr(row_difference, "corners", cut_at_first)
    picture = board()
    result = row_difference.measure(curved, [(picture, picture)], BOARD)
    assert result["after"]["pairs"] == 1 and result["after"]["mean"] < 0.05
    assert len(shown) == 3
    for image, view in zip(shown[2], whole.values()):
        assert np.array_equal(image, row_difference.rectified(view, picture))


def test_images_of_another_size_and_without_points_are_refused():
    flat = np.full((HEIGHT, WIDTH), 90, np.uint8)
    for images, problem in (
        ([(flat[:100], flat)], "rig.yml: images = 320x100, 320x240: not the 320x240 of the calibration"),
        ([(flat, flat)], "rig.yml: images = 1: no point is seen in both images of a pair"),
    ):
        for corners in (BOARD, None):
            with pytest.raises(InputError) as caught:
                row_difference.measure(rig(), images, corners)
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
        assert row["after"]["pairs"] == row["pairs"]
    assert rows["OpenCV samples"]["after"]["points"] == 13 * 54
    assert rows["MRPT"]["after"]["points"] == 4 * 54


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
