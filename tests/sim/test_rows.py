"""Row differences of image pairs: right where they are told, and told only where the images bear it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from pictures import HEIGHT, SIDES, WIDTH, board, rig, seen, squares, texture

from hdl import calibration
from hdl.geometry.rectification import rectify
from scripts import reference_rigs
from sim.rows import Withheld, find, measured
from sim.scene import render

needs_rigs = pytest.mark.skipif(
    not reference_rigs.FOLDER.is_dir(), reason="the reference data, ../shared/data, is not here"
)
LOW = 7.0  # px, the right camera's image lies lower


def rows(images, of=None):
    """What is measured with cores that are exact."""
    views = rectify(of or rig(LOW), lens=True)
    return measured(images, views, {side: view.map() for side, view in views.items()})


def turned(one, *degrees):
    """A rig whose right camera is calibrated as turned by so much more than it is."""
    turn = cv2.Rodrigues(np.radians(degrees))[0]
    return replace(one, R=turn @ one.R, rectification=None)


def reason(images, of=None):
    with pytest.raises(Withheld) as caught:
        rows(images, of)
    return str(caught.value), caught.value.suspicious is not None


PICTURES = {"corners of a 9x6 chessboard": board(), "points that SIFT matches": texture()}


@pytest.mark.parametrize("kind", PICTURES)
def test_a_known_shift_is_measured_and_rectified_away(kind):
    found = rows(seen(PICTURES[kind], LOW))
    assert found.kind == kind
    assert found.before.mean == pytest.approx(LOW, abs=0.1)
    assert found.before.signed_mean == pytest.approx(-LOW, abs=0.1)
    assert found.after == found.exact and found.before.n == found.after.n >= 54
    assert found.after.mean < 0.15 and found.after.percentile_95 < 0.4
    assert found.suspicious is None
    assert found.sentence().startswith(f"Rows of {found.after.n} {kind} differ by ")


@pytest.mark.parametrize("kind", PICTURES)
def test_a_wrong_calibration_is_noticed_and_not_hidden_by_the_rejection_of_outliers(kind):
    found = rows(seen(PICTURES[kind], LOW), rig(LOW - 3))
    assert found.after.mean == pytest.approx(3, abs=0.2)
    assert found.suspicious == (
        f"rows of matched points still differ by {found.exact.mean:.1f} px on average; "
        "is the calibration of these cameras, and left the left one?"
    )


@pytest.mark.parametrize("kind", PICTURES)
def test_exchanged_images_are_noticed_even_where_rows_agree(kind):
    images = seen(PICTURES[kind])
    assert reason({"left": images["right"], "right": images["left"]}, rig()) == (
        "by the calibration most points lie behind the cameras; are the left and the right image exchanged?",
        True,
    )
    # A left camera that is calibrated as standing right is no exchange.
    assert rows({"left": images["right"], "right": images["left"]}, rig(T=(0.1, 0, 0))).after.mean < 0.15


def test_a_core_that_leaves_rows_apart_is_no_wrong_calibration():
    # With this lens rows do not agree unless it is corrected.
    lens = np.array([0.0, 0.0, 0.03, 0.0, 0.0])
    bent = replace(rig(), right=replace(rig().right, D=lens))
    images = seen(texture())
    x, y = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    ideal = cv2.undistortPoints(np.column_stack([x.ravel(), y.ravel()]), bent.right.K, lens, P=bent.right.K)
    map_x, map_y = ideal.reshape(HEIGHT, WIDTH, 2).astype(np.float32).transpose(2, 0, 1)
    images["right"] = cv2.remap(images["right"], map_x, map_y, cv2.INTER_CUBIC)
    views = rectify(bent, lens=True)
    found = measured(images, views, {side: replace(view, lens=False).map() for side, view in views.items()})
    assert found.exact.mean < 0.3 < 1 < found.after.mean
    assert found.suspicious is None
    assert found.sentence().endswith(
        f" The exact map with the lens leaves {found.exact.mean:.3f} px: the rest is the cores' choice."
    )


def test_no_figure_where_images_do_not_bear_one():
    images = seen(texture())
    blank = {side: np.full((HEIGHT, WIDTH), 90, np.uint8) for side in SIDES}
    assert reason(dict.fromkeys(SIDES, images["left"])) == ("the two images are the same", True)
    dull = {"left": images["left"], "right": images["left"] // 2 + 40}
    assert reason(dull, rig()) == ("the two images show the same from the same place", True)
    blank["right"][:20] = 91
    assert reason(blank) == ("only 0 points are found in both images; 30 are needed", False)
    noise = {
        side: np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH), np.uint8) for seed, side in enumerate(SIDES)
    }
    assert reason(noise)[1] is False
    other = {"left": images["left"], "right": seen(texture(5))["right"]}
    assert reason(other)[1] is False


@pytest.mark.parametrize("turn, slant", [(5, 50), (20, 30)])
@pytest.mark.parametrize(
    "picture", [squares(), squares(square=8), np.tile(texture(3, 64), (12, 12))], ids=["squares", "small", "paper"]
)
def test_what_repeats_itself_blames_no_good_calibration(picture, turn, slant):
    images = seen(picture, LOW, turn=turn, slant=slant, width=2.5, noise=3)
    text, suspicious = reason(images)
    assert text.startswith("only ") and not suspicious


def test_points_that_the_rectified_images_do_not_show_are_not_counted():
    views = rectify(rig(LOW), lens=True)
    images = seen(board(), LOW)
    kind, left, right = find(images, views)
    maps = {side: tuple(axis[:, :160] for axis in view.map()) for side, view in views.items()}
    found = measured(images, views, maps)
    assert 0 < found.after.n == np.sum((left[:, 0] <= 159) & (right[:, 0] <= 159)) < 54
    nowhere = {side: tuple(axis[:, :10] for axis in view.map()) for side, view in views.items()}
    with pytest.raises(Withheld, match="^of 54 corners of a 9x6 chessboard none is in both rectified images$"):
        measured(images, views, nowhere)


@pytest.mark.parametrize("kind", PICTURES)
def test_columns_are_compared_of_cameras_that_stand_one_above_the_other(kind):
    # `rig` and what it sees, with x and y exchanged.
    images = {side: np.ascontiguousarray(image.T) for side, image in seen(PICTURES[kind], LOW).items()}
    views = {
        side: replace(
            view, camera=replace(view.camera, K=swapped(view.camera.K)), P=swapped(view.P), width=HEIGHT, height=WIDTH
        )
        for side, view in rectify(rig(LOW), lens=True).items()
    }
    maps = {side: view.map() for side, view in views.items()}
    found = measured(images, views, maps)
    assert found.line == "column" and found.before.mean == pytest.approx(LOW, abs=0.1) and found.after.mean < 0.15
    assert found.sentence().startswith("Columns of ") and "column_difference" in found.as_dict()
    with pytest.raises(Withheld, match="behind the cameras"):
        measured({"left": images["right"], "right": images["left"]}, views, maps)


def swapped(matrix):
    """A camera matrix with x and y exchanged."""
    found = matrix.copy()
    found[[0, 1]] = found[[1, 0]]
    found[:, [0, 1]] = found[:, [1, 0]]
    return found


def test_colour_is_looked_at_in_gray():
    images = {side: cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) for side, image in seen(board(), LOW).items()}
    assert rows(images) == rows(seen(board(), LOW))


def test_the_rendered_scene_is_measured_without_knowing_its_points(monkeypatch):
    embedded = calibration.embedded((320, 240))
    images = render(embedded, lens=True)
    found = rows(images, embedded)
    assert found.kind == "corners of a 8x5 chessboard"
    assert found.before.mean > 3 and found.after.mean < 0.15
    monkeypatch.setattr("sim.rows.chessboard", lambda *_: None)
    found = rows(images, embedded)
    assert found.kind == "points that SIFT matches"
    assert found.before.mean > 3 and found.after.mean < 0.3


PAIRS = {"OpenCV samples": 3, "MRPT": 0, "MYNT S JPL": 0, "EuRoC": 0}


@needs_rigs
@pytest.mark.parametrize("name", PAIRS)
def test_real_pairs_are_measured_and_wrong_calibrations_of_them_noticed(name):
    one = reference_rigs.load(name)
    files = reference_rigs.IMAGES[name][PAIRS[name]]
    images = {
        side: cv2.imread(str(reference_rigs.FOLDER / file), cv2.IMREAD_GRAYSCALE) for side, file in zip(SIDES, files)
    }
    assert rows(images, one).after.mean < 0.3
    assert rows(images, turned(one, 0.5, 0, 0)).suspicious
    try:
        assert rows({"left": images["right"], "right": images["left"]}, one).suspicious
    except Withheld as withheld:
        assert withheld.suspicious
