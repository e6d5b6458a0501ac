"""The house: imports run one way, physics knows no Mitsuba, and no file hides two rooms.

Read from the sources by AST, imports inside functions included, so that nothing has to be importable.
"""
import ast
import functools
import sys
from pathlib import Path

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
    labels
    viewing
    validation
    sweep dataset
    comparison
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

SOURCES = sorted([*(ROOT / "mitsonar").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")])
ALL_PYTHON = sorted([*SOURCES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "scenes").rglob("*.py")])


def name_of(path):
    """The dotted module name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "mitsonar" else ("mitsonar", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@functools.cache
def imports_of(path):
    """All module names a source file imports; ``from mitsonar import x`` counts as mitsonar.x."""
    package = name_of(path) if path.name == "__init__.py" else name_of(path).rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[:len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*base, *([node.module] if node.module else [])])
            found.update(f"{base}.{alias.name}" if base == "mitsonar" else base for alias in node.names)
    return found


def roots_of(path):
    """The packages a source file imports from."""
    return {module.partition(".")[0] for module in imports_of(path)}


def room_of(module):
    """The room a module stands in: mitsonar.water.profile -> water; "" for the package itself."""
    return ".".join(module.split(".")[1:2])


def test_imports_point_to_lower_floors_only():
    rooms = {path: room_of(name_of(path)) for path in SOURCES if room_of(name_of(path))}
    lost = [str(path.relative_to(ROOT)) for path, room in rooms.items() if room not in RANK]
    assert not lost, "in no room of this test's FLOORS"
    upwards = [f"{path.relative_to(ROOT)} imports {module}" for path, room in rooms.items()
               for module in imports_of(path)
               if module.split(".")[0] == "mitsonar" and RANK.get(room_of(module), -1) > RANK[room]]
    assert rooms and not upwards, "\n".join(["these stand above:", *upwards])


def test_physics_and_files_know_no_mitsuba():
    found = [f"{path.relative_to(ROOT)} imports {package}" for path in SOURCES
             for package, rooms in (("mitsuba", WITHOUT_MITSUBA), ("drjit", WITHOUT_DRJIT))
             if room_of(name_of(path)) in rooms and package in roots_of(path)]
    assert not found, "\n".join(found)


def test_set_up_needs_the_standard_library_only():
    # The test runner is imported when the environment stands.
    found = {name_of(path): roots_of(path) - sys.stdlib_module_names - {"mitsonar", "pytest"} for path in SOURCES
             if name_of(path) in STANDARD_LIBRARY_ONLY}
    assert set(found) == STANDARD_LIBRARY_ONLY and not any(found.values()), found


def test_files_stay_readable():
    found = []
    for path in ALL_PYTHON:
        lines = path.read_text(encoding="utf-8").splitlines()
        found += [f"{path.relative_to(ROOT)}: {len(lines)} lines"] if len(lines) > 500 else []
        found += [f"{path.relative_to(ROOT)}:{number}: {len(line)} characters" for number, line in enumerate(lines, 1)
                  if len(line) > 120]
    assert ALL_PYTHON and not found, "\n".join(found)


KINDS = {file.parent.name for file in (ROOT / "mitsonar" / "survey").glob("*/kind.py")}


def test_no_kind_of_sonar_imports_another():
    """Code that two kinds need belongs in a folder that all kinds share."""
    found = []
    for path in SOURCES:
        here = name_of(path).split(".")
        if here[1:2] == ["survey"] and len(here) > 3 and here[2] in KINDS:
            found += [f"{name_of(path)} imports {module}" for module in imports_of(path)
                      if module.split(".")[:2] == ["mitsonar", "survey"] and len(module.split(".")) > 2
                      and module.split(".")[2] in KINDS - {here[2]}]
    assert not found, "\n".join(found)


def test_plots_compute_no_rays_and_files_know_no_survey():
    for room, forbidden in (("plots", {"propagation", "survey", "echoes"}),
                            ("io", {"propagation", "signal", "scene", "echoes", "survey"})):
        for path in SOURCES:
            if room_of(name_of(path)) == room:
                rooms = {room_of(module) for module in imports_of(path) if module.split(".")[0] == "mitsonar"}
                assert not rooms & forbidden, name_of(path)


def test_no_folder_is_crowded():
    folders = {path.parent for path in SOURCES}
    crowded = [str(folder.relative_to(ROOT)) for folder in folders if len(list(folder.glob("*.py"))) > 17]
    assert not crowded


def test_every_class_of_the_package_has_a_name_of_its_own():
    homes = {}
    for path in SOURCES:
        if path.is_relative_to(ROOT / "mitsonar"):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    homes.setdefault(node.name.lstrip("_"), []).append(name_of(path))
    assert not {name: modules for name, modules in homes.items() if len(modules) > 1}
