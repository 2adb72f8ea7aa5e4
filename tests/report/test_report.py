"""The report: its figures against the plan and the models, the page it makes of them, and what it refuses."""

import json
import re
import shutil
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from report_pages import CACHE, SIDES

from hdl.cli import run
from hdl.report import figures
from hdl.report.__main__ import report as command
from hdl.report.page import page
from hdl.tools.xc7_timing import MODEL
from sim.rows import Withheld


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
    text = words(html)
    for camera in report.cameras.values():
        error = camera.plan.error
        for value in (error.u.mean, error.u.max, error.v.mean, error.v.max):
            assert f"{value:.4f}" in text
        assert f"{camera.plan.line_buffer.rows} rows kept, from D_lo = {camera.plan.line_buffer.d_lo}" in text
        assert camera.plan.verilog_sha256 in text
    assert "calibration's unit" in text and "add_files { rectify_left.v rectify_right.v }" in html


def words(html):
    """The text that a reader sees."""
    return " ".join(unescape(re.sub(r"<(style|script|svg).*?</\1>|<[^>]*>", " ", html, flags=re.DOTALL)).split())


def test_each_cameras_latency_and_memory_is_its_own(report, html):
    text = words(html)
    timing = [figures.timing(camera.core, 100.0) for camera in report.cameras.values()]
    memory = [figures.memory(camera.core) for camera in report.cameras.values()]
    assert len({found["latency_cycles"] for found in timing}) == 2
    lines, times = (", ".join(f"{found[name]:.1f}" for found in timing) for name in ("latency_lines", "latency_us"))
    assert f"latency, left, right {lines} lines {times} \N{MICRO SIGN}s at 100 MHz" in text
    assert f"{memory[0]['kib']:.2g} + {memory[1]['kib']:.2g} KiB; a whole frame would be 6 KiB" in text
    assert " 0 KiB" not in text and "0 + 0 KiB" not in text


def test_rows_are_a_headline_only_where_the_images_bear_it(report, html):
    rows = report.rows
    assert f"row difference, {rows.before.mean:.1f} px before {rows.after.mean:.3f} px mean over " in words(html)
    assert rows.sentence() in words(html)
    withheld = replace(report, rows=Withheld("only 3 points are found in both images; 30 are needed"))
    text = words(page(withheld))
    assert "row difference," not in text
    assert "How far rows differ cannot be said: only 3 points are found in both images; 30 are needed. " in text
    found = withheld.figures()
    assert found["row_difference"] is None
    assert found["row_difference_withheld"] == "only 3 points are found in both images; 30 are needed"


def test_a_calibration_that_leaves_rows_apart_is_a_warning(report, html):
    apart = report.rows._replace(exact=report.rows.after._replace(mean=4.0))
    assert apart.suspicious and apart.suspicious[1:] in words(page(replace(report, rows=apart)))
    assert "is the calibration of these cameras" not in words(html)


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


def test_one_camera_has_a_report_without_stereo_and_without_a_word_into_its_folder(folder, run_command):
    (folder / "cache").unlink()
    (folder / "cache").touch()  # no cache can be made here
    Path("out").mkdir()
    Path("out/cache").symlink_to(CACHE)
    for suffix in (".v", ".json"):
        (folder / f"rectify_left{suffix}").unlink()
    cv2.imwrite("R.png", np.random.default_rng(1).integers(0, 255, (64, 96), np.uint8))
    status, _, err = run_command("f --no-synthesis --right R.png --output out/page.html")
    assert (status, err) == (0, "")
    (folder / "cache").unlink()
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


def test_video_formats_are_compared_with_the_models_clock(report, html):
    text = words(html)
    assert "Left: 125 MHz, the longest path 8.0 ns, line_buffer to bilinear. Right: 80 MHz, " in text
    assert f"This is {MODEL}: " in text and "What this page says of 100 MHz is of a higher clock." in text
    for row in (
        "VGA 640 x 480 60 25.175 +397 % +218 %",
        "720p 1280 x 720 60 74.25 +68 % +8 %",
        "SXGA 1280 x 1024 60 108 +16 % -26 %, not met",
        "1080p 1920 x 1080 60 148.5 -16 %, not met -46 %, not met",
    ):
        assert row in text
    assert "pixel clock" in text and "need a core of their own" in text
    found = report.figures()["cameras"]["right"]["clock"]
    assert (found["mhz"], found["path_ns"], found["model"]) == (80, 12.5, MODEL)
    assert [entry["met"] for entry in found["formats"]] == [True] * 5 + [False] * 2
    slow = replace(report, clock_mhz=80.0)
    assert "is of a higher clock" not in words(page(slow))


def test_without_synthesis_no_clock_is_claimed(report):
    cameras = {side: replace(camera, resources=None, path=None) for side, camera in report.cameras.items()}
    bare = replace(report, cameras=cameras)
    assert MODEL not in page(bare) and words(page(bare)).count("Not synthesised for this page") == 2
    assert bare.figures()["cameras"]["left"]["clock"] is None


def test_sides_come_left_first(report):
    assert tuple(report.cameras) == SIDES
