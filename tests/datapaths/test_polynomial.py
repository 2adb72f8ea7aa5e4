"""Polynomials: within the budget at every pixel, lens and fisheye included, of the smallest degree, in few bits."""

import re
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import rigs
from amaranth.back import rtlil
from polynomials import value

from hdl import calibration
from hdl.arithmetic import minimax
from hdl.arithmetic.minimax import outside_by
from hdl.calibration import Camera, Rig
from hdl.datapaths import polynomial
from hdl.datapaths.base import fitted_budget
from hdl.datapaths.polynomial import Polynomial
from hdl.errors import BudgetError, InputError
from hdl.geometry.rectification import RectificationOptions, rectify


def fisheye(width=128, height=96, focal=0.9):
    """A pair of equidistant cameras, turned a little towards each other; ``focal`` in widths."""
    K = np.array([[0.45 * width, 0, 0.497 * width], [0, 0.45 * width, 0.502 * height], [0, 0, 1]])
    camera = Camera("equidistant", K, np.array([0.003, 0.0007, -0.002, 0.0002]))
    rig = Rig("fisheye", width, height, camera, camera, np.eye(3), np.array([-0.1, 0.002, 0.001]))
    return rectify(rig, RectificationOptions(focal=focal * width), lens=True)["left"]


def lens(size=(97, 71), side="left", **options):
    return rectify(calibration.embedded(size), RectificationOptions(**options), lens=True)[side]


VIEWS = {
    "nearly affine": lambda: rigs.view("rolled", "right", 19, 16),
    "pinhole": lambda: rigs.view("samples", "right", 97, 71),
    "rolled": lambda: rigs.view("rolled", "left", 64, 48),
    "toed in": lambda: rigs.view("toed_in", "right", 63, 50),
    "lens": lens,
    "lens, to the corners": lambda: lens((96, 72), "right", alpha=1.0),
    "fisheye": fisheye,
}


@cache
def fit(name, fraction_bits=5, budget=None):
    """The view called ``name``, and its polynomials."""
    view = VIEWS[name]()
    return view, Polynomial.fit(view, fraction_bits, budget)


# Cutting off 6 fraction bits, where they should be rounded, would alone take more than 0.015 px.
@pytest.mark.parametrize("budget, fraction_bits", [(None, 5), (0.1, 4), (0.015, 6)])
@pytest.mark.parametrize("name", VIEWS)
def test_every_pixel_inside_is_within_the_budget_and_none_outside_comes_in(name, budget, fraction_bits):
    view, fitted = fit(name, fraction_bits, budget)
    budget = fitted_budget(fraction_bits) if budget is None else budget
    outside = outside_by(*view.map())
    u, v = (w * 2.0**-fraction_bits for w in (fitted.coordinates.u, fitted.coordinates.v))
    for used, exact in zip((u, v), view.map()):
        assert np.abs(used - exact)[outside == 0].max() <= budget
    # A pixel that is clearly outside stays outside.
    assert outside_by(u, v)[outside > 4 * budget].min(initial=1) > 0


@pytest.mark.parametrize("name", VIEWS)
def test_coordinates_are_those_of_the_polynomial_in_exact_integers(name):
    fitted = fit(name)[1]
    for form, used in ((fitted.u_form, fitted.coordinates.u), (fitted.v_form, fitted.coordinates.v)):
        for x, y in np.random.default_rng(1).integers(0, (fitted.width, fitted.height), (200, 2)).tolist():
            assert value(form, x, y) >> (form.fraction_bits - 5) == used[y, x]


@pytest.mark.parametrize("name", VIEWS)
def test_each_coordinate_has_the_smallest_degree(name):
    view, fitted = fit(name)
    x, y = np.linspace(-1, 1, view.width), np.linspace(-1, 1, view.height)
    for form, exact in zip((fitted.u_form, fitted.v_form), view.map()):
        lower = form.degree - 1
        terms = [(k, n) for k in range(lower + 1) for n in range(lower + 1 - k)]
        powers = [position[:, None] ** np.arange(lower + 1) for position in (x, y)]
        allowance = 0.5 * outside_by(*view.map())
        assert minimax.minimax(*powers, terms, exact, allowance)[1] > fitted_budget(5) - 1 / 64


def test_what_lies_far_outside_is_not_left_to_chance():
    # Up to the image's edge a parabola would do, which comes back into the image where the map does not.
    x, y = np.meshgrid(np.arange(100.0), np.arange(40.0))
    edge = 43.0
    u = np.where(x < edge, 100 - 100 * ((edge + 7 - x) / 50) ** 2, 99 + 3 * (x - edge))
    view = SimpleNamespace(width=100, height=40, side="left", map=lambda: (u, y))
    fitted = Polynomial.fit(view, 5, 1.0)
    outside = outside_by(u, y)
    used = fitted.coordinates.u / 32
    assert np.abs(used - u)[outside == 0].max() <= 1
    assert (used[outside > 4] > 99).all()


@pytest.mark.parametrize("name", ["pinhole", "lens", "fisheye"])
def test_cells_save_bits(name, monkeypatch):
    view, with_cells = fit(name)
    monkeypatch.setattr(polynomial, "CELLS", (1,))
    without = Polynomial.fit(view, 5)
    assert with_cells.cost.ff < without.cost.ff


@pytest.mark.parametrize("name", VIEWS)
def test_the_estimated_flip_flops_are_the_registers(name):
    fitted = fit(name)[1]
    text = rtlil.convert(fitted.component(), emit_src=False)
    widths = re.findall(r"cell \$s?dffe? .*\n(?: +parameter .*\n)*? +parameter \\WIDTH (\d+)\n", text)
    assert len(widths) == text.count("cell $dff") + text.count("cell $sdff")
    assert fitted.cost.ff == sum(map(int, widths))


@pytest.mark.parametrize("name", VIEWS)
def test_formats_hold_every_value(name):
    fitted = fit(name)[1]
    for axis, form in (("u", fitted.u_form), ("v", fitted.v_form)):
        assert rigs.fits(fitted.formats[axis], form.values())
        for k in range(1, form.degree + 1):
            assert rigs.fits(fitted.formats[f"{axis}_d{k}"], form.difference(k))
        assert rigs.fits(fitted.formats[f"{axis}_jump"], form.jump(0))


def test_a_hopeless_map_is_given_up_before_anything_expensive(monkeypatch):
    view = fisheye(160, 120, focal=0.2)
    programs, solve = [], minimax._program
    monkeypatch.setattr(minimax, "_program", lambda *problem: programs.append(1) or solve(*problem))
    with pytest.raises(BudgetError) as caught:
        Polynomial.fit(view, 5)
    assert caught.value.reached > 0.05
    assert str(caught.value) == (
        f"--max-error: 0.05: a polynomial of degree up to 6 for the left camera reaches {caught.value.reached:.3g} px "
        "and no less"
    )
    # Of each coordinate a small program for the degrees that least squares do not rule out, of which none is enough.
    assert 0 < len(programs) < 2 * len(polynomial.DEGREES)


def test_a_budget_below_rounding_is_refused():
    with pytest.raises(InputError, match=r"^--max-error: 0\.01: rounding to 5 fraction bits alone costs"):
        Polynomial.fit(VIEWS["pinhole"](), 5, 0.01)


@pytest.mark.parametrize("degree", range(1, 7))
def test_rounding_a_coefficient_is_made_up_for_by_the_others(degree):
    basis = polynomial._Basis((96, 128), degree, 1)
    rng = np.random.default_rng(degree)
    x, y = np.meshgrid(np.linspace(-1, 1, 128), np.linspace(-1, 1, 96))
    target = sum(rng.normal(0, 5) * x**k * y**n for k in range(degree + 1) for n in range(degree + 1 - k))
    lattice = basis.lattice(target[basis.grid], np.ones_like(target[basis.grid]))
    assert lattice.error < 1e-6
    bits = 6 + 5 * degree
    coefficients, error = lattice.closest(bits)
    np.testing.assert_allclose(
        np.abs(lattice.columns @ (np.array(coefficients) * 2.0**-bits) - lattice.target).max(), error, rtol=1e-6
    )
    # Each rounded by itself, functions as large as these are off by more.
    scaled = np.linalg.lstsq(lattice.columns / lattice.scale, lattice.target)[0] / lattice.scale
    alone = np.abs(lattice.columns @ (np.round(scaled * 2**bits) / 2**bits) - lattice.target).max()
    assert error < 0.6 * alone
