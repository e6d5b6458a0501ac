"""The lock file has all that pyproject.toml asks for, tests included, once for every Python and system, with hashes."""
import importlib.metadata
import itertools
import re
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from mitsonar.cli.setup import bootstrap, installer

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = [f"3.{minor}" for minor in range(10, 15)]
SYSTEMS = {"linux": "Linux", "darwin": "Darwin"}
BASIC = {"mitsuba", "numpy", "scipy", "xarray", "rasterio", "matplotlib", "rich"}
LOCKED = ("cluster", "test", "docs", "ros", "video", "view")          # extras of the lock
PLACES = list(itertools.product(PYTHONS, SYSTEMS))


def lock():
    """Every pin of the lock file, and its hashes."""
    lines = Path(installer.LOCK).read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
    pins = [line.partition(" --hash=") for line in lines if line and not line.lstrip().startswith("#")]
    return [(Requirement(pin.strip()), re.findall(r"sha256:([0-9a-f]{64})\b", rest)) for pin, _, rest in pins]


def place(python, system):
    """What markers ask about an interpreter."""
    return {**default_environment(), "python_version": python, "python_full_version": f"{python}.4", "os_name": "posix",
            "sys_platform": system, "platform_system": SYSTEMS[system], "implementation_name": "cpython",
            "platform_python_implementation": "CPython"}


def pins(environment):
    """Versions by name, for one interpreter; a package pinned twice fails the test."""
    found = {}
    for pin, _ in lock():
        if pin.marker is None or pin.marker.evaluate(environment):
            assert canonicalize_name(pin.name) not in found, f"{pin.name} is pinned twice"
            (version,) = pin.specifier
            assert version.operator == "=="
            found[canonicalize_name(pin.name)] = version.version
    return found


@pytest.fixture(scope="module")
def stated():
    """The requirements of pyproject.toml: of the package, its tests and its site."""
    tomllib = pytest.importorskip("tomllib" if bootstrap.sys.version_info >= (3, 11) else "tomli")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert "mitsonar[cluster,docs]" in extras["test"]
    texts = project["dependencies"] + [text for name in LOCKED for text in extras[name]]
    return [Requirement(text) for text in texts if text != "mitsonar[cluster,docs]"]


@pytest.mark.parametrize("python, system", PLACES)
def test_every_requirement_is_pinned_to_a_version_that_meets_it(stated, python, system):
    environment = place(python, system)
    found = pins(environment)
    for requirement in stated:
        if requirement.marker is None or requirement.marker.evaluate(environment):
            assert requirement.specifier.contains(found[canonicalize_name(requirement.name)])


def needed(requirements):
    """Names of what some requirements need here, in turn, by what the installed packages ask for."""
    waiting, seen = list(requirements), set()
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        wanted = [{"extra": extra} for extra in ("", *requirement.extras)]
        if (name, frozenset(requirement.extras)) in seen or requirement.marker and not requirement.marker.evaluate():
            continue
        seen.add((name, frozenset(requirement.extras)))
        try:
            texts = importlib.metadata.requires(name) or []
        except importlib.metadata.PackageNotFoundError:        # of an extra that is not installed
            texts = []
        for text in texts:
            further = Requirement(text)
            if further.marker is None or any(further.marker.evaluate(extra) for extra in wanted):
                further.marker = None
                waiting.append(further)
    return {name for name, _ in seen}


def test_what_they_need_in_turn_is_pinned(stated):
    assert needed(stated) <= set(pins(default_environment()))


def test_a_part_of_it_has_what_its_packages_need(stated):
    """And is a part: what only tests need is not in it."""
    names = [requirement.name for requirement in stated if requirement.name.lower() in BASIC]
    part = installer.locked(names)
    here = {canonicalize_name(pin.partition("==")[0]) for pin in re.findall(r"^[\w.-]+==", part, re.M)}
    assert needed(Requirement(name) for name in names) <= here
    assert not here & {"pytest", "dask", "mkdocs", "ruff"} and "hatchling" not in here
    assert set(part.splitlines()) < set(Path(installer.LOCK).read_text(encoding="utf-8").splitlines())


def test_every_pin_has_hashes():
    assert all(hashes for _, hashes in lock())


def test_it_names_its_command_and_no_place_to_fetch_from():
    text = Path(installer.LOCK).read_text(encoding="utf-8")
    command = ("uv pip compile pyproject.toml --extra test --extra ros --extra shards --extra video --extra view "
               "--universal")
    assert command in text.partition("\naffine")[0]
    assert "://" not in text and "--index" not in text and "--find-links" not in text
