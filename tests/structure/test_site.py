"""The manual builds as a site without a warning, its links lead somewhere, and the reference has all public names."""
import importlib.util
import json
import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote, urlsplit

import pytest

import mitsonar

ROOT = Path(__file__).resolve().parents[2]
ROOMS = [name for name in mitsonar.__all__ if name != "scenes" and isinstance(getattr(mitsonar, name), ModuleType)]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(
    not all(importlib.util.find_spec(name) for name in ("mkdocs", "material", "mkdocstrings_handlers", "latex2mathml")),
    reason='MkDocs is not installed; pip install -e ".[docs]" brings it, on Python 3.11 and newer')]


class Page(HTMLParser):
    """Names of places in a page, its links, and what it loads."""

    def __init__(self, path):
        super().__init__()
        self.names, self.links, self.loads = set(), [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.names |= {attributes[key] for key in ("id", "name") if attributes.get(key)}
        self.loads += [attributes["src"]] if "src" in attributes else []
        if "href" in attributes:
            (self.links if tag == "a" else self.loads).append(attributes["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site; warnings are errors."""
    folder = tmp_path_factory.mktemp("site")
    child = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", folder, "-f",
                            ROOT / "scenes" / "manual" / "mkdocs.yml"], cwd=folder, capture_output=True, text=True,
                           stdin=subprocess.DEVNULL, check=False,
                           env={**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"})
    assert child.returncode == 0, child.stdout + child.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site):
    return {path.resolve(): Page(path) for path in site.rglob("*.html") if path.name != "404.html"}


def test_every_link_leads_somewhere(pages):
    broken = []
    for path, page in pages.items():
        for link in page.links + page.loads:
            parts = urlsplit(link)
            if parts.scheme in ("http", "https", "mailto", "data"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            fragment = unquote(parts.fragment)
            if not target.exists() or fragment and target in pages and fragment not in pages[target].names:
                broken.append(f"{path.name}: {link}")
    assert len(pages) > 60 and not broken


def test_no_page_loads_anything_from_elsewhere(pages):
    assert not {load for page in pages.values() for load in page.loads if urlsplit(load).netloc}


@pytest.mark.parametrize("room", [None, *(room for room in ROOMS if room != "plugins")])
def test_the_reference_has_every_public_name(site, pages, room):
    module = getattr(mitsonar, room) if room else mitsonar
    path = f"mitsonar.{room}" if room else "mitsonar"
    page = pages[(site / "reference" / f"{room or 'mitsonar'}.html").resolve()]
    names = getattr(module, "__all__", []) if room else [name for name in mitsonar.__all__ if name not in ROOMS]
    assert {f"{path}.{name}" for name in names} <= page.names
    assert len([name for name in page.names if name.startswith(f"{path}.")]) >= max(2, len(names))


def test_every_page_of_the_manual_can_be_searched(site):
    entries = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))["docs"]
    places = {entry["location"].partition("#")[0] for entry in entries}
    manual = {path.relative_to(ROOT).with_suffix(".html").as_posix()
              for path in (ROOT / "scenes" / "manual").glob("*.md")}
    assert manual and manual | {"plugins/index.html", "reference/water.html", "reference/commands.html"} <= places
