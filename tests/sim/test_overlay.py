"""The pair under epipolar lines."""

import numpy as np
import pytest

from sim.overlay import column_overlay, epipolar_overlay

ORANGE = [0, 159, 230]


def image(level, height=48, width=64, channels=()):
    return np.full((height, width, *channels), level, np.uint8)


def lined(picture):
    return np.flatnonzero((picture == ORANGE).all(axis=(1, 2))).tolist()


def test_images_stand_side_by_side():
    picture = epipolar_overlay(image(50), image(90), lines=0)
    assert picture.dtype == np.uint8 and picture.shape[0] == 48 and picture.shape[1] > 128
    assert (picture[:, :64] == 50).all() and (picture[:, -64:] == 90).all()
    assert (picture[:, 64:-64] == 255).all()


def test_lines_are_even_and_run_through_both_images():
    assert lined(epipolar_overlay(image(50), image(90), lines=4)) == [6, 18, 30, 42]


def test_lines_go_where_they_are_asked_for():
    picture = epipolar_overlay(image(50), image(90), lines=[0, 20, 47])
    assert lined(picture) == [0, 20, 47]
    assert (picture[1:20, :64] == 50).all()


def test_images_with_columns_in_common_stand_one_above_the_other():
    picture = column_overlay(image(50), image(90), lines=[0, 20, 63])
    assert picture.shape[0] > 96 and picture.shape[1:] == (64, 3)
    assert lined(picture.swapaxes(0, 1)) == [0, 20, 63]
    assert (picture[:48, 1:20] == 50).all() and (picture[-48:, 1:20] == 90).all()


def test_colours_stay_what_they_are():
    left = image(0, channels=(3,))
    left[...] = [10, 20, 30]
    picture = epipolar_overlay(left, image(90), lines=[5])
    assert (picture[10, :64] == [10, 20, 30]).all()


def test_captions_stand_above_the_pair():
    plain, captioned = (epipolar_overlay(image(50), image(90), captions=c) for c in (None, ("before", "after")))
    strip = captioned[: len(captioned) - len(plain)]
    np.testing.assert_array_equal(captioned[len(strip) :], plain)
    assert strip[:, :64].min() < 100 and strip[:, -64:].min() < 100 and strip.max() == 255


def test_the_images_are_not_written_to():
    left, right = image(50, channels=(3,)), image(90)
    epipolar_overlay(left, right)
    assert (left == 50).all() and (right == 90).all()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((image(1), image(1, height=40)), "right.shape = (40, 64, 3): must be 48 rows high, as the left image"),
        ((image(1), image(1), [48]), "lines = [48]: must be rows 0 to 47"),
        (
            (image(1).astype(np.uint16), image(1)),
            "left: uint16 (48, 64): must be uint8, (height, width) or (height, width, 3)",
        ),
    ],
)
def test_other_images_are_refused(arguments, message):
    with pytest.raises(ValueError) as caught:
        epipolar_overlay(*arguments)
    assert str(caught.value) == message
