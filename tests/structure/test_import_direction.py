"""The house: imports run one way, physics knows no Mitsuba, and no file hides two rooms.

Read from the sources by AST, imports inside functions included, so that nothing has to be importable.
"""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# From the ground up: a room imports only rooms that stand before it here.
FLOORS = """
    version units device
    seabed water
    scattering
    propagation
    sonar
    signal
    hydrography
    synthetic_aperture
    imaging
    io
    scene
    echoes
    survey
    gradients
    plugins
    planning
    verbs
    inversion
    plots
    validation
    sweep dataset
    cli
    __main__
"""
RANK = {room: rank for rank, room in enumerate(FLOORS.split())}
PHYSICS = {"units", "water", "seabed", "scattering", "propagation", "sonar", "signal", "imaging",
           "hydrography", "synthetic_aperture"}
WITHOUT_MITSUBA = PHYSICS | {"device", "io", "plots"}
WITHOUT_DRJIT = {"units", "io", "plots"}
STANDARD_LIBRARY_ONLY = {f"mitsonar{name}" for name in ("", ".__main__", ".cli", ".cli.setup.bootstrap",
                                                        ".cli.setup.installer", ".device", ".device.debian",
                                                        ".device.lazy", ".device.llvm", ".version")}
# Loading a scene registers the plugins first, and what Mitsuba says of an unknown one is answered by their names.
REGISTRATION = {("mitsonar.scene.loading", "mitsonar.plugins"), ("mitsonar.scene.errors", "mitsonar.plugins")}

SOURCES = sorted([*(ROOT / "mitsonar").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")])
ALL_PYTHON = sorted([*SOURCES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "scenes").rglob("*.py")])


def name_of(path):
    """The dotted module name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "mitsonar" else ("mitsonar", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path):
    """All module names a source file imports; ``from mitsonar import x`` counts as mitsonar.x."""
    package = name_of(path) if path.name == "__init__.py" else name_of(path).rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[:len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" if base == "mitsonar" else base for alias in node.names)


def room_of(module):
    """The room a module stands in: mitsonar.water.profile -> water; "" for the package itself."""
    return ".".join(module.split(".")[1:2])


MODULES = [pytest.param(path, id=name_of(path)) for path in SOURCES]


@pytest.mark.parametrize("path", MODULES)
def test_imports_point_to_lower_floors_only(path):
    room = room_of(name_of(path))
    if not room:
        return
    assert room in RANK, f"{path.relative_to(ROOT)} is in no room of this test's FLOORS"
    for module in imports_of(path):
        other = room_of(module)
        if (name_of(path), module) in REGISTRATION:
            continue
        if module.split(".")[0] == "mitsonar" and other in RANK and other != room:
            assert RANK[other] < RANK[room], f"{path.relative_to(ROOT)} imports {module}, which stands above it"


@pytest.mark.parametrize("path", MODULES)
def test_physics_and_files_know_no_mitsuba(path):
    room, roots = room_of(name_of(path)), {module.split(".")[0] for module in imports_of(path)}
    if room in WITHOUT_MITSUBA:
        assert "mitsuba" not in roots
    if room in WITHOUT_DRJIT:
        assert "drjit" not in roots


@pytest.mark.parametrize("path", MODULES)
def test_set_up_needs_the_standard_library_only(path):
    import sys

    if name_of(path) in STANDARD_LIBRARY_ONLY:
        # The test runner is imported when the environment stands.
        assert {module.split(".")[0] for module in imports_of(path)} <= sys.stdlib_module_names | {"mitsonar", "pytest"}


@pytest.mark.parametrize("path", [pytest.param(path, id=str(path.relative_to(ROOT))) for path in ALL_PYTHON])
def test_files_stay_readable(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 500
    long = [number for number, line in enumerate(lines, 1) if len(line) > 120]
    assert not long, f"lines over 120 characters: {long}"
