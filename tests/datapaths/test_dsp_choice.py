"""--dsp/--no-dsp: who makes the products."""

import re
from functools import cache

import pytest
import rigs
from click.testing import CliRunner

from hdl import calibration
from hdl.arithmetic.cost import dsp_blocks
from hdl.arithmetic.cuts import COMPACT, PIPELINES
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.datapaths.selection import choose, fit
from hdl.generate import generate
from hdl.geometry.rectification import rectify
from hdl.tools.verilog import convert

LENS_OR_NOT = pytest.mark.parametrize("lens", [True, False])


@cache
def core(dsp, lens):
    view = rectify(calibration.embedded((64, 48)), lens=lens)["left"]
    return build(view, Options("conventional", 0.1, dsp=dsp), "core")


@LENS_OR_NOT
@pytest.mark.parametrize("dsp", [True, False])
def test_the_verilog_multiplies_only_if_the_tool_may(dsp, lens):
    # The bilinear interpolation has no multiplication to leave.
    assert core(dsp, lens).plan.dsp == dsp
    assert bool(re.search(r" \* ", core(dsp, lens).verilog)) == dsp


@LENS_OR_NOT
@pytest.mark.parametrize("dsp", [True, False])
@pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)
def test_registers_within_products_change_nothing_about_that(dsp, lens, pipeline):
    datapath = core(dsp, lens).parameters.datapath.with_pipeline(pipeline)
    assert bool(re.search(r" \* ", convert(datapath.component(), "datapath"))) == dsp
    assert bool(datapath.cost.dsp) == dsp


@LENS_OR_NOT
def test_both_compute_the_same(lens):
    with_dsp, without = (core(dsp, lens).parameters.datapath for dsp in (True, False))
    assert with_dsp.coordinates.u.tolist() == without.coordinates.u.tolist()
    assert with_dsp.coordinates.v.tolist() == without.coordinates.v.tolist()
    # Registers within products are others in DSP blocks than between rows of adders.
    assert with_dsp.with_pipeline(COMPACT).latency == without.with_pipeline(COMPACT).latency


@LENS_OR_NOT
def test_products_cost_dsp_blocks_or_look_up_tables(lens):
    with_dsp, without = (core(dsp, lens).parameters.datapath.cost for dsp in (True, False))
    assert with_dsp.dsp >= (6 + 6 if lens else 6)
    assert without.dsp == 0
    assert without.lut > with_dsp.lut


@pytest.mark.parametrize("name", [name for name in DATAPATHS if name != "conventional"])
def test_what_does_not_multiply_is_the_same_either_way(name):
    view = rigs.view("samples", "left", 32, 24)
    budget = None if name == "accumulate" else 8.0
    assert [fit(name, view, 5, budget, dsp).cost for dsp in (True, False)] == [fit(name, view, 5, budget).cost] * 2


def test_auto_judges_what_was_asked_for():
    view = rigs.view("samples", "left", 32, 24)
    costs = {}
    for dsp in (True, False):
        (entry,) = (entry for entry in choose(view, 5, 0.1, "lut", dsp=dsp) if entry.name == "conventional")
        costs[dsp] = entry.cost
    assert costs[True].dsp == 6
    assert costs[False].dsp == 0


def test_command_line_has_the_choice(tmp_path):
    command = ["--size", "64x48", "--camera", "left", "--no-lens", "--datapath", "conventional"]
    for choice in ("--dsp", "--no-dsp"):
        result = CliRunner().invoke(generate, [*command, choice, "--output", str(tmp_path / choice)])
        assert result.exit_code == 0, result.output
        verilog = (tmp_path / choice / "rectify_left.v").read_text()
        assert bool(re.search(r" \* ", verilog)) == (choice == "--dsp")


@pytest.mark.parametrize("a, b, blocks", [(18, 25, 1), (25, 18, 1), (19, 19, 2), (26, 18, 2), (30, 30, 4), (2, 2, 1)])
def test_a_block_takes_25_by_18_bits(a, b, blocks):
    assert dsp_blocks(a, b) == blocks


@pytest.mark.parametrize("dsp", [True, False])
def test_the_plan_of_auto_has_the_costs_of_what_was_asked_for(dsp):
    plan = build(rigs.view("samples", "left", 32, 24), Options(max_error=0.1, dsp=dsp), "core").plan
    (entry,) = (entry for entry in plan.considered if entry.datapath == "conventional")
    assert bool(entry.cost.dsp) == dsp
