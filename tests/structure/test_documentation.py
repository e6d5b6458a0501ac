"""What the project says of itself holds: public names are documented, examples and pages run, links lead somewhere.

Every page of the manual runs from top to bottom in a folder of its own that has the scenes in it; those of
`scenes/manual` share a process, which would else be started thirty times. `manual` says how.
"""
import ast
import doctest
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import manual
import pytest
from manual import DRAWINGS, PAGES, anchors, blocks, commands, links
from test_import_direction import RANK

ROOT = Path(__file__).resolve().parents[2]
ROOMS_WITH_EXAMPLES = ("units", "device", "seabed", "water", "scattering", "propagation", "sonar", "signal",
                       "imaging", "io")
SOURCES = sorted([*(ROOT / "mitsonar").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")])


def module_name(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


EXAMPLES = [module_name(path) for room in ROOMS_WITH_EXAMPLES for path in SOURCES
            if f"{module_name(path)}.".startswith(f"mitsonar.{room}.") and ">>> " in path.read_text(encoding="utf-8")]


def test_public_names_are_documented():
    silent = []
    for path in SOURCES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        silent += [] if ast.get_docstring(tree) else [f"{module_name(path)}: the module itself"]
        for node in tree.body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_") and not any(
                    ast.unparse(decorator) == "overload" for decorator in node.decorator_list):
                silent += [] if ast.get_docstring(node) else [f"{module_name(path)}: {node.name}"]
    assert SOURCES and not silent, "\n".join(silent)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_in_docstrings_run(name):
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(importlib.import_module(name), optionflags=flags).failed == 0


PAGE = pytest.mark.parametrize("page", [pytest.param(page, id=page.relative_to(ROOT).as_posix()) for page in PAGES])


@PAGE
def test_every_block_of_a_page_is_run_or_says_why_not(page):
    for block in blocks(page.read_text(encoding="utf-8")):
        where = f"line {block.line}"
        assert block.language in ("python", "bash", "xml", *DRAWINGS) or block.file or block.not_run, where
        if block.language == "bash" and not block.not_run:
            assert commands(block.text), where


@PAGE
def test_links_of_a_page_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for link in links(text):
        if re.match(r"https?://|mailto:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.is_relative_to(ROOT) and target.exists(), f"{link}: there is no such file"
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{link}: there is no such heading"


@PAGE
def test_files_that_a_page_names_are_there(page):
    """Of what is written as code, all that begins with one of our folders or ends in .py; capitals stand for others."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for name in re.findall(r"`((?:mitsonar|plugins|scenes|tests)/[a-z0-9_./]*)`", text):
        assert (ROOT / name).exists(), f"there is no {name}"
    folders = ("mitsonar", "plugins", "scenes", "tests")
    programs = {path.name for folder in folders for path in (ROOT / folder).rglob("*.py")}
    for name in re.findall(r"`([a-z0-9_]+\.py)\b", text):
        assert name in programs, f"there is no {name}"


def test_the_rooms_are_those_of_the_house_in_the_order_of_its_floors():
    text = (ROOT / "mitsonar" / "README.md").read_text(encoding="utf-8").partition("## The rooms")[2]
    table = re.findall(r"^\| (`.+?`) \|", text.partition("\n## ")[0], re.M)
    assert [room for cell in table for room in re.findall(r"`(\w+)`", cell)] == [room for room in RANK
                                                                                if room != "__main__"]


def together():
    """Yield the pages that run in one process, under a name: those of `scenes/manual`, and every other by itself."""
    topics = ROOT / "scenes" / "manual"
    yield pytest.param([page for page in PAGES if page.parent == topics], id="scenes/manual")
    for page in PAGES:
        if page.parent != topics and any(not block.not_run and block.language not in DRAWINGS
                                         for block in blocks(page.read_text(encoding="utf-8"))):
            yield pytest.param([page], id=page.relative_to(ROOT).as_posix())


@pytest.mark.slow
@pytest.mark.parametrize("pages", list(together()))
def test_pages_run_from_top_to_bottom(pages, tmp_path):
    child = subprocess.run([sys.executable, Path(manual.__file__), *pages], cwd=tmp_path,
                           env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
                           stdin=subprocess.DEVNULL, timeout=900, check=False)
    assert child.returncode == 0, child.stderr


# ---- public names

SHOWN = sorted([*PAGES, *(ROOT / "scenes" / "tutorials").glob("*.py")])


def names_used(source):
    """Yield the dotted names below `mitsonar` that Python source imports, or follows from a name it imported."""
    tree, imported = ast.parse(source), {"mitsonar": "mitsonar"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "mitsonar":
            imported |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("mitsonar."))
    yield from imported.values()
    for node in ast.walk(tree):
        steps = []
        while isinstance(node, ast.Attribute):
            steps.insert(0, node.attr)
            node = node.value
        if steps and isinstance(node, ast.Name) and node.id in imported:
            yield ".".join([imported[node.id], *steps])


def not_public(name):
    """Return the first part of a dotted name that is missing from its package's list; None where all are public."""
    place = importlib.import_module("mitsonar")
    for step in name.split(".")[1:]:
        if not inspect.ismodule(place):
            return None                                     # an attribute of a class, or of what a function returned
        public = place.__all__ if hasattr(place, "__path__") else dir(place)
        if step not in public and not step.startswith("__"):
            return f"{place.__name__}.{step}"
        place = getattr(place, step)
    return None


@pytest.mark.parametrize("page", [pytest.param(page, id=page.relative_to(ROOT).as_posix()) for page in SHOWN])
def test_pages_and_tutorials_use_public_names_alone(page):
    text = page.read_text(encoding="utf-8")
    sources = [text] if page.suffix == ".py" else [block.text for block in blocks(text) if block.language == "python"]
    assert not [private for source in sources for name in names_used(source) if (private := not_public(name))]


def test_a_private_name_on_a_page_is_found():
    used = names_used("import mitsonar\nfrom mitsonar import survey\nmitsonar.render\nsurvey.kinds.KINDS")
    assert set(map(not_public, used)) == {None, "mitsonar.survey"}
