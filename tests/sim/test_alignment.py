"""Inverting coordinate maps, and the row statistics that rest on it."""

import numpy as np
import pytest

from sim.alignment import rectified_positions, row_difference

WIDTH, HEIGHT = 200, 150


def bent(x, y):
    """A map with a lens-like bend, a turn and a zoom."""
    dx, dy = x - 90.0, y - 80.0
    r2 = (dx * dx + dy * dy) / 150**2
    return 100 + (0.95 * dx - 0.1 * dy) * (1 + 0.15 * r2), 75 + (0.1 * dx + 0.9 * dy) * (1 + 0.15 * r2)


def bent_map():
    return bent(*np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float)))


def positions(count=500):
    return np.random.default_rng(0).uniform([0, 0], [WIDTH - 1, HEIGHT - 1], (count, 2))


def test_positions_are_found_back():
    expected = positions()
    found = rectified_positions(*bent_map(), np.column_stack(bent(*expected.T)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


def test_pixels_of_the_map_are_found_exactly():
    u, v = bent_map()
    x, y = np.meshgrid(np.arange(0, WIDTH, 7), np.arange(0, HEIGHT, 7))
    found = rectified_positions(u, v, np.column_stack([u[y, x].ravel(), v[y, x].ravel()]))
    inner = (x.ravel() > 0) & (y.ravel() > 0)  # on the border, rounding may push a position out
    np.testing.assert_allclose(found[inner], np.column_stack([x.ravel(), y.ravel()])[inner], rtol=0, atol=1e-9)


@pytest.mark.parametrize("step, within", [(1 / 256, 0.01), (1 / 32, 0.05), (1, 1.2)])
def test_a_map_in_steps_is_as_good_as_its_steps(step, within):
    expected = positions()
    u, v = (np.round(w / step) * step for w in bent_map())
    found = rectified_positions(u, v, np.column_stack(bent(*expected.T)))
    error = np.abs(found - expected).max(axis=1)
    assert np.isnan(error).mean() < 0.05
    assert np.nanmax(error) < within


def test_what_the_map_does_not_show_has_no_position():
    outside = np.array([[-0.5, 40], [WIDTH - 0.5, 40], [50, -0.5], [50, HEIGHT - 0.5], [-300, 40], [50, 4000]])
    found = rectified_positions(*bent_map(), np.column_stack(bent(*outside.T)))
    assert np.isnan(found).all()


def test_positions_are_found_beside_parts_of_the_map_that_lead_nowhere():
    u, v = bent_map()
    u[:40], v[:40] = np.nan, np.nan
    expected = positions()
    expected = expected[expected[:, 1] > 50]
    found = rectified_positions(u, v, np.column_stack(bent(*expected.T)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


def test_rows_before_rectification_are_those_of_the_source():
    points = {"left": np.array([[1.0, 10.0], [2.0, 20.0]]), "right": np.array([[5.0, 9.0], [6.0, 23.0]])}
    assert row_difference(None, points) == (2.0, 2.0, 2.9, 3.0, -1.0, 2)


def test_rows_are_compared_after_the_maps():
    expected = positions()
    shifted = expected + [3, 0.25]
    points = {"left": np.column_stack(bent(*expected.T)), "right": np.column_stack(bent(*shifted.T))}
    stats = row_difference({"left": bent_map(), "right": bent_map()}, points)
    assert abs(stats.mean - 0.25) < 1e-3 and abs(stats.max - 0.25) < 2e-3
    shown = ((shifted >= 0) & (shifted <= [WIDTH - 1, HEIGHT - 1])).all(axis=1)
    assert abs(stats.n - shown.sum()) <= 2


def test_columns_are_compared_where_columns_are_aligned():
    points = {"left": np.array([[1.0, 10.0], [2.0, 20.0]]), "right": np.array([[5.0, 9.0], [7.0, 23.0]])}
    stats = row_difference(None, points, "columns")
    assert (stats.mean, stats.max, stats.signed_mean, stats.n) == (4.5, 5.0, -4.5, 2)
    expected = positions()
    shifted = expected + [0.25, 3]
    points = {"left": np.column_stack(bent(*expected.T)), "right": np.column_stack(bent(*shifted.T))}
    stats = row_difference({"left": bent_map(), "right": bent_map()}, points, "columns")
    assert abs(stats.mean - 0.25) < 1e-3 and abs(stats.max - 0.25) < 2e-3


def test_no_point_in_common_is_an_error():
    far = np.full((3, 2), 1e5)
    with pytest.raises(ValueError) as caught:
        row_difference({"left": bent_map(), "right": bent_map()}, {"left": far, "right": far})
    assert str(caught.value) == "points: none is shown in both images"
