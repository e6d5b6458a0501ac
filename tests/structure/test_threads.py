"""The first use may come from several threads at once: one imports, sets the variant and registers, the others wait.

Tests of the first use run in a process of their own, where nothing has been used yet, and change threads as often as
Python can. Later, what works on the device waits for its turn.
"""
import ast
import importlib
import os
import subprocess
import sys
import threading

import pytest
from test_import_direction import ROOT, SOURCES, name_of

from mitsonar.device.lazy import homes_of
from mitsonar.device.turns import TURN

AT_ONCE = """
import sys, threading
sys.setswitchinterval(1e-5)

def at_once(works):
    start, errors = threading.Barrier(len(works)), []
    def run(work):
        start.wait()
        try:
            work()
        except BaseException as error:
            errors.append(f"{type(error).__name__}: {error}")
    threads = [threading.Thread(target=run, args=(work,)) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return errors
"""
RENDERS = """
import mitsonar
images = []
def render():
    scene = mitsonar.load_file("scenes/sidescan_flat.xml", pings=2, rays=60000, bins=50)
    images.append(mitsonar.render(scene, seed=1).level.values.tobytes())
def of_the_users_variant():
    import mitsuba
    mitsuba.set_variant("llvm_ad_mono")
    render()
print(at_once(WORKS), len(images), len(set(images)))
"""
WORKS = {"one use": "[render] * 8", "some set the variant": "[render, of_the_users_variant] * 4"}
NAMES = """
import mitsonar
print(at_once([lambda name=name: getattr(mitsonar, name) for name in mitsonar.__all__]))
"""
STUBS = (ROOT / "mitsonar").rglob("__init__.pyi")
HOMES = {package: homes_of(package, stub) for stub in STUBS for package in [name_of(stub)]}


def printed(code):
    """Run `code` in a process of its own and return what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.run([sys.executable, "-c", AT_ONCE + code], cwd=ROOT, env=environment, capture_output=True,
                           text=True, stdin=subprocess.DEVNULL, check=False, timeout=120)
    assert child.returncode == 0, child.stderr
    return child.stdout.strip()


@pytest.mark.parametrize("works", WORKS)
def test_eight_threads_may_be_the_first_to_render(works):
    assert printed(RENDERS.replace("WORKS", WORKS[works])) == "[] 8 1"


def test_every_name_may_be_used_first_at_the_same_time():
    assert printed(NAMES) == "[]"


def test_no_module_waits_for_a_first_use_while_it_is_imported():
    """A thread that holds the lock of first uses may be waiting for a module: import from where a name is defined."""
    found = []
    for path in SOURCES:
        package = (name_of(path) if path.name == "__init__.py" else name_of(path).rpartition(".")[0]).split(".")
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom):
                parents = package[:len(package) - node.level + 1] if node.level else []
                homes = HOMES.get(".".join([*parents, *([node.module] if node.module else [])]), {})
                found += [f"{name_of(path)}: {alias.name}" for alias in node.names if ":" in homes.get(alias.name, "")]
    assert HOMES and SOURCES and not found, "\n".join(found)


DOORS = ("mitsonar.render", "mitsonar.frames", "mitsonar.impulse_response", "mitsonar.element_signals",
         "mitsonar.raw_echoes", "mitsonar.focus", "mitsonar.gradient", "mitsonar.directional_derivative",
         "mitsonar.gradient_check", "mitsonar.synthetic_aperture.focus",
         *(f"mitsonar.signal.beamforming.{name}" for name in ("delay_and_sum", "focus", "backproject")))


@pytest.mark.parametrize("door", DOORS)
def test_what_works_on_the_device_waits_for_its_turn(door):
    """Without arguments, a function is refused: at once, if it does not wait."""
    module, _, name = door.rpartition(".")
    refused = []

    def call():
        try:
            getattr(importlib.import_module(module), name)()
        except TypeError as error:
            refused.append(error)

    caller = threading.Thread(target=call)
    with TURN:
        caller.start()
        caller.join(0.05)
        assert caller.is_alive() and not refused
    caller.join()
    assert refused
