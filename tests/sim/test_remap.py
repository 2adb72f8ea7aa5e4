"""The integer pixel model: its definition, pixel by pixel, and cv2.remap."""

import cv2
import numpy as np
import pytest

from sim.remap import cv2_remap, opencv_maps, remap

BORDERS = {
    "black": ("constant", 0),
    "gray": ("constant", 77),
    "white": ("constant", 255),
    "replicate": ("replicate", 0),
}


def picture(*shape, dtype=np.uint8, seed=1):
    return np.random.default_rng(seed).integers(0, np.iinfo(dtype).max, shape, dtype=dtype, endpoint=True)


def coordinates(height, width, fraction_bits=5, seed=2):
    """u, v of a 61x47 frame: all over the source, often just outside it, and as far out as integers go."""
    rng = np.random.default_rng(seed)
    u, v = (rng.integers(-3 << fraction_bits, (n + 3) << fraction_bits, (47, 61)) for n in (width, height))
    for axis, extent in ((u, width), (v, height)):
        edges = np.array([-1, 0, extent - 1, extent]) << fraction_bits
        axis[:8] = rng.choice(edges, (8, 61)) + rng.integers(-1, 2, (8, 61))
        axis[rng.random(axis.shape) < 0.03] = rng.choice([-(1 << 40), -(1 << 20), 1 << 20, 1 << 40])
    return u, v


def by_definition(source, u, v, fraction_bits, border, value):
    """One pixel, in Python's integers."""
    height, width = source.shape
    one = 1 << fraction_bits
    total = 0
    for dy in (0, 1):
        for dx in (0, 1):
            x, y = (u >> fraction_bits) + dx, (v >> fraction_bits) + dy
            weight_x, weight_y = (u % one if dx else one - u % one), (v % one if dy else one - v % one)
            if border == "replicate":
                x, y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
            inside = 0 <= x < width and 0 <= y < height
            total += (int(source[y, x]) if inside else value) * weight_x * weight_y
    return (total + one * one // 2) >> 2 * fraction_bits


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("shape", [(37, 53), (37, 53, 3)], ids=["gray", "colour"])
def test_pixels_are_those_of_cv2_remap(shape, border):
    source = picture(*shape)
    u, v = coordinates(*shape[:2])
    result = remap(source, u, v, 5, *BORDERS[border])
    assert result.dtype == np.uint8 and result.shape == (47, 61) + shape[2:]
    np.testing.assert_array_equal(result, cv2_remap(source, u, v, *BORDERS[border]))


def test_every_fraction_gives_the_pixel_of_cv2_remap():
    fy, fx = np.mgrid[:32, :32]
    for corner in picture(60, 2, 2):
        np.testing.assert_array_equal(remap(corner, fx, fy), cv2_remap(corner, fx, fy))


def test_a_frame_longer_than_one_chunk_is_that_of_cv2_remap():
    source = picture(240, 320)
    y, x = np.mgrid[:240, :320]
    u, v = 32 * x + 3 * y - 200, 32 * y - x + 60
    np.testing.assert_array_equal(remap(source, u, v), cv2_remap(source, u, v))


@pytest.mark.parametrize("border", ["black", "gray", "replicate"])
@pytest.mark.parametrize("fraction_bits", [0, 1, 3, 5, 8])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_pixels_follow_the_definition(dtype, fraction_bits, border):
    source = picture(6, 9, dtype=dtype)
    u, v = (w[::4, ::4] for w in coordinates(6, 9, fraction_bits))
    result = remap(source, u, v, fraction_bits, *BORDERS[border])
    expected = [by_definition(source, int(x), int(y), fraction_bits, *BORDERS[border]) for x, y in zip(u.flat, v.flat)]
    assert result.dtype == dtype
    assert result.ravel().tolist() == expected


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("fraction_bits", [5, 7, 8])
def test_full_scale_stays_full_scale(dtype, fraction_bits):
    full = np.iinfo(dtype).max
    source = np.full((4, 4), full, dtype)
    fraction = np.arange(1 << fraction_bits)[:, None] * np.ones((1, 3), int)
    assert (remap(source, fraction + (1 << fraction_bits), fraction, fraction_bits) == full).all()


def test_the_border_enters_tap_by_tap():
    source = np.full((2, 2), 100, np.uint8)
    half, u = 16, np.array([[-16, -32, -33, 32, 48, 64]])
    v = np.zeros_like(u)
    assert remap(source, u, v).tolist() == [[50, 0, 0, 100, 50, 0]]
    assert remap(source, u, v, border_value=200).tolist() == [[150, 200, 200, 100, 150, 200]]
    assert remap(source, u, v + 32 + half).tolist() == [[25, 0, 0, 50, 25, 0]]
    assert remap(source, u, v - 99, border="replicate").tolist() == [[100] * 6]


def test_each_channel_has_its_border_value():
    source = picture(5, 5, 3)
    u, v = coordinates(5, 5)
    result = remap(source, u, v, border_value=(1, 20, 255))
    np.testing.assert_array_equal(result, cv2_remap(source, u, v, border_value=(1, 20, 255)))
    for channel, value in enumerate((1, 20, 255)):
        alone = remap(np.ascontiguousarray(source[..., channel]), u, v, border_value=value)
        np.testing.assert_array_equal(result[..., channel], alone)


@pytest.mark.parametrize("dtype", [np.int16, np.uint16, np.int32, np.uint32, np.int64])
def test_coordinates_of_any_integer_type_mean_the_same(dtype):
    source = picture(40, 40)
    u, v = np.random.default_rng(3).integers(0, 39 * 32, (2, 20, 20))
    np.testing.assert_array_equal(remap(source, u.astype(dtype), v.astype(dtype)), remap(source, u, v))


def test_maps_are_those_that_opencv_converts_coordinates_to():
    u, v = np.random.default_rng(4).integers(-3000, 30000, (2, 30, 40))
    whole, fraction = cv2.convertMaps((u / 32).astype(np.float32), (v / 32).astype(np.float32), cv2.CV_16SC2)
    ours = opencv_maps(u, v)
    np.testing.assert_array_equal(ours[0], whole)
    np.testing.assert_array_equal(ours[1], fraction)
    assert (ours[0].dtype, ours[1].dtype) == (np.int16, np.uint16)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"source": np.zeros((4, 4))}, "source.dtype = float64: must be uint8 or uint16"),
        (
            {"source": np.zeros(4, np.uint8)},
            "source.shape = (4,): must be (height, width) or (height, width, channels)",
        ),
        ({"u": np.zeros((2, 2))}, "u.dtype = float64: must be an integer that fits int64"),
        ({"v": np.zeros((2, 3), int)}, "u.shape = (2, 2), v.shape = (2, 3): must be the same (height, width)"),
        ({"fraction_bits": 9}, "fraction_bits = 9: must be 0 to 8"),
        ({"border": "wrap"}, "border = 'wrap': must be one of constant, replicate"),
        ({"border_value": 256}, "border_value = 256: must be 0 to 255"),
        ({"border_value": -1}, "border_value = -1: must be 0 to 255"),
    ],
)
def test_arguments_out_of_range_are_named(change, message):
    arguments = {"source": np.zeros((4, 4), np.uint8), "u": np.zeros((2, 2), int), "v": np.zeros((2, 2), int)} | change
    with pytest.raises((TypeError, ValueError)) as caught:
        remap(**arguments)
    assert str(caught.value) == message


def test_opencv_takes_five_fraction_bits_only():
    with pytest.raises(ValueError) as caught:
        opencv_maps(np.zeros((2, 2), int), np.zeros((2, 2), int), 6)
    assert str(caught.value) == "fraction_bits = 6: cv2.remap takes 5 only"
