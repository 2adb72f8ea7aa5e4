"""Chessboards are found whatever their size, whole or not at all, and their corners come in one order."""

import cv2
import numpy as np
import pytest
from pictures import HEIGHT, WIDTH, board, seen, squares, texture

from sim.boards import chessboard


def in_place(at):
    return at


def found(images, turned=None):
    """The board in both images; the right one first turned by so many quarters, as its positions know."""
    left, right = images["left"], np.ascontiguousarray(np.rot90(images["right"], turned or 0))

    def upright(at):
        for _ in range(turned or 0):  # np.rot90: what was at (x, y) is at (y, last x - x)
            last = (WIDTH, HEIGHT)[(_ + turned) % 2] - 1
            at = np.column_stack([last - at[:, 1], at[:, 0]])
        return at

    return chessboard(left, right, (in_place, upright))


@pytest.mark.parametrize("size", [(9, 6), (8, 6), (7, 5), (6, 6), (5, 4), (11, 8)], ids=str)
def test_boards_of_any_size_are_found_and_lie_on_common_rows(size):
    columns_rows, left, right = found(seen(board(*size)))
    assert columns_rows == size and len(left) == size[0] * size[1]
    assert np.abs(left[:, 1] - right[:, 1]).max() < 0.3
    assert (left[:, 0] - right[:, 0]).min() > 10


@pytest.mark.parametrize("size", [(9, 6), (8, 6), (7, 7)], ids=str)
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_corners_are_matched_where_one_image_is_turned(size, quarters):
    expected = found(seen(board(*size)))
    _, left, right = found(seen(board(*size)), quarters)
    assert np.abs(left - expected[1]).max() < 0.1
    height, width = (HEIGHT, WIDTH)
    turned = expected[2]
    for _ in range(quarters):
        turned = np.column_stack([turned[:, 1], width - 1 - turned[:, 0]])
        height, width = width, height
    assert np.abs(right - turned).max() < 0.5


def test_colours_tell_one_end_of_a_board_from_the_other_where_places_do_not():
    images = seen(board(9, 6))
    _, left, right = found(images)
    upside_down = np.ascontiguousarray(images["right"][::-1, ::-1])
    _, left, turned = chessboard(images["left"], upside_down, (in_place, in_place))
    assert np.abs([WIDTH - 1, HEIGHT - 1] - right - turned).max() < 0.5


def test_large_images_are_looked_through_at_a_fraction_of_their_size():
    images = {side: cv2.resize(image, None, fx=5, fy=5) for side, image in seen(board(), noise=0).items()}
    size, left, right = chessboard(images["left"], images["right"], (in_place, in_place))
    expected = found(seen(board(), noise=0))
    assert size == (9, 6)
    assert np.abs((left + 0.5) / 5 - 0.5 - expected[1]).max() < 0.3


def test_a_board_that_is_cut_off_in_both_images_is_none():
    # Of ten columns of corners each image shows nine, and not the same ones.
    images = seen(board(10, 6), turn=0, slant=0)
    _, left, right = found(images)
    cut = {
        "left": images["left"][:, round(left[:, 0].min()) + 5 :],
        "right": images["right"][:, : round(right[:, 0].max()) - 5],
    }
    for side, image in cut.items():
        assert cv2.findChessboardCornersSB(np.ascontiguousarray(image), (9, 6))[0], side
    assert found({side: np.ascontiguousarray(image) for side, image in cut.items()}) is None


@pytest.mark.parametrize("picture", [squares(), texture()], ids=["wall", "texture"])
def test_what_is_no_whole_board_is_none(picture):
    assert found(seen(picture, width=2.0)) is None


def test_different_boards_are_none():
    assert found({"left": seen(board(9, 6))["left"], "right": seen(board(8, 6))["right"]}) is None
    assert found({"left": seen(board(9, 6))["left"], "right": seen(texture())["right"]}) is None
