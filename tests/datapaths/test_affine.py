"""The affine fit: as close as any, in the fewest bits, or as many as the best takes."""

import numpy as np
import pytest
import rigs
from scipy.optimize import linprog

from hdl.arithmetic.linear import LinearForm
from hdl.arithmetic.minimax import outside_by
from hdl.datapaths.affine import Affine
from hdl.datapaths.base import ARITHMETIC_ERROR
from hdl.datapaths.proposed import Proposed
from hdl.errors import BudgetError

SIZE = 80, 60
COORDINATES = list(zip("uv", (0, 1)))


def errors(datapath, view):
    """Largest error, px, of u and of v over the pixels that count."""
    counts = outside_by(*view.map()) == 0
    used = (datapath.coordinates.u, datapath.coordinates.v)
    return [np.abs(mine * 2.0**-datapath.fraction_bits - its)[counts].max() for mine, its in zip(used, view.map())]


def least(exact, counts):
    """The least error of any affine function, by a program over every pixel that counts."""
    y, x = np.nonzero(counts)
    columns, one = np.stack([x, y, np.ones_like(x)], axis=1).astype(float), np.ones((len(x), 1))
    bounds = [(None, None)] * 3 + [(0, None)]
    rows = np.block([[columns, -one], [-columns, -one]])
    return linprog([0, 0, 0, 1], rows, np.concatenate([exact[counts], -exact[counts]]), bounds=bounds).fun


@pytest.mark.parametrize("side", rigs.SIDES)
@pytest.mark.parametrize("fraction_bits", [3, 5, 8])
@pytest.mark.parametrize("rig", rigs.NAMES)
def test_no_affine_function_is_closer_than_what_the_hardware_computes(rig, side, fraction_bits):
    view = rigs.view(rig, side, *SIZE)
    counts = outside_by(*view.map()) == 0
    affine = Affine.fit(view, fraction_bits)
    for reached, exact in zip(errors(affine, view), view.map()):
        assert reached <= least(exact, counts) + 2.0 ** -(fraction_bits + 1) + ARITHMETIC_ERROR + 1e-6


@pytest.mark.parametrize("rig", ["samples", "rolled", "toed_in"])
def test_it_is_closer_than_the_coefficients_of_eq_6(rig):
    view = rigs.view(rig, "left", *SIZE)
    assert max(errors(Affine.fit(view, 5), view)) < 0.7 * max(errors(Proposed.fit(view, 5), view))


@pytest.mark.parametrize("rig", rigs.NAMES)
def test_forms_have_the_fewest_bits_and_do_not_overflow(rig):
    view = rigs.view(rig, "right", *SIZE)
    affine = Affine.fit(view, 5)
    x, y = np.arange(SIZE[0]), np.arange(SIZE[1])[:, None]
    counts = outside_by(*view.map()) == 0
    for (axis, index), form in zip(COORDINATES, (affine.u_form, affine.v_form)):
        assert affine.formats[axis] == form.format and rigs.fits(form.format, form.values(x, y))
        limit = least(view.map()[index], counts) + 1 / 64 + ARITHMETIC_ERROR
        # Rounded to any fewer bits, the same coefficients are off by more.
        finest = [value * 2.0**-form.fraction_bits for value in (form.a, form.b)]
        start = form.c * 2.0**-form.fraction_bits - 1 / 64
        for bits in range(5, form.fraction_bits - 2):
            coarser = LinearForm.quantise((*finest, start), bits, *SIZE, half=1 / 64)
            used = (coarser.values(x, y) >> (bits - 5)) / 32
            assert np.abs(used - view.map()[index])[counts].max() > limit - 1e-6


def test_a_budget_buys_fewer_bits():
    view = rigs.view("samples", "left", *SIZE)
    best = Affine.fit(view, 5)
    budget = max(errors(best, view)) + 1
    cheaper = Affine.fit(view, 5, budget)
    assert max(errors(cheaper, view)) <= budget
    # At 8 bits rounding the coefficients costs 2**-9 * (40 + 30) px at most.
    assert max(form.fraction_bits for form in (cheaper.u_form, cheaper.v_form)) <= 8
    assert cheaper.cost.ff < best.cost.ff


def test_a_budget_out_of_reach_is_refused_with_the_least_error():
    view = rigs.view("toed_in", "left", *SIZE)
    reached = max(errors(Affine.fit(view, 5), view))
    with pytest.raises(BudgetError) as caught:
        Affine.fit(view, 5, 0.05)
    assert caught.value.reached == pytest.approx(reached, abs=1e-12)
    assert str(caught.value) == (f"--max-error: 0.05: affine for the left camera reaches {reached:.3g} px and no less")


def test_only_pixels_from_inside_the_image_count():
    # What lies outside on all sides of this view would draw any fit to all of it away.
    view = rigs.view("samples_whole", "left", *SIZE)
    outside = outside_by(*view.map()) > 0
    assert outside.mean() > 0.03
    everywhere = [least(exact, np.ones_like(outside)) for exact in view.map()]
    assert max(errors(Affine.fit(view, 8), view)) < max(everywhere)
