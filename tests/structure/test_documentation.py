"""What the project says of itself holds: public names are documented, and every example in docstrings and README runs.

README.md tells one story from top to bottom, and is run as one, in a folder of its own that has the scenes in it.
Blocks marked ``python`` are executed; of those marked ``bash``, ``sh`` or ``console``, the lines that call mitsonar. A
block after a line ``<!-- not run: REASON -->`` is left out, and so is the command that runs these tests.
"""
import ast
import doctest
import importlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS_WITH_EXAMPLES = ("units", "spelling", "seabed", "water", "scattering", "propagation", "sonar", "signal",
                       "imaging", "io")
SOURCES = sorted([*(ROOT / "mitsonar").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")])
BLOCK = re.compile(r"(?P<mark><!-- not run: .+? -->\n+)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S)


def module_name(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


EXAMPLES = [module_name(path) for room in ROOMS_WITH_EXAMPLES for path in SOURCES
            if f"{module_name(path)}.".startswith(f"mitsonar.{room}.") and ">>> " in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", [pytest.param(path, id=module_name(path)) for path in SOURCES])
def test_public_names_are_documented(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    silent = [] if ast.get_docstring(tree) else ["the module itself"]
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            silent += [] if ast.get_docstring(node) else [node.name]
    assert not silent


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_in_docstrings_run(name):
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(importlib.import_module(name), optionflags=flags).failed == 0


def readme_steps():
    """The parts of README.md that run, in order, as (line number, arguments for the interpreter)."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for block in BLOCK.finditer(text):
        line = text.count("\n", 0, block.start("text")) + 1
        if block["mark"]:
            continue
        if block["language"] == "python":
            yield line, ["-c", block["text"]]
        elif block["language"] in ("bash", "sh", "console"):
            for command in block["text"].replace("\\\n", " ").splitlines():
                words = shlex.split(command.removeprefix("$ "), comments=True)
                words = words[2:] if words[:2] == ["python3", "-m"] else words
                if words[:1] == ["mitsonar"] and words[1:2] != ["test"]:
                    yield line, ["-m", *words]


@pytest.mark.slow
def test_readme_runs_from_top_to_bottom(tmp_path):
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    steps = list(readme_steps())
    assert steps, "README.md shows nothing that runs"
    for line, arguments in steps:
        child = subprocess.run([sys.executable, *arguments], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
                               capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=600, check=False)
        assert child.returncode == 0, f"README.md, line {line}: {arguments}\n{child.stderr}"
