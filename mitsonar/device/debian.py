"""Fetch and unpack Debian packages without root, by the standard library alone.

apt-get works for an ordinary user if its package lists and cache are folders of that user; it checks signatures as
usual. Packages are unpacked into a new folder, which gets its final name when complete.
"""
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence

# The C and C++ runtimes must be those the interpreter already runs on; every machine with apt has them.
SYSTEM_ONLY = {"libc6", "libgcc-s1", "libstdc++6"}


class Unavailable(Exception):
    """Report in one clause that a package could not be fetched."""


class Packages:
    """Fetch the package lists of this machine's release, and packages from them."""

    def __init__(self, say: Callable[[str], None] = print):
        missing = [tool for tool in ("apt-get", "apt-cache", "dpkg-deb") if not shutil.which(tool)]
        if missing:
            raise Unavailable(f"this machine has no {missing[0]}")
        self._say = say
        self._folder = tempfile.TemporaryDirectory(prefix="mitsonar-")
        os.makedirs(f"{self._folder.name}/lists/partial")
        settings = (f"Dir::State::Lists={self._folder.name}/lists", f"Dir::Cache={self._folder.name}/cache",
                    "Debug::NoLocking=1", "APT::Sandbox::User=", "Acquire::Languages=none", "Acquire::Retries=2")
        self._options = [f"-o{setting}" for setting in settings]
        say("fetching Debian's package lists")
        self._run("apt-get", "-qq", "--error-on=any", "update")

    def names(self, prefix: str) -> list[str]:
        """Return the names of all packages that begin with `prefix`."""
        return self._run("apt-cache", "pkgnames", prefix).split()

    def closure(self, names: Sequence[str]) -> list[str]:
        """Return `names` and all their dependencies, except the C and C++ runtimes."""
        text = self._run("apt-cache", "depends", "--recurse", "--no-recommends", "--no-suggests", "--no-conflicts",
                         "--no-breaks", "--no-replaces", "--no-enhances", *names)
        needs: dict[str, list[str]] = {}
        package: list[str] = []
        for line in text.splitlines():
            if not line.startswith(" "):
                package = needs.setdefault(line.strip(), [])
            elif match := re.match(r"\s*\|?(?:Pre)?Depends: ([a-z0-9][^ ]*)", line):
                package.append(match[1])
        packages, waiting = set(), list(names)
        while waiting:
            name = waiting.pop()
            if name not in packages and name not in SYSTEM_ONLY:
                packages.add(name)
                waiting += needs.get(name, [])
        return sorted(packages)

    def unpack(self, names: Sequence[str], folder: str) -> None:
        """Download packages and replace `folder` by their contents, as a whole or not at all."""
        self._say(f"fetching {' '.join(names)}")
        self._run("apt-get", "-qq", "download", *names)
        os.makedirs(os.path.dirname(folder), exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".unpacking-", dir=os.path.dirname(folder)) as part:
            for name in os.listdir(self._folder.name):
                if name.endswith(".deb"):
                    self._run("dpkg-deb", "-x", name, f"{part}/new")
            if os.path.isdir(folder):
                os.rename(folder, f"{part}/old")
            os.rename(f"{part}/new", folder)

    def _run(self, tool: str, *arguments: str) -> str:
        options = self._options if tool.startswith("apt") else []
        child = subprocess.run([tool, *options, *arguments], cwd=self._folder.name, stdin=subprocess.DEVNULL,
                               capture_output=True, encoding="utf-8", errors="replace", check=False)
        if child.returncode:
            errors = re.findall(r"^(?:E: |dpkg\S* error: )(.+)", child.stderr, re.M)
            raise Unavailable(f"{tool} says: {errors[0] if errors else f'exit code {child.returncode}'}")
        return child.stdout
