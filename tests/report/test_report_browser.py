"""The report in a browser: the slider, the widths it is read at, and nothing that the console complains of.

Screenshots stay under build/screenshots.
"""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from report_pages import measured, write_cores

from hdl.core.build import Options
from hdl.report.page import page

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium")
SCREENSHOTS = Path("build/screenshots").resolve()
pytestmark = pytest.mark.skipif(not CHROMIUM, reason="Chromium is not installed (Debian: chromium)")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = write_cores(tmp_path_factory.mktemp("cores"), Options(max_error=0.1))
    (folder / "report.html").write_text(page(measured(folder)), encoding="utf-8")
    return (folder / "report.html").as_uri()


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as tools:
        # Chromium's sandbox does not start for root.
        arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
        with tools.chromium.launch(executable_path=CHROMIUM, args=arguments) as browser:
            yield browser


@pytest.fixture
def opened(browser, address):
    """Opens the page; everything that the console says, and everything it asks for, fails the test."""
    said, asked, contexts = [], [], []

    def call(width=1600, **settings):
        contexts.append(browser.new_context(viewport={"width": width, "height": 900}, **settings))
        found = contexts[-1].new_page()
        found.on("console", lambda message: said.append(message.text))
        found.on("pageerror", lambda error: said.append(str(error)))
        found.on("request", lambda request: asked.append(request.url))
        found.goto(address)
        return found

    yield call
    for context in contexts:
        context.close()
    assert said == []
    assert [url for url in asked if url != address and not url.startswith("data:")] == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1600])
def test_the_page_fits_its_window(opened, width, scheme):
    found = opened(width, color_scheme=scheme)
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    found.screenshot(path=SCREENSHOTS / f"report-{width}-{scheme}.png", full_page=True)
    assert found.evaluate("document.documentElement.scrollWidth") == width
    for name in ("compare", "core", "conditions"):
        box = found.locator(f"#{name}").bounding_box()
        assert box["width"] > 300 and box["x"] >= 0 and box["x"] + box["width"] <= width
    shown = [found.locator(f".diagram.{kind}").is_visible() for kind in ("wide", "narrow")]
    assert shown == [width == 1600, width == 400]
    surface = found.evaluate("getComputedStyle(document.body).backgroundColor")
    assert surface == ("rgb(255, 255, 255)" if scheme == "light" else "rgb(20, 23, 27)")


@pytest.mark.parametrize("width", [400, 1600])
def test_every_verdict_and_caption_can_be_read_without_scrolling(opened, width):
    found = opened(width)
    verdicts = found.locator("#ladder tbody tr")
    assert verdicts.count() >= 4
    for row in verdicts.all():
        shown = [text for text in row.locator(".verdict").all() if text.is_visible()]
        assert len(shown) == 1 and shown[0].inner_text()
        box = shown[0].bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= width
    for caption in found.locator("caption").all():
        box = caption.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= width


def test_every_picture_is_shown(opened):
    found = opened()
    assert found.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
    assert found.evaluate("document.images.length") == 4
    heights = found.evaluate(
        "[...document.querySelectorAll('svg.chart')].map(svg => svg.getBoundingClientRect().height)"
    )
    assert len(heights) == 8 and min(heights) > 150


def picture(found):
    data = found.locator("#compare").screenshot()
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE).astype(int)


def test_each_side_of_the_divider_is_named_while_it_is_there(opened):
    found = opened()
    assert found.locator(".tag").all_inner_texts() == ["before", "after"] * 2
    width = round(found.locator("#compare .view").first.bounding_box()["width"])

    def written():
        """Whether something is written in the left, in the right, upper corner of the left picture."""
        pictures = []
        for visibility in ("visible", "hidden"):
            found.evaluate(f"document.querySelectorAll('.tag').forEach(tag => tag.style.visibility = '{visibility}')")
            pictures.append(picture(found)[:30])
        changed = pictures[0] != pictures[1]
        return bool(changed[:, :70].any()), bool(changed[:, width - 70 : width].any())

    slider = found.get_by_role("slider")
    for value, expected in (("50", (True, True)), ("100", (True, False)), ("0", (False, True))):
        slider.fill(value)
        assert written() == expected


def test_the_slider_shows_the_frames_before_and_after(opened):
    found = opened()
    slider = found.get_by_role("slider")
    slider.focus()
    slider.press("End")
    before = picture(found)
    slider.press("Home")
    after = picture(found)
    slider.press("ArrowRight")
    assert slider.get_attribute("aria-valuetext") == "99 % of each picture rectified"
    slider.fill("50")
    half = picture(found)
    assert np.abs(before - after).mean() > 5
    # Of the left picture: what is left of its divider is as it came, the rest rectified.
    width = before.shape[1] // 2
    first, second = slice(5, round(0.45 * width)), slice(round(0.55 * width), round(0.97 * width))
    assert np.abs(half - before)[:, first].mean() < 1 < np.abs(half - after)[:, first].mean()
    assert np.abs(half - after)[:, second].mean() < 1 < np.abs(half - before)[:, second].mean()


def test_on_paper_both_frames_are_shown_whole(opened):
    found = opened(794)
    found.emulate_media(media="print")
    tops = found.evaluate("[...document.querySelectorAll('.view img')].map(image => image.getBoundingClientRect().top)")
    after, before = tops[:2]
    assert before + 50 < after
    assert not found.get_by_role("slider").is_visible()


def test_motion_is_reduced_where_that_is_wanted(opened):
    behaviour = "getComputedStyle(document.documentElement).scrollBehavior"
    assert opened(reduced_motion="reduce").evaluate(behaviour) == "auto"
    assert opened(reduced_motion="no-preference").evaluate(behaviour) == "smooth"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_contrast(opened, scheme):
    found = opened(color_scheme=scheme)
    colours = found.evaluate(
        """() => {
            const style = getComputedStyle(document.documentElement);
            return Object.fromEntries(["surface", "raised", "warn", "ink", "muted", "left", "right", "accent"].map(
                name => [name, style.getPropertyValue("--" + name).trim()]));
        }"""
    )
    for text, least in (("ink", 7), ("muted", 4.5), ("left", 4.5), ("right", 4.5), ("accent", 4.5)):
        for ground in ("surface", "raised"):
            assert contrast(colours[text], colours[ground]) >= least, (text, ground)
    assert contrast(colours["ink"], colours["warn"]) >= 7


def contrast(one, other):
    """Of two colours #rrggbb. Source: WCAG 2, relative luminance."""

    def luminance(colour):
        parts = [int(colour[start : start + 2], 16) / 255 for start in (1, 3, 5)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    dark, light = sorted(map(luminance, (one, other)))
    return (light + 0.05) / (dark + 0.05)
