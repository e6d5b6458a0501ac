"""pyright over the sources, with Mitsuba's stubs mended.

Mitsuba's stubs declare a class of their own for each of Dr.Jit's arrays (Float, UInt32, Bool, ...), while its
functions, points and vectors are declared to take and give Dr.Jit's: to a type checker the two have nothing to do with
each other, though they are one class. The mended copy says so. By hand: ``python3 tests/inputs/typed_sources.py``.
"""
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TWICE = re.compile(r"^class (\w+)\(drjit\.ArrayBase\['\1', [^\n]*\]\): pass$", re.M)


def mend_stubs(folder):
    """Copy the installed stubs of Mitsuba into a folder, its arrays being those of Dr.Jit."""
    spec = importlib.util.find_spec("mitsuba")
    shutil.copytree(Path(spec.origin).parent, folder / "mitsuba", ignore=lambda where, names: [
        name for name in names if not name.endswith(".pyi") and not (Path(where) / name).is_dir()])
    stub = folder / "mitsuba" / "__init__.pyi"
    text, count = TWICE.subn(r"from drjit.auto.ad import \1 as \1", stub.read_text(encoding="utf-8"))
    assert count > 10, "Mitsuba's stubs are other than they were: perhaps they need no mending"
    stub.write_text(text, encoding="utf-8")


def findings(*arguments):
    """What pyright finds in the sources: lines of text, and how many files it has read."""
    with tempfile.TemporaryDirectory() as folder:
        mend_stubs(Path(folder))
        project = Path(folder) / "pyrightconfig.json"
        # without its own folder, `import mitsonar` would lead to the checkout that this environment was made for
        project.write_text(json.dumps({"extends": str(ROOT / "pyproject.toml"), "stubPath": folder,
                                       "extraPaths": [str(ROOT)]}), encoding="utf-8")
        command = [sys.executable, "-m", "pyright", "--project", str(project), "--pythonpath", sys.executable,
                   "--outputjson", *arguments]
        # its wrapper would ask the network for a newer one
        child = subprocess.run(command, cwd=ROOT, env={**os.environ, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"},
                               capture_output=True, text=True, encoding="utf-8", stdin=subprocess.DEVNULL, check=False)
    assert child.stdout.startswith("{"), f"{child.stdout}\n{child.stderr}"
    said = json.loads(child.stdout)
    found = [f"{one['file']}:{one['range']['start']['line'] + 1}: {one['message']} ({one.get('rule', 'syntax')})"
             for one in said["generalDiagnostics"] if one["severity"] in ("error", "warning")]
    return found, said["summary"]["filesAnalyzed"]


if __name__ == "__main__":
    lines, files = findings(*sys.argv[1:])
    print(*lines, f"{files} files, {len(lines)} findings", sep="\n")
    sys.exit(bool(lines))
