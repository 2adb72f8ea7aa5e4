import numpy as np
import pytest

from hdl.errors import InputError
from hdl.geometry.coordinates import Border, Coordinates, Window

CONSTANT, REPLICATE = Border("constant"), Border("replicate")


def random_coordinates(generator, width, height, fraction_bits, reach, source=None):
    """Coordinates up to ``reach`` px beyond each edge of the source, whose size is the frame's or (width, height)."""
    u, v = (
        generator.integers(-reach << fraction_bits, (extent + reach) << fraction_bits, (height, width))
        for extent in source or (width, height)
    )
    return Coordinates(u.astype(np.int32), v.astype(np.int32), fraction_bits)


def offsets(coordinates, source, replicate):
    """Source row minus the one due of every tap that is read inside the source, one by one."""
    width, height = source
    one = 2**coordinates.fraction_bits
    for y in range(coordinates.height):
        due = y * height // coordinates.height
        for x in range(coordinates.width):
            left, top = int(coordinates.u[y, x]) // one, int(coordinates.v[y, x]) // one
            for column in (left, left + 1):
                for row in (top, top + 1):
                    if replicate:
                        yield min(max(row, 0), height - 1) - due
                    elif 0 <= column < width and 0 <= row < height:
                        yield row - due


@pytest.mark.parametrize("border", [CONSTANT, REPLICATE], ids=lambda border: border.mode)
@pytest.mark.parametrize("scale", [(1, 1), (2, 1), (1, 3)], ids=str)
def test_window_holds_exactly_the_taps_inside_the_source(border, scale):
    generator = np.random.default_rng(1)
    for width, height, bits, reach in [(7, 9, 5, 3), (8, 6, 3, 30), (5, 4, 8, 0), (6, 8, 4, 1)] * 25:
        # A few pixels only, so that single taps decide; the rest lie far outside.
        source = width * scale[0], height * scale[1]
        coordinates = random_coordinates(generator, width, height, bits, reach, source)
        far = generator.random((height, width)) < 0.9
        coordinates.u[far] = -100 << bits
        if border is REPLICATE:
            due = np.arange(height, dtype=np.int32)[:, None] * scale[1]
            coordinates.v[far] = (due * np.ones(width, np.int32))[far] << bits
        expected = list(offsets(coordinates, source, border is REPLICATE))
        if not expected:
            with pytest.raises(InputError):
                coordinates.window(border, source)
            continue
        assert coordinates.window(border, source) == Window(min(expected), max(expected))


def test_source_rows_that_are_due_follow_the_height_of_the_source():
    """A source of five thirds of the frame's height, shown whole: each row is read a little after it is due."""
    v = np.floor(np.arange(6) * 10 / 6)[:, None] * np.ones(4) * 32
    shown = Coordinates(np.zeros((6, 4), np.int32), v.astype(np.int32), 5)
    assert shown.window(CONSTANT, (4, 10)) == Window(0, 1)


@pytest.mark.parametrize(
    "u, v, expected",
    [
        (-1.0, 3.0, Window(2, 3)),  # the right column's taps are inside
        (9.5, 3.0, Window(2, 3)),
        (4.0, -0.5, Window(-1, -1)),  # the lower row's only
        (4.0, 7.25, Window(6, 6)),  # the upper row's only
    ],
)
def test_window_of_one_pixel_at_the_edge(u, v, expected):
    shape = (8, 10)
    coordinates = Coordinates(np.full(shape, -64, np.int32), np.full(shape, -64, np.int32), 5)
    coordinates.u[1, 4], coordinates.v[1, 4] = round(u * 32), round(v * 32)
    assert coordinates.window(CONSTANT, (10, 8)) == expected


def test_window_refuses_a_map_without_a_tap_inside():
    outside = np.full((4, 6), -33, np.int32)
    with pytest.raises(InputError) as caught:
        Coordinates(outside, outside, 5).window(CONSTANT, (6, 4))
    assert str(caught.value) == "map: no output pixel has its source inside the image"
    assert Coordinates(outside, outside, 5).window(REPLICATE, (6, 4)) == Window(-3, 0)


@pytest.mark.parametrize(
    "d_lo, d_hi, lead, rows",
    [
        (0, 1, 1, 4),
        (-1, 1, 1, 6),
        (-3, 4, 4, 10),
        (-8, -7, 0, 12),
        (7, 8, 8, 4),
        (0, 0, 0, 4),
        (-2, 1, 1, 6),
    ],
)
def test_rows_kept_are_the_spread_and_three_made_even(d_lo, d_hi, lead, rows):
    window = Window(d_lo, d_hi)
    assert (window.lead, window.rows) == (lead, rows)


def test_ranges_are_the_extremes():
    coordinates = random_coordinates(np.random.default_rng(2), 9, 7, 5, 4)
    assert coordinates.u_range == (min(coordinates.u.ravel()), max(coordinates.u.ravel()))
    assert coordinates.v_range == (min(coordinates.v.ravel()), max(coordinates.v.ravel()))
    assert (coordinates.width, coordinates.height) == (9, 7)


@pytest.mark.parametrize("fraction_bits", [3, 5, 8])
def test_error_is_that_of_every_pixel_whose_source_is_inside(fraction_bits):
    generator = np.random.default_rng(fraction_bits)
    coordinates = random_coordinates(generator, 12, 9, fraction_bits, 2)
    one = 2**fraction_bits
    u = coordinates.u / one + generator.normal(0, 0.7, coordinates.u.shape)
    v = coordinates.v / one + generator.normal(0, 0.7, coordinates.v.shape)
    u[0, :3], v[0, :3] = (0, 11, 5), (0, 8, 8)  # the very edge counts
    differences, rounded = [], []
    for y in range(9):
        for x in range(12):
            exact = float(u[y, x]), float(v[y, x])
            if 0 <= exact[0] <= 11 and 0 <= exact[1] <= 8:
                used = int(coordinates.u[y, x]) / one, int(coordinates.v[y, x]) / one
                differences.append([abs(a - b) for a, b in zip(used, exact)])
                rounded.append([abs((2 * a + 1) // 2 - (2 * b + 1) // 2) for a, b in zip(used, exact)])
    error = coordinates.error(u, v, (12, 9))
    assert error.keys() == {"u", "v", "euclidean_max", "pixels", "rounded"}
    assert error["pixels"] == len(differences) < 12 * 9
    assert error["euclidean_max"] == pytest.approx(max((a * a + b * b) ** 0.5 for a, b in differences), rel=1e-12)
    for statistics, samples in ((error, differences), (error["rounded"], rounded)):
        for axis, values in zip("uv", zip(*samples)):
            assert statistics[axis]["max"] == max(values)
            assert statistics[axis]["mean"] == pytest.approx(sum(values) / len(values), rel=1e-12)


def test_error_counts_what_lies_inside_a_source_of_another_size():
    exact = np.array([[4.0, 4.1, 9.0]]), np.array([[2.0, 2.0, 2.1]])
    coordinates = Coordinates(np.array([[128, 132, 300]], np.int32), np.array([[64, 64, 64]], np.int32), 5)
    assert [coordinates.error(*exact, source)["pixels"] for source in ((5, 3), (6, 3), (10, 4))] == [1, 2, 3]


def test_rounded_error_rounds_halves_up_on_both_sides():
    coordinates = Coordinates(np.array([[48, 47, 112]], np.int32), np.zeros((1, 3), np.int32), 5)
    error = coordinates.error(np.array([[1.5, 1.5, 2.0]]), np.zeros((1, 3)), (3, 1))
    assert (error["u"]["max"], error["pixels"]) == (1.5, 3)
    assert error["rounded"]["u"] == {"mean": pytest.approx((0 + 1 + 2) / 3), "max": 2.0}


def test_error_refuses_a_map_without_a_pixel_inside():
    coordinates = random_coordinates(np.random.default_rng(3), 5, 4, 5, 0)
    with pytest.raises(InputError) as caught:
        coordinates.error(np.full((4, 5), -0.001), np.zeros((4, 5)), (5, 4))
    assert str(caught.value) == "map: no output pixel has its source inside the image"


@pytest.mark.parametrize(
    "text, border",
    [
        ("constant", Border("constant", 0)),
        ("constant:0", Border("constant", 0)),
        ("constant:255", Border("constant", 255)),
        ("constant:65535", Border("constant", 65535)),
        ("replicate", Border("replicate")),
    ],
)
def test_borders_are_parsed(text, border):
    assert Border.parse(text) == border


@pytest.mark.parametrize(
    "text",
    [
        "black",
        "constant:",
        "constant:-1",
        "constant:1.5",
        "constant:0x10",
        "constant:٣",
        "constant:²",
        "replicate:1",
        "replicate:",
        "Constant",
        "constant:1:2",
        "constant: 1",
        "constant:1_0",
    ],
)
def test_other_borders_are_refused_by_their_text(text):
    with pytest.raises(InputError) as caught:
        Border.parse(text)
    assert str(caught.value) == f"--border: {text}: must be constant, constant:VALUE or replicate"


def test_an_unknown_mode_is_refused_by_the_constructor_too():
    with pytest.raises(InputError) as caught:
        Border("wrap", 3)
    assert str(caught.value) == "--border: wrap: must be constant, constant:VALUE or replicate"
