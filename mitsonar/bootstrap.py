"""Stand the environment up that a checkout needs, and move into it. Standard library only.

`enter` is called before every command. Where the running interpreter already has the packages, or mitsonar is installed
without its checkout, there is nothing to do. Otherwise the packages go into ``.venv`` beside ``pyproject.toml`` (under
the user's cache where the checkout cannot be written), and the command starts again in there.

A file in the environment tells its state. Absent: the environment is somebody else's and is added to. "unfinished": a
set-up was interrupted and is done again from the start. Otherwise it says what the environment was made of, and while
that still holds it is used as it is.
"""
import contextlib
import glob
import hashlib
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import zipfile

from mitsonar import llvm

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PROJECT = os.path.join(ROOT, "pyproject.toml")
MOVED = "MITSONAR_MOVED_INTO"  # set for the one process that is started in the environment
UNFINISHED = "unfinished"
SYSTEM_CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"  # the only ones Debian's pip knows; a bare system has none


class SetupError(Exception):
    """The environment cannot be made; the message is one sentence."""


def enter(argv):
    """Return when this interpreter can run the command `argv`; start it again in an interpreter that can, otherwise.

    A libLLVM that cannot be had stops only the commands that need it, by `mitsonar.llvm.check`.

    Raises
    ------
    SetupError
        The packages cannot be installed.
    """
    if not os.path.isfile(PROJECT):
        return
    try:
        _move_in(argv)
        _have_library()
    except OSError as error:
        raise SetupError(f"The set-up failed: {error}.") from None


def _move_in(argv):
    moved = os.environ.pop(MOVED, None)
    folder = environment()
    if _inside(folder) and _is_ready(folder) or not missing(with_tests=argv[:1] == ["test"]):
        return
    if moved:
        raise SetupError(f"The environment {moved} is damaged; remove that folder and try again.")
    with _alone(folder):
        if not _is_ready(folder):
            set_up(folder)
    os.environ[MOVED] = folder
    os.execv(_python(folder), [_python(folder), "-m", "mitsonar", *argv])


def _have_library():
    if llvm.is_ready():
        return
    with _alone(llvm.private_folder()):
        if not llvm.is_ready():  # somebody else may just have fetched it
            try:
                llvm.provide(say)
            except llvm.BackendError as error:
                say(str(error).partition("\n")[0])


def run_tests(arguments):
    """Run the checkout's tests by pytest with `arguments` and return its exit code.

    Raises
    ------
    SetupError
        mitsonar is installed without its checkout, so there are no tests.
    BackendError
        Kernels cannot be compiled here.
    """
    if not os.path.isdir(os.path.join(ROOT, "tests")):
        raise SetupError("The tests are part of the source checkout, and this mitsonar is installed without it; "
                         "run python3 -m mitsonar test there.")
    llvm.check()
    import pytest

    os.chdir(ROOT)  # where pytest finds its settings, the tests, and a place for its cache
    return int(pytest.main(arguments if os.access(ROOT, os.W_OK) else ["-p", "no:cacheprovider", *arguments]))


def environment():
    """Return the folder of the environment that belongs to this checkout."""
    folder = os.path.join(ROOT, ".venv")
    if os.access(ROOT, os.W_OK) or _is_ready(folder):
        return folder
    return os.path.join(llvm.cache_folder(), f"venv-{hashlib.sha256(ROOT.encode()).hexdigest()[:12]}")


def missing(with_tests=False):
    """Return the requirements of ``pyproject.toml`` that this interpreter does not meet, as ``name>=version``."""
    with open(PROJECT, encoding="utf-8") as file:
        text = file.read()
    # The TOML reader came with Python 3.11; these two plain lists of strings need none.
    keys = ["dependencies", "test"] if with_tests else ["dependencies"]
    text = "".join(re.search(rf"^{key} = \[\n(.*?)^\]", text, re.M | re.S)[1] for key in keys)
    requirement = r'^ *"([\w.-]+(?:\[\w+\])?)(==|>=)([\d.]+)(?:; python_version < \'3\.(\d+)\')?"'
    unmet = []
    for name, relation, version, before in re.findall(requirement, text, re.M):
        if before and sys.version_info >= (3, int(before)):
            continue
        try:
            installed = importlib.metadata.version(name.partition("[")[0])
        except importlib.metadata.PackageNotFoundError:
            installed = "0"
        have, want = (tuple(map(int, re.findall(r"\d+", numbers))) for numbers in (installed, version))
        if have < want or (relation == "==" and have != want):
            unmet.append(f"{name}{relation}{version}")
    return unmet


def set_up(folder):
    """Make the environment `folder`, or bring it up to date; the caller holds its lock.

    Raises
    ------
    SetupError
        The packages cannot be installed.
    """
    if os.name != "posix":
        raise SetupError("The set-up by itself works on Linux and macOS; elsewhere, run pip install -e .[test] first.")
    state = _read(_state_file(folder))
    if state is not None and not state.startswith(_identity(folder)):
        shutil.rmtree(folder)
    os.makedirs(folder, exist_ok=True)
    _write(_state_file(folder), UNFINISHED)
    say(f"installing packages into {folder} (0.8 GB; half a minute on a fast line)")
    if not (shutil.which("uv") and _install_by_uv(folder)):
        _install_by_pip(folder)
    _write(_state_file(folder), _identity(folder) + _digest())


def say(line):
    """Print one line of progress, beside the command's own output."""
    print(f"mitsonar: {line}", file=sys.stderr, flush=True)


def _install_by_uv(folder):
    try:
        _run(folder, "uv", "venv", "-q", "--allow-existing", "--python", sys.executable, folder)
        _run(folder, "uv", "pip", "install", "-q", "--python", _python(folder), "-e", f"{ROOT}[test]")
    except SetupError as error:
        say(f"{error} Going on with pip.")
        return False
    return True


def _install_by_pip(folder):
    import venv

    try:
        import ensurepip  # noqa: F401  (Debian packs it apart)
        has_pip = True
    except ImportError:
        has_pip = False
    try:
        venv.create(folder, symlinks=True, with_pip=has_pip)
    except (OSError, subprocess.CalledProcessError) as error:
        raise SetupError(f"Could not make a Python environment in {folder}: {error}.") from None
    pip, variables = ["-m", "pip"], {}
    if not has_pip:
        wheel = _debian_pip(folder)
        pip = [os.path.join(wheel, "pip")]
        if not os.path.exists(SYSTEM_CERTIFICATES):
            its_own = zipfile.ZipFile(wheel).extract("pip/_vendor/certifi/cacert.pem", os.path.dirname(wheel))
            variables = {"PIP_CERT": its_own}
    quiet = ["-q", "--disable-pip-version-check", "--no-input"]
    _run(folder, _python(folder), *pip, "install", *quiet, "-e", f"{ROOT}[test]", **variables)


def _debian_pip(folder):
    """Return the wheel of pip, out of Debian's package."""
    from mitsonar import debian

    try:
        debian.Packages(say).unpack(["python3-pip-whl"], os.path.join(folder, "pip"))
    except debian.Unavailable as error:
        raise SetupError(f"This Python has neither pip nor ensurepip, and Debian's cannot be had: {error}; "
                         "install pip or python3-venv and try again.") from None
    return glob.glob(os.path.join(folder, "pip/usr/share/python-wheels/pip-*.whl"))[0]


def _run(folder, *command, **defaults):
    # A user's standing wish for installs into the home folder would make pip fail in an environment. What pip unpacks
    # goes into a folder of ours: it is large for a /tmp in memory, and an interrupted pip leaves it behind.
    scratch = os.path.join(folder, "scratch")
    os.makedirs(scratch, exist_ok=True)
    environment = {**defaults, **os.environ, "PIP_USER": "0", "TMPDIR": scratch}
    child = subprocess.run(command, cwd=ROOT, env=environment, text=True, check=False,
                           stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    shutil.rmtree(scratch, ignore_errors=True)
    if child.returncode:
        # pip's first line about a failed child ("subprocess-exited-with-error") says nothing; the child's own does.
        reasons = re.findall(r"^ *error: (?!subprocess-exited)(.+)", child.stderr, re.M | re.I)
        reason = reasons[0] if reasons else f"{os.path.basename(command[0])} ended with exit code {child.returncode}"
        raise SetupError(f"Could not install mitsonar's packages (is there a network?): {reason}")


@contextlib.contextmanager
def _alone(folder):
    """Hold the lock of `folder`, a file beside it, which the system takes back however the process ends."""
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
    return os.path.exists(_python(folder)) and _read(_state_file(folder)) == _identity(folder) + _digest()


def _identity(folder):
    """Return what makes an environment another one: the checkout it leads to and the interpreter it was made with."""
    return f"{ROOT}\n{os.path.realpath(_python(folder))}\n"


def _digest():
    with open(PROJECT, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def _python(folder):
    return os.path.join(folder, "bin", "python")


def _state_file(folder):
    return os.path.join(folder, "mitsonar-state")


def _read(path):
    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except OSError:
        return None


def _write(path, text):
    with open(f"{path}.new", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(f"{path}.new", path)
