import numpy as np
import pytest
import rigs
from amaranth.lib import wiring
from datapath_runs import assert_same, run

from hdl.arithmetic.cuts import PIPELINES
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import Datapath, default_budget
from sim import reference
from sim.drivers import never, pauses, simulate

# What a datapath computes that follows an equation, in float64: source columns and rows of all pixels.
EQUATIONS = {
    "conventional": lambda view: reference.projective(rigs.matrix(view), view.width, view.height),
    "accumulate": lambda view: reference.projective(rigs.matrix(view), view.width, view.height),
    "proposed": lambda view: reference.proposed(rigs.matrix(view), view.width, view.height),
}


def fitted(name, view, fraction_bits):
    # What is fitted to the map, rather than computes it, may find frames as small as these too much bent.
    return DATAPATHS[name].fit(view, fraction_bits, None if name in EQUATIONS else 4.0)


@pytest.mark.parametrize("name", DATAPATHS)
@pytest.mark.parametrize(
    "rig, side, width, height, fraction_bits",
    [
        ("samples", "left", 24, 18, 5),
        ("samples", "right", 17, 19, 8),
        ("samples_whole", "left", 20, 16, 5),
        ("rolled", "left", 21, 13, 4),
        ("rolled", "right", 16, 11, 5),
        ("toed_in", "left", 23, 14, 5),
        ("toed_in", "right", 20, 15, 3),
        ("looks_up", "left", 16, 12, 6),
        ("looks_down", "right", 19, 12, 5),
        ("zoomed", "left", 18, 13, 7),
    ],
)
def test_hardware_computes_the_integer_model(name, rig, side, width, height, fraction_bits):
    datapath = fitted(name, rigs.view(rig, side, width, height), fraction_bits)
    assert_same(run(datapath, 2, pauses(0.2, seed=width, burst=2), pauses(0.2, seed=height)), datapath)


@pytest.mark.parametrize("name, dsp", [*((name, True) for name in DATAPATHS), ("conventional", False)])
@pytest.mark.parametrize("pipeline", [pipeline for pipeline in PIPELINES if pipeline != "compact"])
def test_hardware_computes_the_integer_model_in_every_pipeline(name, dsp, pipeline):
    compact = fitted(name, rigs.view("toed_in", "right", 20, 15), 5).with_dsp(dsp)
    datapath = compact.with_pipeline(PIPELINES[pipeline])
    assert_same(run(datapath, 2, pauses(0.2, seed=3, burst=2), pauses(0.2, seed=4)), datapath)
    np.testing.assert_array_equal(datapath.coordinates.u, compact.coordinates.u)
    np.testing.assert_array_equal(datapath.coordinates.v, compact.coordinates.v)
    # Registers cost flip-flops.
    assert (datapath.latency > compact.latency) == (datapath.cost.ff > compact.cost.ff)


@pytest.mark.parametrize("name", DATAPATHS)
def test_frame_after_frame_is_the_same(name):
    datapath = fitted(name, rigs.view("toed_in", "left", 14, 9), 5)
    results = run(datapath, 25, pauses(0.05, seed=1), pauses(0.05, seed=2))
    assert len(results) == 25
    assert_same(results, datapath)


@pytest.mark.parametrize("name", DATAPATHS)
def test_a_position_can_be_taken_in_every_clock(name):
    datapath = DATAPATHS[name].fit(rigs.view("samples", "right", 20, 17), 5)
    assert_same(run(datapath, 2, never(), never()), datapath)


@pytest.mark.parametrize("name", EQUATIONS)
@pytest.mark.parametrize("side", rigs.SIDES)
@pytest.mark.parametrize("fraction_bits", [3, 5, 8])
@pytest.mark.parametrize("rig", rigs.NAMES)
def test_model_is_the_equation_within_rounding(name, side, fraction_bits, rig):
    for size in ((24, 18), (320, 240)):
        view = rigs.view(rig, side, *size)
        coordinates = DATAPATHS[name].fit(view, fraction_bits).coordinates
        assert coordinates.u.shape == coordinates.v.shape == (view.height, view.width)
        for used, exact in zip((coordinates.u, coordinates.v), EQUATIONS[name](view)):
            # Half a unit of the fraction is 1/64 px at 5 bits.
            assert np.abs(used / 2.0**fraction_bits - exact).max() <= 0.5 / 2**fraction_bits + 0.002


@pytest.mark.parametrize("name", EQUATIONS)
@pytest.mark.parametrize("side", rigs.SIDES)
def test_model_is_the_equation_on_a_vga_frame(name, side):
    view = rigs.view("samples", side, 640, 480)
    coordinates = DATAPATHS[name].fit(view, 5).coordinates
    for used, exact in zip((coordinates.u, coordinates.v), EQUATIONS[name](view)):
        assert np.abs(used / 32 - exact).max() <= 1 / 64 + 0.002


@pytest.mark.parametrize("name", DATAPATHS)
@pytest.mark.parametrize("rig", rigs.NAMES)
def test_coordinates_do_not_overflow(name, rig):
    for side in rigs.SIDES:
        datapath = DATAPATHS[name].fit(rigs.view(rig, side, 160, 120), 5)
        for q, values in zip(datapath.coordinate_formats, (datapath.coordinates.u, datapath.coordinates.v)):
            assert q.fraction_bits == 5
            assert rigs.fits(q, values)


@pytest.mark.parametrize("name", DATAPATHS)
def test_interface_is_that_of_every_datapath(name):
    datapath = DATAPATHS[name].fit(rigs.view("samples"), 5)
    assert isinstance(datapath, Datapath)
    assert datapath.name == name
    assert (datapath.width, datapath.height, datapath.fraction_bits) == (24, 18, 5)
    component = datapath.component()
    simulate(component, clocks=1)
    assert component.signature.members == datapath.signature.members
    assert {member: str(port.flow) for member, port in datapath.signature.members.items()} == {
        **dict.fromkeys("enable step x y end_of_line end_of_frame".split(), "In"),
        **dict.fromkeys("uv", "Out"),
    }
    u, v = datapath.coordinate_formats
    assert datapath.signature.members["u"] == wiring.Out(u.shape)
    assert datapath.signature.members["v"] == wiring.Out(v.shape)


def test_latencies_at_vga():
    view = rigs.view("samples", "left", 640, 480)
    # u, up to 639 px with 5 fraction bits and some px of bias, is 15 bits of quotient.
    assert {name: DATAPATHS[name].fit(view, 5).latency for name in EQUATIONS} == {
        "conventional": 17,
        "accumulate": 15,
        "proposed": 0,
    }


def test_default_budget_is_the_rounding_and_a_little_arithmetic():
    assert default_budget(5) == 1 / 64 + 0.002
    assert default_budget(8) == 1 / 512 + 0.002
