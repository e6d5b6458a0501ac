"""A change that only moves code leaves every shipped scene's EXR as it was, byte for byte.

Scenes are rendered small, with chance and noise as they come, and SHA-256 of the files compared with stored ones. Bytes
depend on the processor and its instruction set, the compiler and the versions of what computes them, so hashes are
stored under all of these; on another machine the test is skipped. Levels that move are judged by `test_scenes`. Run
with --regenerate after a change that is meant to move numbers, or their order of summation.
"""
import hashlib
import importlib.metadata
import json
from pathlib import Path

import pytest

import mitsonar

SCENES = Path(__file__).resolve().parents[2] / "scenes"
STORED = Path(__file__).with_name("bytes.json")
SMALL = {"pings": 3, "rays": 4000, "bins": 120, "elements": 4, "range": 20, "cell": 0.08}
SMALL_SWATH = {"pings": 1, "preset": "shallow_400khz"}
NEEDED = {"published_figure_2": {"rays": 50}, "published_figure_3": {"range": 27, "sample_rate_khz": 40},
          "sidescan_flat": {"range": 50}, "sidescan_harbour": {"range": 50}, "sidescan_sediments": {"range": 50},
          "sidescan_survey": {"range": 50}, "gallery": {"range": 28}, "multibeam": {**SMALL_SWATH, "range": 60},
          "sidescan_wreck": {"bed_spacing": 0.5, "ripple_wavelength": 2.4, "stone_scour": 0},  # of 2.6 million faces
          "sidescan_targets": {"range": 50, "pings": 12}, "synthetic_aperture": {"range": 32},
          "interferometric": {"range": 50}, "echo_sounder": {"range": 50}, "patch_test": {"pings": 1, "range": 40}}
VERSIONS = ("mitsuba", "drjit", "numpy", "scipy", "OpenEXR", "mitsonar")


def machine():
    """Return what bytes depend upon beside the code."""
    llvm = Path(mitsonar.llvm.locate() or "").resolve().name
    return "; ".join([mitsonar.llvm.instruction_set(), llvm,
                      *(f"{name} {importlib.metadata.version(name)}" for name in VERSIONS)])


def small(name):
    """The parameters of a scene that make it small."""
    text = (SCENES / f"{name}.xml").read_text()
    return {key: value for key, value in {**SMALL, **NEEDED.get(name, {})}.items() if f'<default name="{key}"' in text}


def digest(file):
    """SHA-256 of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.xml")))
def test_bytes_of_the_shipped_scenes(variant, request, tmp_path, monkeypatch, name):
    stored = json.loads(STORED.read_text()) if STORED.is_file() else {}
    known = stored.setdefault(f"{variant}; {machine()}", {})
    regenerate = request.config.getoption("--regenerate")
    if name not in known and not regenerate:
        pytest.skip(f"no bytes are stored for this machine: {machine()}")
    monkeypatch.chdir(SCENES.parent)           # the files say where their scene lies
    scene = mitsonar.load_file(f"scenes/{name}.xml", **small(name))
    mitsonar.write(mitsonar.render(scene, 5), tmp_path / "record.exr")
    found = digest(tmp_path / "record.exr")
    if regenerate:
        known[name] = found
        STORED.write_text(json.dumps(stored, indent=1, sort_keys=True) + "\n")
    assert found == known[name], f"{name}: the bytes of its EXR have changed"
