import json
from importlib import resources

import pytest

from hdl import calibration
from hdl.arithmetic.cuts import PIPELINES
from hdl.core import clock
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.rectification import rectify


def row(datapath, pipeline, width, ns, mhz, lens=False):
    core = {"datapath": datapath, "lens": lens, "pipeline": pipeline, "width": width, "height": width * 3 // 4}
    return {**core, "xc7": {"ns": ns}, "ecp5": {"median": mhz}}


ROWS = [
    row("proposed", "compact", 640, 10.0, 50.0),
    row("proposed", "balanced", 640, 5.0, 110.0),
    row("proposed", "fast", 640, 4.0, 150.0),
    row("spline", "balanced", 640, 5.5, 105.0, lens=True),
    row("spline", "balanced", 1920, 6.0, 95.0, lens=True),
    row("proposed", "balanced", 1920, 5.0, 90.0),
]


def test_the_record_has_cores_of_every_pipeline():
    rows = json.loads(resources.files("hdl.core").joinpath(clock.RECORD).read_text())["rows"]
    assert {row["pipeline"] for row in rows} == PIPELINES.keys()
    # A table of that frame is not built.
    measured = {row["datapath"] for row in rows if row["pipeline"] == Options.pipeline}
    assert measured == DATAPATHS.keys() - {"table"}
    assert all(kind.mhz(row) > 1 for kind in clock.FAMILIES.values() for row in rows if row[kind.name])


@pytest.fixture(autouse=True)
def record(monkeypatch):
    monkeypatch.setattr(clock, "_rows", lambda: ROWS)


@pytest.mark.parametrize(
    "datapath, lens, width, family, mhz, like",
    [
        ("proposed", False, 640, "xc7", 200.0, "proposed, balanced, 640x480"),
        ("proposed", False, 320, "ecp5", 110.0, "proposed, balanced, 640x480"),
        ("proposed", False, 641, "ecp5", 90.0, "proposed, balanced, 1920x1440"),
        # Wider than all that was measured of it, or never measured: the slowest of all of that frame.
        ("proposed", False, 3840, "xc7", 166.7, "spline with the lens, balanced, 1920x1440"),
        ("spline", True, 640, "ecp5", 105.0, "spline with the lens, balanced, 640x480"),
        ("spline", False, 640, "ecp5", 105.0, "spline with the lens, balanced, 640x480"),
        ("table", False, 800, "ecp5", 90.0, "proposed, balanced, 1920x1440"),
    ],
)
def test_a_core_is_as_fast_as_the_slowest_of_those_most_like_it(datapath, lens, width, family, mhz, like):
    found = clock.reached(datapath, "balanced", lens, width, family)
    assert found.mhz == mhz
    assert found.basis == f"{clock.FAMILIES[family].how}: {like}"


@pytest.mark.parametrize("mhz, name", [(1, "compact"), (50, "compact"), (50.1, "balanced"), (150, "fast")])
def test_the_shallowest_pipeline_that_is_fast_enough_is_taken(mhz, name):
    assert clock.shallowest(mhz, "proposed", False, 640, "ecp5") is PIPELINES[name]


def test_a_clock_that_no_pipeline_reaches_is_refused_with_the_nearest():
    with pytest.raises(InputError) as refusal:
        clock.shallowest(150.1, "proposed", False, 640, "ecp5")
    basis = f"{clock.FAMILIES['ecp5'].how}: proposed, fast, 640x480"
    problem = f"no pipeline of proposed reaches it; the nearest, fast, reaches 150 MHz by {basis}"
    assert str(refusal.value) == f"--clock: 150.1: {problem}"


def test_the_plan_says_what_clock_and_on_what_basis():
    view = rectify(calibration.embedded((64, 48)), lens=False)["left"]
    options = Options("proposed", clock=120.0, family="ecp5")
    core = build(view, options, "core")
    assert core.plan.pipeline.model_dump() == {
        "name": "fast",
        "mhz": 150.0,
        "basis": f"{clock.FAMILIES['ecp5'].how}: proposed, fast, 640x480",
    }
    assert core.parameters.pipeline is PIPELINES["fast"]
    with pytest.raises(InputError, match="^--clock: 151: "):
        build(view, Options("proposed", clock=151.0, family="ecp5"), "core")


def test_saving_look_up_tables_takes_memories_of_a_bit_and_another_interpolator():
    view = rectify(calibration.embedded((64, 48)), lens=False)["left"]
    core, lean = (build(view, Options("proposed", optimise=goal), "core") for goal in ("balanced", "lut"))
    assert core.parameters.line_buffer.bank.slice_width == 8 and lean.parameters.line_buffer.bank.slice_width == 1
    assert lean.plan.optimise == "lut" and lean.plan.pipeline.name == core.plan.pipeline.name == "balanced"
