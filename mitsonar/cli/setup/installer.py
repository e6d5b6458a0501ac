"""Install mitsonar's packages into an environment, by uv if there is one, else by pip. Standard library only.

The named packages of ``requirements.lock``, and all that they need in turn by the lock's notes ``# via``, are installed
with its hashes, without any build; then the checkout itself, by the build tool in the lock. Nothing is byte-compiled:
Python compiles what is imported, which is a small part. Messages of uv and pip about large downloads and errors are
passed on.
"""
import collections
import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterable

LOCK = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "requirements.lock")
BUILD = ("hatchling", "editables")             # install the checkout
LOCKED = ("--require-hashes", "--only-binary", ":all:", "--no-deps", "-r")     # the lock has all that a package needs
CHECKOUT = ("--no-deps", "--no-build-isolation", "-e")
SYSTEM_CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"  # the only ones of Debian's pip; a bare system has none
# the user cannot mend pip's warnings about the places where it looks for packages
SHOWN = re.compile(r"\s*(?:Downloading .*\([\d.]+ ?[MG]i?B\)|Installing collected|Building|Could not fetch"
                   r"|WARNING(?!: (?:Location|Url|Skipping|The index url)\b)|ERROR|error\b)")
WIDEST, LONGEST = 160, 500  # most characters of a line that is passed on, and of a reason
REASONS = 6  # most reasons in an error sentence
CAUSE = re.compile(r"connection broken by '(.+?)': /|^ *Caused by: (.+)|^((?=.*(?:certificate|No space left)).+)"
                   # pip's first line about a failed child ("subprocess-exited-with-error") says nothing
                   r"|^ *error: (?!subprocess-exited)(.+)", re.I)


class SetupError(Exception):
    """The environment cannot be made; the message is one sentence."""


def install(folder: str, root: str, names: Iterable[str], say: Callable[[str], object]) -> None:
    """Make the environment `folder` if it is missing, and install packages and the checkout `root` into it."""
    with tempfile.NamedTemporaryFile("w", suffix=".txt", encoding="utf-8") as chosen:
        chosen.write(locked([*names, *BUILD]))
        chosen.flush()
        if not (shutil.which("uv") and _by_uv(folder, root, chosen.name, say)):
            _by_pip(folder, root, chosen.name, say)


def locked(names: Iterable[str]) -> str:
    """Return the part of the lock that holds packages and, by its notes ``# via``, what they need in turn."""
    with open(LOCK, encoding="utf-8") as file:
        entries = re.split(r"\n(?=\w)", file.read())[1:]
    needed_by = [(entry.partition("==")[0], set(re.findall(r"[\w.-]+", entry.partition("# via")[2])))
                 for entry in entries]
    needed, before = {name.lower() for name in names}, 0
    while before < len(needed):
        before = len(needed)
        needed |= {name for name, parents in needed_by if parents & needed}
    return "\n".join(entry for entry, (name, _) in zip(entries, needed_by) if name in needed) + "\n"


def python_of(folder: str) -> str:
    """Return the interpreter of an environment."""
    return os.path.join(folder, "bin", "python")


def _by_uv(folder, root, chosen, say):
    python = python_of(folder)
    try:
        run(folder, say, "uv", "venv", "--allow-existing", "--python", _base(), folder)
        run(folder, say, "uv", "pip", "install", "--python", python, *LOCKED, chosen)
        run(folder, say, "uv", "pip", "install", "--python", python, *CHECKOUT, root)
    except SetupError as error:
        say(f"{error} Going on with pip.")
        return False
    return True


def _by_pip(folder, root, chosen, say):
    import venv

    try:
        import ensurepip  # noqa: F401  (a separate package in Debian)
        has_pip = True
    except ImportError:
        has_pip = False
    try:
        venv.create(folder, symlinks=True, with_pip=has_pip)
    except (OSError, subprocess.CalledProcessError) as error:
        output = (getattr(error, "output", None) or b"").decode(errors="replace").strip().splitlines()
        reason = output[-1] if output else error
        raise SetupError(f"Could not make a Python environment in {folder}: {reason}.") from None
    pip, variables = ["-m", "pip"], {}
    if not has_pip:
        wheel = _debian_pip(folder, say)
        pip = [os.path.join(wheel, "pip")]
        if not os.path.exists(SYSTEM_CERTIFICATES):
            certificates = zipfile.ZipFile(wheel).extract("pip/_vendor/certifi/cacert.pem", os.path.dirname(wheel))
            variables = {"PIP_CERT": certificates}
    command = [python_of(folder), *pip, "install", "--disable-pip-version-check", "--no-input", "--no-compile"]
    run(folder, say, *command, *LOCKED, chosen, **variables)
    run(folder, say, *command, *CHECKOUT, root, **variables)


def _base():
    """Return the interpreter outside all environments; the running one may lie in the folder that is replaced."""
    return getattr(sys, "_base_executable", None) or sys.executable


def _debian_pip(folder, say):
    """Return the wheel of pip from Debian's package."""
    from mitsonar.device import debian

    try:
        debian.Packages(say).unpack(["python3-pip-whl"], os.path.join(folder, "pip"))
    except debian.Unavailable as error:
        raise SetupError(f"This Python has neither pip nor ensurepip, and Debian's cannot be had: {error}; "
                         "install pip or python3-venv and try again.") from None
    return glob.glob(os.path.join(folder, "pip/usr/share/python-wheels/pip-*.whl"))[0]


def run(folder: str, say: Callable[[str], object], *command: str, **defaults: str) -> None:
    """Run a command that installs into `folder`, and show its messages of progress; `defaults` are variables."""
    # A user's standing wish for installs into the home folder would make pip fail in an environment, and packages that
    # PYTHONPATH leads to would count as installed. What pip unpacks goes into a folder of ours: it is large for a /tmp
    # in memory, and an interrupted pip leaves it behind.
    scratch = os.path.join(folder, "scratch")
    environment = {**defaults, **os.environ, "PIP_USER": "0", "TMPDIR": scratch, "PYTHONUTF8": "1"}
    for name in ("PYTHONPATH", "PYTHONHOME"):
        environment.pop(name, None)
    os.makedirs(scratch, exist_ok=True)
    output = collections.deque(maxlen=1000)
    try:
        with subprocess.Popen(command, cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
                              errors="replace") as child:
            try:
                for line in child.stdout or ():
                    output.append(line)
                    if SHOWN.match(line) and ".whl.metadata" not in line:
                        say(line.strip()[:WIDEST])
            except BaseException:
                child.kill()
                raise
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    if child.returncode:
        name = os.path.basename(command[0])
        raise SetupError(_sentence(_reasons(output) or [f"{name} ended with exit code {child.returncode}"]))


def _reasons(said):
    """Return the reasons that a failed command printed, each once."""
    found = (CAUSE.search(line.rstrip()) for line in said)
    return list(dict.fromkeys(next(filter(None, match.groups())).strip()[:LONGEST] for match in found if match))


def _sentence(reasons):
    text = "; ".join(reasons[-REASONS:]).rstrip(".")
    if "certificate" in text.lower():
        return (f"Could not install mitsonar's packages: {text}. If a proxy has certificates of its own, set "
                "PIP_CERT and SSL_CERT_FILE to their file.")
    return f"Could not install mitsonar's packages (is there a network?): {text}."
