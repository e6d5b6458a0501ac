"""Docstrings of the public surface keep NumPy's convention: ruff's rules D, on what the rooms' `__all__` name."""
import importlib
import inspect
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ["mitsonar", *sorted(f"mitsonar.{init.parent.name}" for init in (ROOT / "mitsonar").glob("*/__init__.py"))]
# of methods: what Python itself asks of them needs no words; first lines in the imperative are judged by people
LEFT = {"D102", "D105", "D107", "D401"}


def public():
    """Functions and classes of every `__all__`, each with its file and the first and last line of its source."""
    for room in map(importlib.import_module, ROOMS):
        for name in getattr(room, "__all__", ()):
            value = inspect.unwrap(getattr(room, name))
            if inspect.isfunction(value) or inspect.isclass(value):
                lines, first = inspect.getsourcelines(value)
                yield f"{room.__name__}.{name}", Path(inspect.getsourcefile(value)), first, first + len(lines) - 1


def said(files):
    """What ruff says of docstrings: (file, line, rule, message)."""
    child = subprocess.run([sys.executable, "-m", "ruff", "check", "--no-cache", "--select", "D", "--config",
                            'lint.pydocstyle.convention = "numpy"', "--output-format", "json", *map(str, files)],
                           cwd=ROOT, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    assert child.returncode in (0, 1), child.stderr
    return [(Path(one["filename"]), one["location"]["row"], one["code"], one["message"])
            for one in json.loads(child.stdout)]


def test_public_names_keep_the_convention_of_numpy():
    names = list(public())
    assert len(names) > 100
    found = {f"{name}: {rule} {message} ({path.relative_to(ROOT)}:{line})"
             for path, line, rule, message in said(sorted({file for _, file, *_ in names})) if rule not in LEFT
             for name, file, first, last in names if file == path and first <= line <= last}
    assert not found, "\n" + "\n".join(sorted(found))


def test_a_docstring_that_breaks_it_is_found(tmp_path):
    text = '"""A room."""\n\n\ndef speed(depth):\n    """the speed\n    at a depth\n    """\n'
    (tmp_path / "room.py").write_text(text)
    assert {"D205", "D400"} <= {rule for _, line, rule, _ in said([tmp_path / "room.py"]) if line >= 4}
