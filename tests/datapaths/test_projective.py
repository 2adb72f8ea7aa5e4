from dataclasses import replace

import numpy as np
import pytest
import rigs
from datapath_runs import assert_same, run

from hdl.arithmetic.cuts import PIPELINES
from hdl.arithmetic.linear import LinearForm
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import default_budget
from hdl.datapaths.projective import MOST_FRACTION_BITS, Projective, Ratio
from hdl.errors import InputError
from sim import reference
from sim.drivers import pauses

NAMES = [name for name, datapath in DATAPATHS.items() if issubclass(datapath, Projective)]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("max_error", [0.0157, 0.02, 0.1, 1.0])
def test_a_budget_is_met(name, max_error):
    view = rigs.view("toed_in", "right", 64, 48)
    coordinates = DATAPATHS[name].fit(view, 5, max_error).coordinates
    error = coordinates.error(*reference.coordinate_map(view), view.source_size)
    assert max(error["u"]["max"], error["v"]["max"]) <= max_error


@pytest.mark.parametrize("name", NAMES)
def test_a_wider_budget_narrows_the_divider(name):
    view = rigs.view("toed_in", "right", 64, 48)
    widths = [DATAPATHS[name].fit(view, 5, budget).divisor_bits for budget in (0.0157, 0.02, 0.1, 1.0)]
    assert widths == sorted(widths, reverse=True)
    assert len(set(widths)) == 4


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("max_error", [1 / 64, 0.01, 1e-9])
def test_a_budget_below_the_rounding_is_refused(name, max_error):
    with pytest.raises(InputError) as caught:
        DATAPATHS[name].fit(rigs.view("samples"), 5, max_error)
    assert str(caught.value) == (
        f"--max-error: {max_error}: rounding to 5 fraction bits alone costs up to 0.015625 px; "
        "more --fraction-bits help"
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_budget_beyond_the_widest_words_is_refused(name):
    max_error = 1 / 64 + 1e-12
    with pytest.raises(InputError) as caught:
        DATAPATHS[name].fit(rigs.view("samples", width=320, height=240), 5, max_error)
    assert str(caught.value) == f"--max-error: {max_error}: cannot be reached by word lengths of this datapath"


def built(datapath, view, bits):
    """``datapath`` anew with these word lengths: divisor, z and, for each axis, kept and form."""
    row = dict(zip("uvz", rigs.matrix(view)))

    def form(coefficients, stored, kept):
        half = 2.0 ** -(kept + 1) if stored > kept else 0.0
        return LinearForm.quantise(coefficients, stored, view.width, view.height, half=half)

    ratios = {}
    for axis, ratio in (("u", datapath.u_ratio), ("v", datapath.v_ratio)):
        numerator = 2**datapath.fraction_bits * (row[axis] + ratio.bias * row["z"]) + row["z"] / 2
        stored, kept = bits[f"form_{axis}"], bits[f"kept_{axis}"]
        ratios[f"{axis}_ratio"] = Ratio(form(numerator, stored, kept), kept, ratio.bias)
    return replace(datapath, **ratios, z_form=form(row["z"], bits["z"], bits["divisor"]), divisor_bits=bits["divisor"])


def test_factors_that_are_too_wide_for_a_dsp_block_are_cut():
    view = rigs.view("toed_in", "left", 20, 15)
    fitted = DATAPATHS["conventional"].fit(view, 5)
    bits = {"divisor": fitted.divisor_bits, "z": fitted.z_form.fraction_bits, "form_u": 26, "form_v": 26}
    kept = {"kept_u": fitted.u_ratio.kept_bits, "kept_v": fitted.v_ratio.kept_bits}
    compact = built(fitted, view, {**bits, **kept})
    assert max(abs(form.a) for form in compact.forms.values()) >= 1 << 25
    # A block more, a register within each, and one at the end.
    assert compact.with_pipeline(PIPELINES["balanced"]).latency == compact.latency + 3
    for pipeline in PIPELINES.values():
        datapath = compact.with_pipeline(pipeline)
        assert (datapath.cost.dsp > 6) == bool(pipeline.products)
        assert_same(run(datapath, 1, pauses(0.2, seed=1), pauses(0.2, seed=2)), datapath)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("side, max_error", [("left", None), ("right", 0.05)])
def test_word_lengths_are_the_fewest_in_the_order_of_their_cost(name, side, max_error):
    view = rigs.view("zoomed", side, 120, 90)
    fitted = DATAPATHS[name].fit(view, 5, max_error)
    budget = default_budget(5) if max_error is None else max_error
    exact = dict(zip("uv", reference.coordinate_map(view)))

    def meets(bits, axes):
        used = built(fitted, view, bits).coordinates
        return all(np.abs(getattr(used, axis) / 32 - exact[axis]).max() <= budget for axis in axes)

    most = {
        "divisor": MOST_FRACTION_BITS,
        "z": MOST_FRACTION_BITS,
        **{f"{kind}_{axis}": MOST_FRACTION_BITS for axis in "uv" for kind in ("kept", "form")},
    }
    chosen = {
        "divisor": fitted.divisor_bits,
        "z": fitted.z_form.fraction_bits,
        "kept_u": fitted.u_ratio.kept_bits,
        "form_u": fitted.u_ratio.form.fraction_bits,
        "kept_v": fitted.v_ratio.kept_bits,
        "form_v": fitted.v_ratio.form.fraction_bits,
    }
    # Each step: the bits that shrink together, on which axes it counts, and what was decided before.
    bits = dict(most)
    for names, axes in (
        (("divisor", "kept_u", "kept_v"), "uv"),
        (("kept_u",), "u"),
        (("kept_v",), "v"),
        (("z",), "uv"),
        (("form_u",), "u"),
        (("form_v",), "v"),
    ):
        decided = chosen[names[0]]
        assert not meets({**bits, **dict.fromkeys(names, decided - 1)}, axes), names
        bits.update(dict.fromkeys(names, decided))
        assert meets(bits, axes), names
    assert bits == chosen


@pytest.mark.parametrize(
    "rig, width, height, max_error",
    [
        *((rig, 160, 120, max_error) for rig in rigs.NAMES for max_error in (None, 0.02, 0.2, 1.0, 3.0)),
        ("samples_whole", 640, 480, None),
        ("toed_in", 1280, 800, None),
    ],
)
def test_no_value_overflows_its_format(rig, width, height, max_error):
    for side in rigs.SIDES:
        view = rigs.view(rig, side, width, height)
        datapath = DATAPATHS["accumulate"].fit(view, 5, max_error)
        assert datapath.forms == DATAPATHS["conventional"].fit(view, 5, max_error).forms
        x, y = np.arange(width), np.arange(height)[:, None]
        for key, form in datapath.forms.items():
            assert rigs.fits(datapath.formats[key], form.values(x, y))
        divisor = datapath.z_form.values(x, y) >> datapath.z_form.fraction_bits - datapath.divisor_bits
        assert divisor.min() > 0
        assert rigs.fits(datapath.formats["divisor"], divisor)
        for axis, ratio in (("u", datapath.u_ratio), ("v", datapath.v_ratio)):
            dividend = ratio.form.values(x, y) >> ratio.form.fraction_bits - ratio.kept_bits
            assert dividend.min() >= 0
            assert rigs.fits(datapath.formats[f"dividend_{axis}"], dividend)
            # The divider's condition.
            shift = datapath.divisor_bits - ratio.kept_bits
            assert shift >= 0
            assert (dividend << shift < divisor << datapath.quotient_bits).all()
