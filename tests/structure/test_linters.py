"""What ruff and pyright say of the sources, and what no linter asks for: annotations, and reasons for exceptions.

pyright reads Mitsuba's stubs as `tests/inputs/typed_sources.py` mends them.
"""
import ast
import hashlib
import importlib.metadata
import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typed_sources import findings

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("mitsonar", "plugins", "scenes", "tests")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
TOMLLIB = "tomllib" if sys.version_info >= (3, 11) else "tomli"
EXCEPTION = re.compile(r"#\s*(noqa|type:\s*ignore|pyright:\s*(?:ignore|basic|strict|standard))(.*)")
RULE_AND_REASON = {
    "noqa": re.compile(r": ?[A-Z]+\d+(?:, ?[A-Z]+\d+)*\s+.*\w{3,}"),
    "pyright": re.compile(r"\[report\w+(?:, ?report\w+)*\]\s+.*\w{3,}"),
}


def settings():
    """What pyproject.toml says to pyright."""
    read = pytest.importorskip(TOMLLIB).loads
    return read((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pyright"]


def linter(name, *arguments):
    """Run a linter of this environment in the checkout; skip where there is none, or where it cannot start."""
    if importlib.util.find_spec(name) is None:
        pytest.skip(f"{name} is not installed; pip install -e .[test] brings it")
    # pyright's wrapper would ask the network for a newer one
    environment = {**os.environ, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"}
    for words in (["--version"], arguments):
        child = subprocess.run([sys.executable, "-m", name, *words], cwd=ROOT, env=environment, capture_output=True,
                               text=True, encoding="utf-8", stdin=subprocess.DEVNULL, check=False)
        if words == ["--version"] and child.returncode:
            pytest.skip(f"{name} cannot start here: {(child.stderr or child.stdout).strip()[-300:]}")
    return child


def test_ruff_finds_nothing():
    child = linter("ruff", "check", "--no-cache", "--output-format", "concise", *FOLDERS)
    assert child.returncode == 0, f"{child.stdout}\n{child.stderr}"


def checked():
    """A number that stands for all that pyright reads: the sources, its settings, every package installed here."""
    folders = (ROOT / place for place in settings()["include"])
    files = sorted(path for folder in folders for path in folder.rglob("*.py*") if path.suffix in (".py", ".pyi"))
    packages = sorted(f"{one.name} {one.version}" for one in importlib.metadata.distributions())
    number = hashlib.sha256(f"{sys.version} {packages}".encode())
    for path in [*files, ROOT / "pyproject.toml", ROOT / "tests" / "inputs" / "typed_sources.py"]:
        number.update(f"{path} {path.read_text(encoding='utf-8')}".encode())
    return number.hexdigest()


@pytest.mark.slow
def test_pyright_finds_nothing(request):
    """In what it has read before and found nothing in, it need not look again."""
    linter("pyright", "--version")
    number, cache = checked(), getattr(request.config, "cache", None)     # there is none with -p no:cacheprovider
    if cache is not None and cache.get("mitsonar/pyright", None) == number:
        return
    found, files = findings()
    assert files > 300 and not found, "\n" + "\n".join(found)
    if cache is not None:
        cache.set("mitsonar/pyright", number)


def exceptions(text):
    """Comments that ask a linter to look away: line number, kind, and what follows the word."""
    for number, line in enumerate(text.splitlines(), 1):
        if match := EXCEPTION.search(line):
            yield number, match[1], match[2]


def bare(text):
    """Line numbers of exceptions that lack their rule or their reason, or that are not of a kind known here."""
    return [number for number, kind, rest in exceptions(text)
            if not RULE_AND_REASON["pyright" if kind.startswith("pyright") else "noqa"].match(rest)
            or kind.startswith("type")]


@pytest.mark.parametrize("line, good", [
    ("import a  # noqa: F401  chooses libLLVM", True), ("import a  # noqa: E402, F401  (chooses libLLVM)", True),
    ("import a  # noqa: F401", False), ("import a  # noqa", False), ("a = 1  # type: ignore[x]  stubs lack it", False),
    ("a = b.c  # pyright: ignore[reportAttributeAccessIssue]  the stubs lack it", True),
    ("a = b.c  # pyright: ignore[reportAttributeAccessIssue]", False), ("a = b.c  # pyright: ignore  why", False),
    ("# pyright: basic", False)])
def test_an_exception_needs_its_rule_and_its_reason(line, good):
    assert bool(bare(line)) is not good


def test_exceptions_have_their_rule_and_their_reason():
    found = [f"{path.relative_to(ROOT)}:{number}" for path in SOURCES if path != Path(__file__).resolve()
             for number in bare(path.read_text(encoding="utf-8"))]
    assert not found, "\n".join(found)


def public(body, prefix=""):
    """Public functions and methods of a module or class, `__init__` and `__call__` among them, by their names."""
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            if not node.name.startswith("_") or node.name in ("__init__", "__call__"):
                yield prefix + node.name, node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public(node.body, f"{prefix}{node.name}.")


def unannotated(source):
    """Public functions that do not say what they take and give, and fields of records that say nothing of their kind.

    Returns
    -------
    list of str
        ``name: what lacks``.
    """
    found = []
    tree = ast.parse(source)
    for name, node in public(tree.body):
        decorators = {ast.unparse(one) for one in node.decorator_list}
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        if "." in name and "staticmethod" not in decorators:
            arguments = arguments[1:]
        arguments += [one for one in (node.args.vararg, node.args.kwarg) if one is not None]
        found += [f"{name}: {one.arg}" for one in arguments if one.annotation is None]
        if node.returns is None and node.name != "__init__":
            found.append(f"{name}: what it gives")
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and any("dataclass" in ast.unparse(one) for one in node.decorator_list):
            fields = [one for one in node.body if isinstance(one, ast.AnnAssign)]
            found += [f"{node.name}.{ast.unparse(one.target)}: the field's kind" for one in fields
                      if ast.unparse(one.annotation).strip("'") == "object"]
    return found


def test_annotations_are_missed_where_they_lack():
    source = ("@dataclass(frozen=True)\nclass Record:\n    any: object\n    speed: float\n"
              "    def at(self, depth, *, of: int): ...\n    def _hidden(self, a): ...\n"
              "def load(path: str, **others) -> None: ...\n")
    assert unannotated(source) == ["Record.at: depth", "Record.at: what it gives", "load: others",
                                   "Record.any: the field's kind"]


def test_public_functions_and_records_are_annotated():
    later = [ROOT / place for place in settings().get("exclude", [])]
    found = {str(path.relative_to(ROOT)): unannotated(path.read_text(encoding="utf-8")) for path in SOURCES
             if path.relative_to(ROOT).parts[0] in settings()["include"]
             and not any(path == place or place in path.parents for place in later)}
    found = {path: names for path, names in found.items() if names}
    assert not found, "\n" + "\n".join(f"{path}: {', '.join(names)}" for path, names in found.items())
