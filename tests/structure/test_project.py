"""What the project says of itself to tools agrees: pyproject.toml, LICENSE, CITATION.cff, the list of changes."""
import re
from pathlib import Path

import yaml
from trove_classifiers import classifiers

import mitsonar

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_classifiers_are_those_that_registries_know():
    assert PROJECT["classifiers"] and set(PROJECT["classifiers"]) <= classifiers
    assert PROJECT["classifiers"] == sorted(PROJECT["classifiers"])


def test_types_are_said_to_be_there_where_they_are():
    assert ("Typing :: Typed" in PROJECT["classifiers"]) == (ROOT / "mitsonar" / "py.typed").is_file()


def test_the_licence_stands_where_tools_look_for_it():
    assert PROJECT["license-files"] == ["LICENSE"] and PROJECT["license"] == "BSD-3-Clause"
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("BSD 3-Clause License")


def test_the_citation_is_of_this_version_and_licence():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert (citation["version"], citation["license"]) == (mitsonar.__version__, PROJECT["license"])
    assert [author["name"] for author in citation["authors"]] == [author["name"] for author in PROJECT["authors"]]


def test_the_list_of_changes_begins_with_this_version():
    text = (ROOT / "mitsonar" / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## (\S+?),? ", text, re.M)[1].rstrip(",") == mitsonar.__version__
