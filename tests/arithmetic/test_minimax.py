"""Least-maximum fits: known ones, against a linear program over all pixels, and what does not count."""

import numpy as np
import pytest
from scipy.optimize import linprog

from hdl.arithmetic import minimax as module
from hdl.arithmetic.minimax import minimax, outside_by

LINEAR = [(0, 0), (1, 0), (0, 1)]
QUADRATIC = [*LINEAR, (2, 0), (1, 1), (0, 2)]


def powers(size, degree):
    return np.linspace(-1, 1, size)[:, None] ** np.arange(degree + 1)


def surface(coefficients, width, height):
    degree = len(coefficients) - 1
    return powers(height, degree) @ coefficients.T @ powers(width, degree).T


def least(across, down, terms, target, allowance):
    """The least maximum error beyond the allowance, by one program over every pixel that counts."""
    columns = np.stack([np.outer(down[:, j], across[:, i]).ravel() for i, j in terms], axis=1)
    counts = np.isfinite(allowance).ravel()
    columns, target, allowance = columns[counts], target.ravel()[counts], allowance.ravel()[counts]
    t = np.ones((len(columns), 1))
    return linprog(
        [0] * len(terms) + [1],
        np.block([[columns, -t], [-columns, -t]]),
        np.concatenate([allowance + target, allowance - target]),
        bounds=[(None, None)] * len(terms) + [(0, None)],
    ).fun


def bumpy(width, height, seed=3):
    """A map's coordinate: a slope, some bend, and waves."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    a, b, c = rng.uniform(1, 4, 3)
    return 20 * x + 3 * y + 2 * x * x - x * y * y + 0.1 * np.cos(a * x * 3 + b * y) + 0.05 * np.sin(c * y * 5)


def test_a_parabola_is_half_its_height_off_any_line():
    width, height = 101, 3
    target = np.broadcast_to(np.linspace(-1, 1, width) ** 2, (height, width))
    coefficients, error = minimax(powers(width, 1), powers(height, 1), LINEAR, target, np.zeros_like(target))
    assert error == pytest.approx(0.5, abs=2e-6)
    np.testing.assert_allclose(coefficients, [[0.5, 0], [0, 0]], atol=1e-5)


@pytest.mark.parametrize("width, height", [(61, 47), (90, 40), (7, 5)])
@pytest.mark.parametrize("degree, terms", [(1, LINEAR), (2, QUADRATIC)])
def test_no_fit_is_closer_and_the_error_is_that_of_every_pixel(width, height, degree, terms):
    target, none = bumpy(width, height), np.zeros((height, width))
    across, down = powers(width, degree), powers(height, degree)
    coefficients, error = minimax(across, down, terms, target, none)
    assert error == pytest.approx(least(across, down, terms, target, none), abs=3e-6)
    assert error == pytest.approx(np.abs(surface(coefficients, width, height) - target).max(), abs=1e-9)


def test_pixels_that_do_not_count_are_free_and_others_may_be_off_by_their_allowance():
    target = bumpy(60, 40)
    across, down = powers(60, 1), powers(40, 1)
    allowance = np.zeros((40, 60))
    allowance[:, :20], allowance[10:, 50:] = np.inf, 0.3
    wrong = target + 500 * np.isinf(allowance)
    coefficients, error = minimax(across, down, LINEAR, wrong, allowance)
    assert error == pytest.approx(least(across, down, LINEAR, target, allowance), abs=3e-6)
    assert error < 0.9 * minimax(across, down, LINEAR, target, np.zeros((40, 60)))[1]
    assert (np.abs(surface(coefficients, 60, 40) - wrong) <= error + allowance + 1e-9).all()


def test_a_single_pixel_that_counts_is_met():
    allowance = np.full((40, 60), np.inf)
    allowance[23, 31] = 0
    target = np.full((40, 60), 7.0)
    coefficients, error = minimax(powers(60, 1), powers(40, 1), LINEAR, target, allowance)
    assert error < 1e-6 and surface(coefficients, 60, 40)[23, 31] == pytest.approx(7)


def test_a_hopeless_fit_is_given_up_after_one_program(monkeypatch):
    programs = []
    solve = module._program
    monkeypatch.setattr(module, "_program", lambda *problem: programs.append(len(problem[0])) or solve(*problem))
    target = bumpy(160, 120)
    across, down = powers(160, 1), powers(120, 1)
    reached = minimax(across, down, LINEAR, target, np.zeros_like(target))[1]
    assert len(programs) > 1
    programs.clear()
    bound = minimax(across, down, LINEAR, target, np.zeros_like(target), enough=0.1)[1]
    # Far fewer samples than pixels, and yet not far from the truth; never beyond it.
    assert len(programs) == 1 and programs[0] < 1000
    assert 0.9 * reached < bound <= reached


def test_how_far_outside():
    u, v = np.array([[0.0, 3.0, 4.5], [-2.0, 1.0, 2.0]]), np.array([[0.0, 1.0, -1.0], [1.5, 1.0, 0.2]])
    np.testing.assert_allclose(outside_by(u, v), [[0, 1, 2.5], [2, 0, 0]])
    assert (outside_by(u - 3, v)[1] > 0).tolist() == [True, True, True]
