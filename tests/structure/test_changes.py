"""The change log of the next version: every file in mitsonar/changes has a known type, and towncrier takes them all."""
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "mitsonar" / "changes"
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["towncrier"]
TYPES = {kind["directory"]: kind["name"] for kind in SETTINGS["type"]}
SENTENCES = re.compile(r"[A-Z`][^\0]*\.\n")


def fault(name, text):
    """Say what is wrong with a fragment, or return None."""
    kind = re.fullmatch(r"\+[a-z0-9-]+\.(\w+)\.md", name)
    if kind is None or kind[1] not in TYPES:
        return f"{name}: the name must be +NAME.TYPE.md, TYPE one of {', '.join(TYPES)}"
    if not SENTENCES.fullmatch(text) or "\n\n" in text or len(text) > 600:
        return f"{name}: one to three sentences, the last with a full stop and the end of the line"
    return None


def test_every_fragment_is_one():
    files = [path for path in FOLDER.iterdir() if path.name != "README.md"]
    assert not [said for path in files if (said := fault(path.name, path.read_text(encoding="utf-8")))]


@pytest.mark.parametrize("name, text, good", [
    ("+long-pulses.fix.md", "Long pulses keep their level.\n", True),
    ("long-pulses.fix.md", "Long pulses keep their level.\n", False),
    ("+long-pulses.bugfix.md", "Long pulses keep their level.\n", False),
    ("+long-pulses.fix.md", "long pulses\n", False), ("+long-pulses.fix.md", "", False)])
def test_a_wrong_fragment_is_noticed(name, text, good):
    assert (fault(name, text) is None) is good


def test_the_types_are_those_that_contributors_read_of():
    assert re.findall(r"^\| `(\w+)` \|", (FOLDER / "README.md").read_text(encoding="utf-8"), re.M) == list(TYPES)


def test_a_release_puts_them_above_the_versions_before(tmp_path):
    """On a copy, with one more fragment of every type."""
    pytest.importorskip("towncrier", reason="towncrier is not installed; pip install -e .[test] brings it")
    copy = tmp_path / "mitsonar" / "changes"
    shutil.copytree(FOLDER, copy)
    for name in ("pyproject.toml", "mitsonar/CHANGELOG.md"):
        shutil.copy(ROOT / name, tmp_path / name)
    for kind in TYPES:
        (copy / f"+probe.{kind}.md").write_text(f"A probe of {kind}.\n", encoding="utf-8")
    before = (tmp_path / "mitsonar" / "CHANGELOG.md").read_text(encoding="utf-8")
    child = subprocess.run([sys.executable, "-m", "towncrier", "build", "--keep", "--version", "99.1.0", "--date",
                            "2030-01-02"], cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL,
                           check=False)
    assert child.returncode == 0, child.stdout + child.stderr
    after = (tmp_path / "mitsonar" / "CHANGELOG.md").read_text(encoding="utf-8")
    head, _, older = before.partition(SETTINGS["start_string"])
    assert after.startswith(head) and after.endswith(older.strip() + "\n")
    new = after[len(head):len(after) - len(older.strip()) - 1]
    assert "## 99.1.0 (2030-01-02)" in new
    places = [new.index(f"### {title}\n") for title in TYPES.values()]
    assert places == sorted(places)
    for place, kind in zip(places, TYPES):
        assert new.index(f"- A probe of {kind}.") > place
    for path in FOLDER.glob("+*.md"):
        assert " ".join(path.read_text(encoding="utf-8").split())[:60] in " ".join(new.split())
