"""Plans read back from a folder: what is refused, in which words, and what a core rebuilt from its plan is."""

import dataclasses
import hashlib
import shutil

import numpy as np
import pytest
from report_pages import edit, write_cores

from hdl import calibration
from hdl.core.build import Options
from hdl.core.plan import Plan
from hdl.core.plan_file import load_folder, stereo_rig
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.coordinates import Border

PROPOSED = Options(datapath="proposed")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_cores(tmp_path_factory.mktemp("cores"), PROPOSED, lens=False)


@pytest.fixture
def folder(written, tmp_path, monkeypatch):
    """A copy of a folder with both cores, called ``f`` in messages."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(written, tmp_path / "f")
    return tmp_path / "f"


def refusal(path="f"):
    """What is said of a folder whose cores are loaded and rebuilt."""
    with pytest.raises(InputError) as error:
        for core in load_folder(path).values():
            core.rebuild()
    return str(error.value)


@pytest.mark.parametrize(
    "options, choices",
    [
        (PROPOSED, {"lens": False}),
        (Options("spline"), {"size": (160, 120)}),
        (Options(max_error=0.02), {"lens": False}),
        (Options("conventional"), {"lens": False}),
        (Options("spline", 0.1, fraction_bits=4, channels=3), {}),
        (Options("spline", 0.1, pixel_bits=12, border=Border("constant", 100)), {"alpha": 1.0}),
        (Options("accumulate", fraction_bits=7, border=Border("replicate")), {"lens": False, "alpha": 1.0}),
    ],
    ids=str,
)
def test_a_plan_rebuilds_to_the_same_core(tmp_path, options, choices):
    write_cores(tmp_path, options, sides=["right"], **choices)
    (planned,) = load_folder(tmp_path).values()
    core = planned.rebuild()
    assert core.verilog == (tmp_path / "rectify_right.v").read_text()
    assert core.plan == planned.plan


def test_a_choice_among_datapaths_rebuilds_with_the_budget_of_the_choice(tmp_path, monkeypatch):
    for name in set(DATAPATHS) - {"accumulate", "conventional"}:
        monkeypatch.delitem(DATAPATHS, name)
    write_cores(tmp_path, Options(), sides=["left"], lens=False)
    (planned,) = load_folder(tmp_path).values()
    assert planned.plan.considered and planned.plan.error.u.max > 0.03
    assert planned.rebuild().plan == planned.plan


def test_one_camera_alone_is_enough(folder):
    (folder / "rectify_left.v").unlink()
    (folder / "rectify_left.json").unlink()
    assert list(load_folder(folder)) == ["right"]


def test_other_files_are_passed_over(folder):
    (folder / "report.html").write_text("a page")
    (folder / "figures.json").write_text('{"cameras": {}}')
    (folder / "broken.json").write_text("{")
    (folder / "wrapper.v").write_text("module wrapper; endmodule\n")
    (folder / "cache").mkdir()
    assert list(load_folder(folder)) == ["left", "right"]


def test_the_rig_of_the_plans_is_the_calibrated_one(folder):
    rig, implied = calibration.embedded((96, 64)), stereo_rig(load_folder(folder))
    np.testing.assert_allclose(implied.R, rig.R, atol=1e-9)
    np.testing.assert_allclose(implied.T, rig.T, rtol=1e-9)
    np.testing.assert_array_equal(implied.left.K, rig.left.K)
    np.testing.assert_array_equal(implied.right.D, rig.right.D)


def test_a_folder_without_cores_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    assert refusal("nothing") == "nothing: there is no such folder"
    assert refusal("file") == "file: is no folder"
    assert refusal("empty") == "empty: has no core: no TOP.v with its TOP.json; python -m hdl.generate writes them"


@pytest.mark.parametrize(
    "missing, message",
    [
        ("rectify_right.v", "f/rectify_right.json: top = rectify_right: its Verilog, rectify_right.v, is missing"),
        ("rectify_left.json", "f/rectify_left.v: its plan, rectify_left.json, is missing"),
    ],
)
def test_half_a_core_is_refused(folder, missing, message):
    (folder / missing).unlink()
    assert refusal() == message


@pytest.mark.parametrize(
    "text, problem",
    [
        ("not JSON", "is not JSON: expected ident at line 1 column 2"),
        ("", "is not JSON: EOF while parsing a value at line 1 column 0"),
        ("[1, 2]", "[1, 2]: is no plan: not a JSON object"),
        ("\xff", "is not JSON: expected value at line 1 column 1"),
        ("[" * 100000, "is not JSON: recursion limit exceeded at line 1 column 202"),
    ],
    ids=["text", "empty", "list", "binary", "deep"],
)
def test_a_file_that_is_no_plan_is_refused(folder, text, problem):
    (folder / "rectify_left.json").write_text(text, encoding="latin-1")
    assert refusal() == f"f/rectify_left.json: {problem}"


def changed(*path, to):
    """An edit: the entry at ``path`` becomes ``to``."""

    def change(plan):
        *outer, last = path
        for name in outer:
            plan = plan[name]
        plan[last] = to

    return change


REBUILT = "rebuilding the core gives {}; generate it anew"


@pytest.mark.parametrize(
    "change, message",
    [
        (changed("plan_version", to=2), "plan_version = 2: plans of version 4 can be read; generate it anew"),
        (changed("note", to="mine"), "note = mine: is no field of a plan of version 4"),
        (changed("error", "u", "median", to=1), "error.u.median = 1: is no field of a plan of version 4"),
        (lambda plan: plan.pop("formats"), "formats: is missing"),
        (lambda plan: plan["error"]["v"].pop("mean"), "error.v.mean: is missing"),
        (changed("camera", "side", to="middle"), "camera.side = middle: input should be 'left' or 'right'"),
        (
            changed("camera", "K", 1, 1, to="x"),
            "camera.K[1][1] = x: input should be a valid number, unable to parse {}",
        ),
        (changed("camera", "K", 0, 0, to=float("nan")), "camera.K[0][0] = nan: input should be a finite number"),
        (changed("rectification", "P", to=[[1.0]]), "rectification.P[0] = [1.0]: list should have at least 4 {}"),
        (changed("width", to=10**9), "width = 1000000000: must be 32 to 8192"),
        (changed("height", to=0), "height = 0: must be 32 to 8192"),
        (changed("fraction_bits", to=40), "fraction_bits = 40: must be 3 to 8"),
        (changed("camera", "model", to="fovea"), "camera.model = fovea: is none of radtan, rational, {}"),
        (
            changed("camera", "D", to=[1.0]),
            "camera.D = 1 coefficients: a lens of model radtan has 0 or 4 or 5 or 8 or 12 or 14",
        ),
        (changed("datapath", to="magic"), "datapath = magic: is none of {}"),
        (changed("border", "mode", to="wrap"), "border.mode = wrap: input should be 'constant' or 'replicate'"),
        (changed("camera", "K", to=[[0.0] * 3] * 3), "camera.K = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], {}: is singular"),
        (
            changed("rectification", "P", 0, 0, to=0.0),
            "rectification.P[0][0] = 0.0: must be a positive focal length",
        ),
        (changed("error", "u", "max", to=0.001), f"error.u.max = 0.001: {REBUILT}"),
        (changed("line_buffer", "rows", to=4), f"line_buffer.rows = 4: {REBUILT}"),
        (changed("latency_cycles", to=1), f"latency_cycles = 1: {REBUILT}"),
        (changed("formats", "u", to="Q1.1"), f"formats.u = Q1.1: {REBUILT}"),
        (changed("distortion_dropped", to=None), "distortion_dropped{}"),
        (changed("camera", "K", 0, 0, to=80.5), "distortion_dropped.{}"),
        (changed("datapath", to="accumulate"), f"{{}}: {REBUILT}"),
        (changed("border", "value", to=7), "verilog_sha256 = {}: rebuilding the core gives another Verilog; {}"),
        (changed("top", to="other"), "verilog_sha256 = {}: rebuilding the core gives another Verilog; {}"),
        (
            changed("considered", to=[{"datapath": "spline", "error": 1, "cost": None, "verdict": "chosen"}]),
            "considered = spline: the chosen datapath must be proposed",
        ),
    ],
)
def test_a_plan_changed_by_hand_is_refused_with_the_field_and_its_value(folder, change, message):
    edit(folder, change)
    found = refusal()
    expected = f"f/rectify_left.json: {message}".split("{}")
    assert "\n" not in found and found.startswith(expected[0])
    for part in expected[1:]:
        assert part in found


def test_pixels_that_no_core_takes_are_refused(folder):
    for side in ("left", "right"):
        edit(folder, changed("pixel_bits", to=9), f"rectify_{side}")
    assert refusal().startswith(
        "f/rectify_left.json: --pixel-bits: 9 for --channels 1: 1 channel has 8, 10, 12 or 16 bits"
    )


def test_ends_of_lines_of_windows_are_no_change(folder):
    before = load_folder(folder)
    for file in folder.iterdir():
        file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n"))
    after = load_folder(folder)
    assert {side: (core.plan, core.verilog) for side, core in after.items()} == {
        side: (core.plan, core.verilog) for side, core in before.items()
    }


def test_verilog_changed_by_hand_is_refused(folder):
    sha = hashlib.sha256((folder / "rectify_right.v").read_bytes()).hexdigest()
    with (folder / "rectify_right.v").open("a") as file:
        file.write("// mine\n")
    found = refusal()
    assert found.startswith(f"f/rectify_right.json: verilog_sha256 = {sha}: rectify_right.v has ")
    assert found.endswith("...: the plan or the Verilog was changed; generate both anew")


def test_a_core_that_does_not_rebuild_names_the_versions_that_are_others_here(folder):
    def made_elsewhere(plan):
        plan["versions"] = {**plan["versions"], "numpy": "1.0", "abacus": "7"}
        plan["latency_cycles"] = 1

    edit(folder, made_elsewhere)
    assert refusal().endswith(f" (made with numpy 1.0, here {np.__version__}; abacus 7, here none); generate it anew")


def test_a_core_of_other_versions_that_rebuilds_is_taken(written, tmp_path):
    planned = load_folder(written)["left"]
    versions = {name: "0" for name in planned.plan.versions}
    plan = Plan.sealed(**planned.plan.model_copy(update={"versions": versions}).model_dump(exclude={"plan_sha256"}))
    assert dataclasses.replace(planned, plan=plan).rebuild().plan == plan


def test_verilog_changed_together_with_its_hash_is_refused(folder):
    file = folder / "rectify_left.v"
    file.write_text(file.read_text().replace("endmodule", "endmodule ", 1))
    edit(folder, changed("verilog_sha256", to=hashlib.sha256(file.read_bytes()).hexdigest()))
    assert refusal().endswith(": rebuilding the core gives another Verilog; generate it anew")


@pytest.mark.parametrize(
    "change, message",
    [
        (changed("height", to=48), "height = 48: rectify_left.json has 64: these two are no pair"),
        (changed("lens", to=True), "lens = True: rectify_left.json has False: these two are no pair"),
        (changed("channels", to=3), "channels = 3: rectify_left.json has 1: these two are no pair"),
        (
            changed("rectification", "P", 1, 2, to=30.0),
            "rectification.P[1][2] = 30.0: rectify_left.json has 32.033891677856445: these two are no pair",
        ),
        (
            changed("rectification", "P", 0, 3, to=9.0),
            "rectification.P[0][3] = 9.0: gives a baseline of -0.1216: the left and the right camera are exchanged, or "
            "the same",
        ),
        (changed("top", to="rectify_left"), "top = rectify_left: rectify_left.json has the same; use another --top"),
        (changed("camera", "side", to="left"), "camera.side = left: rectify_left.json is of the left camera too; keep"),
    ],
)
def test_two_cores_that_are_no_pair_are_refused(folder, change, message):
    edit(folder, change, "rectify_right")
    assert refusal().startswith(f"f/rectify_right.json: {message}")


def test_every_option_that_decides_a_core_is_in_its_plan():
    options = {field.name for field in dataclasses.fields(Options)}
    # A budget is stated under another name; the others decide which core is built and not what it is.
    assert options - Plan.model_fields.keys() == {"max_error", "clock", "family", "max_line_buffer_kib"}
