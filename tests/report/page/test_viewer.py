"""The page of a study works in a real browser: from a file, without a graphics card, on a phone, in the dark."""

from __future__ import annotations

import io
import os
import re
import shutil

import numpy as np
import pytest
from PIL import Image

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
DEVICES = {
    "desktop": {"viewport": {"width": 1200, "height": 900}, "color_scheme": "light"},
    "phone in the dark": {
        "viewport": {"width": 390, "height": 800},
        "color_scheme": "dark",
        "is_mobile": True,
        "has_touch": True,
        "device_scale_factor": 2,
    },
}

pytestmark = pytest.mark.skipif(
    CHROMIUM is None and os.environ.get("TAXEL_BROWSER") != "required", reason="there is no Chromium here"
)


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(params=DEVICES)
def opened(request, browser, page):
    """The page on each device, and the complaints that its console has shown."""
    with browser.new_context(**DEVICES[request.param]) as context:
        tab = context.new_page()
        complaints = []
        tab.on("console", lambda message: complaints.append(message.text))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("request", lambda asked: asked.url.startswith(("file:", "data:")) or complaints.append(asked.url))
        tab.goto(page.as_uri())
        drawn(tab, "cell = parallelepiped|2")
        yield tab
        assert complaints == []


def drawn(tab, what):
    """Wait until the viewer has drawn a panel's step, at its full sharpness."""
    tab.wait_for_function("what => document.getElementById('viewer').dataset.drawn === what", arg=what)
    tab.wait_for_timeout(400)


def part(tab, name):
    return tab.locator(f'[data-part="{name}"]')


def picture(tab):
    """(height, width, 3) of the viewer."""
    return np.asarray(Image.open(io.BytesIO(part(tab, "canvas").screenshot())).convert("RGB")).astype(int)


def difference(one, other):
    """Share of the pixels that differ."""
    return float(np.mean(np.abs(one - other).max(axis=2) > 24))


def like(shown, colour):
    """How many pixels have about a colour."""
    return int(np.sum(np.abs(shown - np.array(colour)).max(axis=2) <= 12))


def test_the_slider_moves_the_pad(opened):
    pressed = picture(opened)
    assert "fz = -1 N" in part(opened, "words").inner_text()
    part(opened, "step").focus()
    opened.keyboard.press("Home")
    drawn(opened, "cell = parallelepiped|0")
    rest = picture(opened)
    assert "fz = 0 N; largest displacement 0 mm" in part(opened, "words").inner_text()
    assert difference(pressed, rest) > 0.05
    opened.keyboard.press("ArrowRight")
    drawn(opened, "cell = parallelepiped|1")
    assert 0 < difference(picture(opened), rest)
    assert part(opened, "step").get_attribute("aria-valuetext") == "fz = -0.5 N"


def test_the_cut_shows_the_inside(opened):
    mauve, red, green, orange = (178, 120, 140), (255, 60, 30), (0, 158, 115), (213, 94, 0)
    shown = picture(opened)
    assert like(shown, mauve) > 0.01 * shown.shape[0] * shown.shape[1]
    assert like(shown, red) > 4 and like(shown, green) > 4 and like(shown, orange) > 20
    part(opened, "rays").uncheck()
    opened.wait_for_timeout(400)
    assert like(picture(opened), orange) < 5 and "light paths" not in part(opened, "words").inner_text()
    part(opened, "cut").focus()
    opened.keyboard.press("Home")
    opened.wait_for_timeout(700)
    whole = picture(opened)
    assert like(whole, mauve) < 0.001 * whole.shape[0] * whole.shape[1]
    assert "shown whole" in part(opened, "words").inner_text()


def test_deformation_can_be_magnified_and_the_picture_says_so(opened):
    once = picture(opened)
    part(opened, "magnify").select_option("10")
    opened.wait_for_timeout(700)
    assert difference(once, picture(opened)) > 0.02
    words = part(opened, "words").inner_text()
    assert "deformation 10 times as large" in words and "light paths" not in words
    part(opened, "magnify").select_option("1")
    opened.wait_for_timeout(700)
    assert difference(once, picture(opened)) == 0


def test_keys_turn_the_pad_and_colours_follow_the_choice(opened):
    before = picture(opened)
    part(opened, "canvas").focus()
    for _ in range(4):
        opened.keyboard.press("ArrowLeft")
    opened.wait_for_timeout(700)
    turned = picture(opened)
    assert difference(before, turned) > 0.05
    part(opened, "colouring").select_option("region")
    opened.wait_for_timeout(700)
    assert difference(turned, picture(opened)) > 0.05 and not part(opened, "legend").is_visible()
    part(opened, "panel").select_option("1")
    drawn(opened, "cell = cylindrical|2")


def test_all_is_there_and_nothing_is_wider_than_the_screen(opened):
    assert opened.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert opened.evaluate("[...document.images].every(image => image.naturalWidth > 100)")
    assert part(opened, "canvas").get_attribute("aria-label").startswith("Deformed pad: fz = -1 N")
    for link in opened.locator("nav a").all():
        assert opened.locator(link.get_attribute("href")).count() == 1
    controls = "[...document.querySelectorAll('input,select,button')]"
    assert opened.evaluate(f"{controls}.every(one => (one.labels && one.labels.length) || one.ariaLabel)")


@pytest.mark.parametrize("width", [390, 768, 1200])
def test_plots_and_legends_are_in_view_and_tables_scroll_in_themselves(browser, page, width):
    """Letters of 10 points, as plots have them, are at least 8 pixels high on the screen."""
    with browser.new_context(viewport={"width": width, "height": 800}) as context:
        tab = context.new_page()
        tab.goto(page.as_uri())
        drawn(tab, "cell = parallelepiped|2")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        plots = tab.evaluate(
            "[...document.querySelectorAll('img.plot')].map((one) => [one.getBoundingClientRect().left,"
            " one.getBoundingClientRect().right, one.naturalWidth, one.naturalHeight])"
        )
        assert len(plots) == 5
        for left, right, natural, tall in plots:
            assert left >= 0 and right <= width and 10 * 96 / 72 * (right - left) / natural >= 8
            assert width > 640 or tall > 0.8 * natural  # panels below each other
        boxes = tab.evaluate(
            "[...document.querySelectorAll('.scroll')].filter((one) => one.clientWidth)"
            ".map((one) => [one.clientWidth, one.scrollWidth,"
            " one.querySelector('caption').getBoundingClientRect().right])"
        )
        assert boxes and all(inner <= width and caption <= width for inner, _, caption in boxes)
        assert width > 400 or any(whole > inner for inner, whole, _ in boxes)


def luminance(colour):
    parts = np.array(colour) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_light_and_dark_differ_and_can_be_read(opened):
    colours = opened.evaluate(
        "[getComputedStyle(document.body).color, getComputedStyle(document.body).backgroundColor]"
    )
    darker, lighter = sorted(luminance([int(part) for part in re.findall("[0-9]+", colour)]) for colour in colours)
    contrast = (lighter + 0.05) / (darker + 0.05)
    assert contrast > 7  # Web Content Accessibility Guidelines 2.1, 1.4.6
    dark = opened.evaluate("matchMedia('(prefers-color-scheme: dark)').matches")
    ground = np.asarray(Image.open(io.BytesIO(opened.screenshot())).convert("L"))[2, 2]
    assert (ground < 60) if dark else (ground > 200)
