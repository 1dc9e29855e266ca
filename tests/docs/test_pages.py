"""The site is built without a warning, has an entry for everything public, and its links lead somewhere."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from forked_script import run_script
from sphinx.search.en import SearchEnglish

import mitsuba_taxel
from mitsuba_taxel.specification.plugin_pages import plugin_names, plugin_page

DOCS = Path(__file__).parents[2] / "docs"
SOURCES = sorted({*DOCS.rglob("*.md"), *DOCS.rglob("*.rst")} - {DOCS / "index.md"})


class Page(HTMLParser):
    """What a page refers to, and what in it can be referred to."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value is not None}
        self.anchors.update(given[name] for name in ("id", "name") if name in given)
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        self.loaded += [given[name] for name in ("src", "href") if name in given and tag in ("script", "img", "link")]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site."""
    folder = tmp_path_factory.mktemp("site")
    done = run_script(Path(__file__).with_name("build_site.py"), folder, DOCS, folder)
    assert done.returncode == 0, done.stdout[-4000:]
    return folder


@pytest.fixture(scope="module")
def pages(site):
    """Page by its path in the site."""
    return {file.relative_to(site): Page(file) for file in site.rglob("*.html")}


def test_links_lead_somewhere(site, pages):
    dead = []
    for path, page in pages.items():
        for link in page.links + page.loaded:
            url = urlsplit(link)
            if url.scheme or link.startswith("#") and not url.fragment:
                continue
            target = (site / path.parent / unquote(url.path)).resolve() if url.path else site / path
            found = pages.get(target.relative_to(site.resolve()) if url.path else path)
            if not target.is_file() or url.fragment and found and unquote(url.fragment) not in found.anchors:
                dead.append(f"{path}: {link}")
    assert dead == []


def test_nothing_is_loaded_from_elsewhere(site, pages):
    assert [link for page in pages.values() for link in page.loaded if urlsplit(link).netloc] == []
    elsewhere = re.compile(r"(@import|url\()\s*['\"]?(https?:)?//")
    sheets = [file for file in site.rglob("*.css") if elsewhere.search(file.read_text(encoding="utf-8"))]
    assert sheets == []


def test_every_plugin_has_a_section(site, pages):
    text = (site / "reference" / "plugins.html").read_text(encoding="utf-8")
    anchors = pages[Path("reference/plugins.html")].anchors
    for name in plugin_names():
        assert {f"plugin-{name}", f"plugin-{name}".replace("_", "-")} & anchors, name
        for parameter in plugin_page(name).parameters:
            for word in parameter.name.split(", "):
                assert f">{word}<" in text or word == "(nested)", (name, word)
    assert ":monosp:" not in text and "|float|" not in text


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.stem)
def test_a_page_says_first_for_whom_it_is(source):
    paragraphs = re.split(r"\n{2,}", source.read_text(encoding="utf-8"))
    assert paragraphs[1].startswith("For ") or "\nFor " in paragraphs[0], paragraphs[:2]


def test_every_plugin_has_a_picture(pages):
    shown = {Path(file).stem for file in pages[Path("reference/plugins.html")].loaded if file.endswith(".png")}
    assert shown == set(plugin_names())


@pytest.mark.parametrize(
    "word, page",
    [
        ("hysteresis", "tutorials/memory"),
        ("crosstalk", "howto/convergence"),
        ("STL", "tutorials/own_pad"),
        ("saturation", "tutorials/volts"),
    ],
)
def test_search_finds(site, word, page):
    index = json.loads(re.search(r"setIndex\((.*)\)", (site / "searchindex.js").read_text(encoding="utf-8"))[1])
    found = set()
    for terms in (index["terms"], index["titleterms"]):
        pages = terms.get(SearchEnglish({}).stem(word.lower()), [])
        found.update([pages] if isinstance(pages, int) else pages)
    assert page in {index["docnames"][number] for number in found}


def test_every_command_has_a_section(pages):
    from taxel_cli import COMMANDS

    anchors = pages[Path("reference/cli.html")].anchors
    assert {"taxel", *(f"taxel-{name}" for name in COMMANDS), "taxel-bench-accuracy"} <= anchors


def test_every_public_name_has_an_entry(pages):
    anchors = pages[Path("reference/api.html")].anchors
    assert {f"mitsuba_taxel.{name}" for name in mitsuba_taxel.__all__} <= anchors


def test_formulas_are_mathml(site):
    text = (site / "theory" / "errors.html").read_text(encoding="utf-8")
    assert "<mfrac>" in text and "\\frac" not in text
