"""Set up the environment of a checkout, and restart the command in it. Standard library only.

`enter` is called before every command. If the running interpreter has the packages, or mitsonar is installed without
its checkout, only a libLLVM may be missing. Otherwise the packages that mitsonar itself needs are installed into
``.venv`` beside ``pyproject.toml`` (or under the user's cache if the checkout is read-only), and the command restarts
there. ``test`` adds the packages of the extra ``test`` to the same environment, and a command that meets a missing
package of another extra adds that one (`add_extra`).

A file in the environment holds its state. No file: somebody else made the environment; packages are added to it.
"unfinished": a set-up was interrupted, and starts again. Otherwise the file holds the inputs of the environment, which
is used while these stay the same, and its extras, which are brought up to date with the rest. An environment to be
replaced is renamed until the new one is complete, and gets its name back if that fails.
"""
import contextlib
import hashlib
import importlib.util
import os
import re
import shutil
import sys
from collections.abc import Sequence

from mitsonar.device import llvm

from . import installer
from .installer import SetupError

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
PROJECT = os.path.join(ROOT, "pyproject.toml")
MOVED = "MITSONAR_MOVED_INTO"  # set for the process that is started in the environment
UNFINISHED, ADDED_TO, EXTRAS = b"unfinished\n", b"added to\n", b"extras:"
SIZES = {"": "0.7 GB; a quarter of a minute on a fast line", "test": "1.2 GB; half a minute on a fast line"}
# commands that need no library
AT_ONCE = ("-h", "--help", "-v", "--version", "--print-completion", "scenes")


def enter(argv: Sequence[str]) -> None:
    """Return if this interpreter can run the command `argv`; otherwise restart the command in one that can.

    A missing libLLVM stops only the commands that need it, in `mitsonar.device.llvm.check`.
    """
    try:
        if os.path.isfile(PROJECT):
            _move_in(argv)
    except OSError as error:
        raise SetupError(f"The set-up failed: {error}.") from None
    if llvm.new_folder():
        say(f"the folder for caches cannot be written; {llvm.new_folder()} takes its place until the system clears it. "
            "Set XDG_CACHE_HOME to a folder that lasts.")
    if _needs_library(argv):
        try:
            _have_library()
        except OSError as error:                       # other commands work without a library
            say(f"no LLVM library could be fetched: {error}. Set XDG_CACHE_HOME to a folder that can be written, or "
                f"{llvm.VARIABLE} to a library.")


def add_extra(extra: str, argv: Sequence[str]) -> None:
    """Install an extra into the environment of this checkout, and restart the command `argv` there.

    Return if another environment is running, or if it has the extra already.
    """
    folder = environment()
    if not (os.path.isfile(PROJECT) and _inside(folder)) or extra in _extras(_read(_state_file(folder))):
        return
    try:
        with _alone(folder):
            set_up(folder, [extra])
    except OSError as error:
        raise SetupError(f"The set-up failed: {error}.") from None
    _restart(folder, argv, "new")


def _move_in(argv):
    moved = os.environ.pop(MOVED, None)
    folder = environment()
    if _inside(folder):
        _forget_python_path(folder)
    extras = ["test"] if argv[:1] == ["test"] else []
    lacking = missing(*extras)
    if not lacking:
        return
    if moved == "new":
        raise SetupError(f"The environment {folder} is damaged (it lacks {', '.join(lacking)}); remove that folder and "
                         "try again.")
    with _alone(folder):
        if moved or _inside(folder) or not _is_ready(folder):
            set_up(folder, extras, library=_needs_library(argv))
            moved = "new"
    _restart(folder, argv, moved or "old")


def _restart(folder, argv, moved):
    """Replace this process by the same command in an environment."""
    python = installer.python_of(folder)
    # With the locale "C", Python and Mitsuba do not agree on paths beyond ASCII.
    options = [] if sys.getfilesystemencoding() == "utf-8" else ["-X", "utf8"]
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    os.execve(python, [python, *options, "-m", "mitsonar", *argv], {**variables, MOVED: moved})


def _forget_python_path(folder):
    """Remove PYTHONPATH if its packages could hide those of the environment."""
    entries = {os.path.realpath(entry) for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry}
    foreign = {entry for entry in entries if entry != os.path.realpath(ROOT)
               and not entry.startswith(os.path.realpath(folder) + os.sep)}
    if foreign:
        del os.environ["PYTHONPATH"]
        sys.path[:] = [entry for entry in sys.path if os.path.realpath(entry) not in foreign]


def _needs_library(argv):
    return bool(argv) and argv[0].partition("=")[0] not in AT_ONCE


def _have_library():
    if llvm.is_ready():
        return
    with _alone(llvm.private_folder()):
        if not llvm.is_ready():  # another process may just have fetched it
            try:
                llvm.provide(say)
            except llvm.BackendError as error:
                say(str(error).partition("\n")[0])


def run_tests(arguments: Sequence[str]) -> int:
    """Run the checkout's tests by pytest with `arguments` and return its exit code."""
    if not os.path.isdir(os.path.join(ROOT, "tests")):
        raise SetupError("The tests are part of the source checkout, and this mitsonar is installed without it; "
                         "run python3 -m mitsonar test there.")
    llvm.check()
    import pytest

    os.chdir(ROOT)  # where pytest finds its settings, the tests, and a place for its cache
    first = [] if os.access(ROOT, os.W_OK) else ["-p", "no:cacheprovider"]
    if importlib.util.find_spec("xdist") is not None and not any(os.path.exists(argument.partition("::")[0])
                                                                 for argument in arguments):
        # both processes of the whole suite must collect the tests in the same order, sets of parameters included
        os.environ.setdefault("PYTHONHASHSEED", "0")
        first += ["-n", "2", "--dist", "loadfile"]
    return int(pytest.main([*first, *arguments]))


def environment() -> str:
    """Return the folder of the environment that belongs to this checkout."""
    folder = os.path.join(ROOT, ".venv")
    if os.access(ROOT, os.W_OK) or _is_ready(folder):
        return folder
    return os.path.join(llvm.cache_folder(), f"venv-{hashlib.sha256(os.fsencode(ROOT)).hexdigest()[:12]}")


def missing(*extras: str) -> list[str]:
    """Return the requirements of ``pyproject.toml`` that this interpreter does not meet, as ``name>=version``."""
    unmet, installed = [], _installed()
    for name, relation, version in _requirements("dependencies", *extras):
        plain = _plain(name.partition("[")[0])
        have, want = (tuple(map(int, re.findall(r"\d+", numbers)))
                      for numbers in (installed.get(plain) or _metadata_version(plain), version))
        if have < want or (relation == "==" and have != want):
            unmet.append(f"{name}{relation}{version}")
    return unmet


def _installed():
    """Return the versions of packages by the names of their folders: importlib.metadata would read every file."""
    versions = {}
    for folder in reversed(sys.path):
        with contextlib.suppress(OSError):
            for name, version in re.findall(r"^(.+)-([^-]+)\.dist-info$", "\n".join(os.listdir(folder or ".")), re.M):
                if os.path.isfile(os.path.join(folder, f"{name}-{version}.dist-info", "METADATA")):
                    versions[_plain(name)] = version
    return versions


def _plain(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def _metadata_version(name):
    """Return the version of a package that is not in a folder of its own, "0" if there is none."""
    import importlib.metadata

    try:
        return importlib.metadata.version(name) or "0"
    except importlib.metadata.PackageNotFoundError:
        return "0"


def _requirements(*lists):
    """Yield name, relation and version of the requirements in some lists of ``pyproject.toml``."""
    with open(PROJECT, encoding="utf-8") as file:
        text = file.read()
    # The TOML reader came with Python 3.11; these plain lists of strings need none.
    requirement = r'^([\w.-]+(?:\[\w+\])?)(==|>=)([\d.]+)(?:; python_version (<|>=) \'3\.(\d+)\')?$'
    for key in lists:
        entries = "".join(re.findall(rf"^{key} = \[(.*?)\](?: *#[^\n]*)?$", text, re.M | re.S)[:1])
        for entry in re.findall(r'"([^"\n]+)"', entries):
            if entry.startswith("mitsonar["):          # other extras
                yield from _requirements(*re.findall(r"\w+", entry)[1:])
                continue
            name, relation, version, side, minor = re.findall(requirement, entry)[0]
            if not side or (sys.version_info < (3, int(minor))) == (side == "<"):
                yield name, relation, version


def set_up(folder: str, extras: Sequence[str] = (), *, library: bool = False) -> None:
    """Make or update the environment `folder`, with `extras` and those it has; the caller holds its lock.

    With `library`, a missing libLLVM is fetched meanwhile.
    """
    if os.name != "posix":
        raise SetupError("The automatic set-up works on Linux and macOS; elsewhere, run pip install -e .[test] first.")
    before, waiting = _read(_state_file(folder)), f"{folder}.old"
    there = os.path.isdir(folder) and bool(os.listdir(folder))
    foreign = there and (before is None or before.endswith(ADDED_TO))
    in_place = foreign or before is not None and there and before.startswith(_identity(folder))
    if there and not in_place:
        if os.path.lexists(waiting):  # `folder` is then an unfinished replacement
            shutil.rmtree(folder)
        else:
            os.rename(folder, waiting)
    os.makedirs(folder, exist_ok=True)
    _write(_state_file(folder), UNFINISHED + (ADDED_TO if foreign else b""))
    new = sorted({*extras} - {*_extras(before)})
    extras = sorted({*new, *_extras(before)})
    names = [name.partition("[")[0] for name, _, _ in _requirements("dependencies", *extras)]
    if before is not None and before.startswith(_identity(folder) + _digest()):
        say(f"adding the packages of {', '.join(new) or 'mitsonar'} to {folder}")
    else:
        say(f"installing packages into {folder} ({SIZES['test' if 'test' in extras else '']})")
    import concurrent.futures

    try:
        with concurrent.futures.ThreadPoolExecutor(1) as other:
            if library:                # what fails is tried again by the command, which then says why
                other.submit(_have_library)
            installer.install(folder, ROOT, names, say)
    except BaseException as error:
        if not in_place:
            shutil.rmtree(folder)
            if os.path.lexists(waiting):
                os.rename(waiting, folder)
        elif isinstance(error, SetupError):  # an interruption leaves the mark "unfinished"
            if before is None:
                os.unlink(_state_file(folder))
            else:
                _write(_state_file(folder), before)
        raise
    content = _identity(folder) + _digest() + b" ".join([EXTRAS, *map(os.fsencode, extras)]) + b"\n"
    _write(_state_file(folder), content + (ADDED_TO if foreign else b""))
    shutil.rmtree(waiting, ignore_errors=True)


def about_import(error: ImportError) -> str:
    """Return advice about a package that is present, or should be, and cannot be imported."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    what = f"a package that mitsonar needs cannot be imported: {lines[0] if lines else type(error).__name__}"
    if os.environ.get("PYTHONPATH"):
        return f"{what}; PYTHONPATH is {os.environ['PYTHONPATH']}: unset it if the package is taken from there"
    if os.path.isfile(PROJECT) and _inside(environment()):
        return f"{what}; remove the folder {environment()} and run the command again; it makes the folder again"
    return f"{what}; install it again for {sys.executable}, or mitsonar by pip install --force-reinstall"


def say(line: str) -> None:
    """Print one line of progress to stderr."""
    print(f"mitsonar: {line}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def _alone(folder):
    """Hold the lock file beside `folder`; the system releases it however the process ends."""
    import fcntl

    os.makedirs(os.path.dirname(folder), exist_ok=True)
    with open(f"{folder}.lock", "w", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            say("waiting for another set-up to end")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _inside(folder):
    return os.path.realpath(sys.prefix) == os.path.realpath(folder)


def _is_ready(folder):
    state = _read(_state_file(folder))
    return os.path.exists(installer.python_of(folder)) and state is not None \
        and state.startswith(_identity(folder) + _digest())


def _identity(folder):
    """Return the inputs that distinguish environments: the checkout and the interpreter."""
    return os.fsencode(f"{ROOT}\n{os.path.realpath(installer.python_of(folder))}\n")


def _digest():
    digest = hashlib.sha256()
    for path in (PROJECT, installer.LOCK):
        with open(path, "rb") as file:
            digest.update(file.read())
    return f"{digest.hexdigest()}\n".encode()


def _extras(state):
    """Return the extras of an environment's state; environments of older versions had the tests."""
    if state is None or state.startswith(UNFINISHED):
        return []
    found = re.search(rb"^%s(.*)$" % EXTRAS, state, re.M)
    return found[1].decode().split() if found else ["test"]


def _state_file(folder):
    return os.path.join(folder, "mitsonar-state")


def _read(path):
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError:
        return None


def _write(path, content):
    with open(f"{path}.new", "wb") as file:
        file.write(content)
    os.replace(f"{path}.new", path)
