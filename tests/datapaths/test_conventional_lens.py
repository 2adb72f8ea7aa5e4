"""`conventional` with the lens: its model against the float64 map, its hardware against its model, whole frames."""

import re
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import rigs
from datapath_runs import assert_same, run

from hdl import calibration
from hdl.arithmetic.cuts import PIPELINES
from hdl.arithmetic.steps import Product, Quotient, Scaled, evaluate, in_range
from hdl.calibration import Camera, Rig
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import default_budget
from hdl.datapaths.conventional import Conventional
from hdl.datapaths.conventional_lens import ConventionalLens
from hdl.errors import BudgetError, InputError
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.stream.rectifier import Rectifier, RectifierParameters
from hdl.tools.verilog import convert
from sim import reference
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core
from sim.drivers import pauses
from sim.remap import cv2_remap

# Model, coefficients, ratio of the focal lengths and skew, px per width.
LENSES = {
    "samples_like": ("radtan", [-0.29, 0.095, 0.0012, -0.0001, 0.0], 1.0, 0.0),
    "cubic": ("radtan", [-0.4, 0.21, 0.002, 0.0014, -0.07], 1.0, 0.0),
    "one_term": ("radtan", [0.15], 1.0, 0.0),
    "second_term": ("radtan", [0.0, 0.2, 0.0, 0.0], 1.0, 0.0),
    "tangential": ("radtan", [0.0, 0.0, 0.004, -0.006], 0.9, 0.0),
    "skewed": ("radtan", [-0.2, 0.05, 0.01, 0.002], 1.25, 0.1),
    "rational": ("rational", [4.1, 1.7, 0.0002, -0.0003, 0.05, 4.4, 3.0, 0.35], 1.0, 0.0),
    "rational_skewed": ("rational", [0.3, -0.1, 0.003, 0.001, 0.02, 0.6, 0.0, 0.1], 0.95, 0.003),
}


@cache
def views(name, width, height):
    """The rectified views of a rig with one of `LENSES`, or of the embedded one (samples; samples_whole: alpha 1)."""
    if name.startswith("samples") and name not in LENSES:
        options = RectificationOptions(alpha=float(name == "samples_whole"))
        return rectify(calibration.embedded((width, height)), options, lens=True)
    model, D, ratio, skew = LENSES[name]
    K = np.array([[0.8 * width, skew * width, 0.51 * width], [0, 0.8 * width * ratio, 0.48 * height], [0, 0, 1.0]])
    camera = Camera(model, K, np.pad(np.array(D), (0, {"radtan": 5, "rational": 8}[model] - len(D))))
    R = cv2.Rodrigues(np.array([0.02, -0.05, 0.03]))[0]
    return rectify(Rig(name, width, height, camera, camera, R, np.array([-0.1, 0.002, 0.001])), lens=True)


@cache
def fit(name, side="left", width=96, height=72, fraction_bits=5, max_error=None):
    """The view, and the datapath for it."""
    view = views(name, width, height)[side]
    return view, DATAPATHS["conventional"].fit(view, fraction_bits, max_error)


def vga(side, max_error=None):
    return fit("samples", side, 640, 480, max_error=max_error)


def worst(view, datapath):
    """The largest error over the pixels whose source is inside, px, against a map that is computed by OpenCV."""
    error = datapath.coordinates.error(*reference.coordinate_map(view), view.source_size)
    return max(error["u"]["max"], error["v"]["max"])


@pytest.mark.parametrize("name", ["samples", "samples_whole", *LENSES])
def test_model_is_the_exact_map_within_the_budget(name):
    view, datapath = fit(name, "right", max_error=0.1)
    assert isinstance(datapath, ConventionalLens)
    assert worst(view, datapath) <= 0.1


@pytest.mark.parametrize("fraction_bits, max_error", [(3, None), (8, None), (6, 0.5)])
def test_budgets_hold_with_any_fraction(fraction_bits, max_error):
    view, datapath = fit("skewed", fraction_bits=fraction_bits, max_error=max_error)
    assert datapath.coordinates.fraction_bits == fraction_bits
    assert worst(view, datapath) <= (default_budget(fraction_bits) if max_error is None else max_error)


@pytest.mark.parametrize("side", rigs.SIDES)
def test_model_is_the_exact_map_on_a_vga_frame(side):
    view, datapath = vga(side)
    assert worst(view, datapath) <= 1 / 64 + 0.002
    # More would be bits for nothing.
    assert worst(view, datapath) >= 1 / 64 + 0.001


@pytest.mark.parametrize("name", ["samples", "tangential", "skewed", "rational"])
def test_hardware_computes_the_integer_model(name):
    _, datapath = fit(name, "right", 22, 17, max_error=0.1)
    assert_same(run(datapath, 2, pauses(0.2, seed=1, burst=2), pauses(0.2, seed=2)), datapath)


@pytest.mark.parametrize("name", ["skewed", "rational"])
def test_hardware_of_adders_computes_the_integer_model(name):
    _, datapath = fit(name, "right", 22, 17, max_error=0.1)
    assert_same(run(replace(datapath, dsp=False), 1, pauses(0.2, seed=1), pauses(0.2, seed=2)), datapath)


@pytest.mark.parametrize("name", ["skewed", "rational"])
@pytest.mark.parametrize("pipeline", [pipeline for pipeline in PIPELINES if pipeline != "compact"])
@pytest.mark.parametrize("dsp", [True, False])
def test_hardware_computes_the_integer_model_in_every_pipeline(name, pipeline, dsp):
    _, compact = fit(name, "right", 22, 17, max_error=0.1)
    datapath = replace(compact, dsp=dsp).with_pipeline(PIPELINES[pipeline])
    assert datapath.latency > compact.latency
    assert_same(run(datapath, 2, pauses(0.2, seed=1, burst=2), pauses(0.2, seed=2)), datapath)


@pytest.mark.parametrize("dsp, max_error", [(False, 0.05)])
def test_every_pixel_of_vga_frames_is_that_of_cv2_remap(dsp, max_error):
    _, datapath = vga("left", max_error)
    parameters = RectifierParameters(replace(datapath, dsp=dsp))
    frames = np.random.default_rng(1).integers(0, 256, (2, 480, 640), np.uint8)
    core = compile_core(convert(Rectifier(parameters), "core"), "core")
    stream = core.run(to_beats(frames, channels=1, pixel_bits=8))
    assert stream.not_ready_cycles == 0
    assert stream.beats["cycle"][0] - stream.sent["cycle"][0] == parameters.latency_cycles
    for frame, rectified in zip(frames, to_frames(stream.beats, 640, 480, channels=1, pixel_bits=8), strict=True):
        used = datapath.coordinates
        np.testing.assert_array_equal(rectified, cv2_remap(frame, used.u, used.v))


@pytest.mark.parametrize("dsp", [True, False])
def test_text_is_short(dsp):
    _, datapath = vga("left")
    datapath = replace(datapath, dsp=dsp)
    assert convert(Rectifier(RectifierParameters(datapath)), "core").count("\n") <= 3000
    assert bool(re.search(r" \* ", convert(datapath.component(), "core"))) == dsp


def test_a_second_fit_is_the_same():
    view, datapath = vga("left", 0.05)
    assert DATAPATHS["conventional"].fit(view, 5, 0.05) == datapath


@pytest.mark.parametrize("name", ["samples_whole", *LENSES])
def test_no_value_overflows_its_format(name):
    _, datapath = fit(name, "right", max_error=0.1)
    x, y = np.arange(datapath.width), np.arange(datapath.height)[:, None]
    pinhole, formats = datapath.pinhole, datapath.formats
    given = {
        axis: (pinhole.coordinate(ratio, x, y), pinhole.fraction_bits)
        for axis, ratio in (("x", pinhole.u_ratio), ("y", pinhole.v_ratio))
    }
    values = evaluate(datapath.steps, given)
    assert in_range(datapath.steps, values)
    for key, (stored, fraction_bits) in values.items():
        assert formats[key].fraction_bits == fraction_bits
        assert rigs.fits(formats[key], stored)
    divisor = pinhole.z_form.values(x, y) >> pinhole.z_form.fraction_bits - pinhole.divisor_bits
    assert divisor.min() > 0
    for ratio in (pinhole.u_ratio, pinhole.v_ratio):
        dividend = ratio.dividend(x, y)
        assert dividend.min() >= 0
        assert (dividend << pinhole.divisor_bits - ratio.kept_bits < divisor << pinhole.quotient_bits).all()


def kinds(name):
    """Numbers of products of two variables, of multiples and of divisions, the pinhole's aside."""
    _, datapath = fit(name, "right", max_error=0.1)
    return tuple(sum(isinstance(step, kind) for step in datapath.steps) for kind in (Product, Scaled, Quotient))


def test_what_has_a_coefficient_of_zero_is_left_out():
    # Two squares, and the stretch of both coordinates.
    assert kinds("one_term") == (4, 1, 0)
    # With k2, times r2 once more.
    assert kinds("second_term") == (5, 1, 0)
    # Each tangential coefficient has two multiples; (fx/fy)^2 is one.
    assert kinds("tangential") == (4, 5, 0)
    assert kinds("cubic") == (6, 5, 0)
    # What rounds to 0 is left out too: p1 and p2 where they bend rows.
    assert kinds("rational") == (8, 4, 1)


def test_a_lens_of_zeros_is_none():
    view = views("samples", 96, 72)["left"]
    clear = replace(view, camera=replace(view.camera, D=np.zeros(5)))
    without = replace(view, lens=False)
    assert DATAPATHS["conventional"].fit(clear, 5) == DATAPATHS["conventional"].fit(without, 5)
    assert isinstance(DATAPATHS["conventional"].fit(clear, 5), Conventional)


def test_a_wider_budget_is_cheaper():
    costs = [fit("samples", max_error=max_error)[1].cost for max_error in (None, 0.5)]
    assert costs == sorted(costs, key=lambda cost: cost.weight(), reverse=True)
    assert costs[0].lut > 1.5 * costs[-1].lut


def test_latency_at_vga():
    _, datapath = vga("left")
    # Products of the pinhole, quotients of 9 or 10 bits before the point and as many after it, and the lens.
    assert datapath.latency == datapath.pinhole.latency + 10
    assert 20 <= datapath.pinhole.latency <= 23


@pytest.mark.parametrize(
    "model, D, field",
    [
        ("equidistant", [0.1, 0.01, 0.0, 0.0], "D1"),
        ("equidistant", [0.0, 0.0, 0.0, 0.0], "D1"),  # no pinhole either
        ("thin_prism", [0.1] * 2 + [0.0] * 6 + [0.001, 0, 0, 0], "D2"),
        ("tilted", [0.1] * 2 + [0.0] * 10 + [0.01, 0.02], "D1"),
    ],
)
def test_other_lenses_are_refused(model, D, field):
    view = views("samples", 96, 72)["left" if field == "D1" else "right"]
    with pytest.raises(InputError) as caught:
        DATAPATHS["conventional"].fit(replace(view, camera=Camera(model, view.camera.K, np.array(D))), 5)
    message = str(caught.value)
    assert message.endswith(
        f"{field} = {model}: conventional computes radial-tangential and rational lenses alone; spline takes every lens"
    )


def test_a_model_that_divides_by_zero_is_refused():
    view = views("rational", 96, 72)["left"]
    D = np.array([0.1, 0, 0, 0, 0, -30.0, 0, 0])
    with pytest.raises(InputError) as caught:
        DATAPATHS["conventional"].fit(replace(view, camera=Camera("rational", view.camera.K, D)), 5, 0.05)
    assert "D1 = [" in str(caught.value)
    assert str(caught.value).endswith("the lens model divides by 0 within the frame")


@pytest.mark.parametrize("max_error", [1 / 64, 0.01])
def test_a_budget_below_the_rounding_is_refused(max_error):
    with pytest.raises(InputError) as caught:
        fit("samples", max_error=max_error)
    rounding = "rounding to 5 fraction bits alone costs up to 0.015625 px; more --fraction-bits help"
    assert str(caught.value) == f"--max-error: {max_error}: {rounding}"


def test_a_budget_beyond_the_widest_words_is_refused():
    with pytest.raises(BudgetError) as caught:
        fit("samples", max_error=1 / 64 + 1e-7)
    assert "conventional for the left camera reaches 0.0158 px and no less" in str(caught.value)
    assert caught.value.reached > 1 / 64


UNUSUAL = {
    "strong_k3": ("radtan", [-0.3, 0.1, 0.0, 0.0, 5.0]),
    "no_effect": ("radtan", [1e-30, 0.0, 0.0, 0.0, 0.0]),
    "weak_p1": ("radtan", [0.0, 0.0, 1e-15, 0.001, 0.0]),
    "weak_k4": ("rational", [-0.3, 0.1, 0.0, 0.0, 0.0, 1e-17, 0.0, 0.0]),
    "quotient_of_one": ("rational", [0.1, 0.2, 0.0, 0.0, 0.3, 0.1, 0.2, 0.3]),
}


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_lenses_are_exact_too(name):
    view = views("samples", 96, 72)["left"]
    model, D = UNUSUAL[name]
    view = replace(view, camera=Camera(model, view.camera.K, np.array(D)))
    datapath = DATAPATHS["conventional"].fit(view, 5, 0.05)
    assert worst(view, datapath) <= 0.05
    assert all(q.width >= 1 for q in datapath.formats.values())


def test_hardware_of_a_lens_without_effect_computes_the_integer_model():
    view = views("samples", 24, 18)["left"]
    view = replace(view, camera=Camera("radtan", view.camera.K, np.array([1e-30, 0, 0, 0, 0])))
    datapath = DATAPATHS["conventional"].fit(view, 5, 0.05)
    assert_same(run(replace(datapath, dsp=False), 1, pauses(0.2, seed=1), pauses(0.2, seed=2)), datapath)


@pytest.mark.parametrize("name, width, height, rows", [("samples", 3840, 2160, 200), ("rational", 8192, 1024, 48)])
def test_large_frames_have_room(name, width, height, rows):
    # Full width, and rows from the middle, which have less to compute.
    view = views(name, width, height)["left"]
    up = np.array([[1, 0, 0], [0, 1, (rows - height) / 2], [0, 0, 1]])
    camera = replace(view.camera, K=up @ view.camera.K, size=(view.width, rows))
    view = replace(view, camera=camera, P=up @ view.P, height=rows)
    datapath = DATAPATHS["conventional"].fit(view, 8)
    assert worst(view, datapath) <= default_budget(8)


@pytest.mark.parametrize(
    "D, problem",
    [
        ([0.0, 0.0, 0.0, 0.0, 1e4], "conventional for the left camera reaches"),
        ([1e-7, 0.0, 0.0, 0.0, 0.0, -30.0, 0.0, 0.0], "the lens model divides by 0 within the frame"),
    ],
)
def test_lenses_that_need_more_than_int64_are_refused(D, problem):
    view = views("samples", 96, 72)["left"]
    model = "rational" if len(D) == 8 else "radtan"
    with pytest.raises(InputError) as caught:
        DATAPATHS["conventional"].fit(replace(view, camera=Camera(model, view.camera.K, np.array(D))), 8)
    assert problem in str(caught.value)
