"""No number leads out of a table: NaN, infinities and huge numbers in everything that is looked up by a number.

Dr.Jit's debug mode watches every gather and scatter and writes a line for each that leaves its array. Without it such
a gather reads what lies there, or ends the process.
"""
import ast
import os
import re
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float, Float64, UInt32

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.echoes.sums.origin_sums import SECTORS, sector
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.propagation.device_rays.ray_fans import build_ray_fans
from mitsonar.propagation.device_rays.two_point import PointState, source_state, to_hit, walk
from mitsonar.propagation.numpy_rays.exact_returns import exact_return
from mitsonar.propagation.returns.travel import steady
from mitsonar.scattering.surfaces.lobe_table import LobeTable, RatioTable
from mitsonar.scene.tracing.launch import CELLS, draw
from mitsonar.water import SoundSpeedProfile, VolumeScattering
from mitsonar.water.absorption_table import Absorption
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.volume_table import volume_table

ROOT = Path(__file__).resolve().parents[2]
WILD = [np.nan, np.inf, -np.inf, 1e30, -1e30, 5e9, -5e9, 0.0, 12.0]
PROFILE = SoundSpeedProfile([0, 10, 30, 50], [1510.0, 1508, 1490, 1492])


@contextmanager
def watched():
    """Debug mode for a while; without Dr.Jit's own kernels from before, which do not watch."""
    before = dr.flag(dr.JitFlag.Debug)
    dr.set_flag(dr.JitFlag.Debug, True)
    try:
        yield
    finally:
        dr.set_flag(dr.JitFlag.Debug, before)


def wild(kind):
    """All WILD numbers in a device array."""
    return upload(kind, np.array(WILD, np.float64 if kind is Float64 else np.float32))


def pairs(kind):
    """Every WILD number with every other."""
    return [upload(kind, grid.astype(np.float64 if kind is Float64 else np.float32))
            for grid in np.meshgrid(WILD, WILD)]


def _layers():
    table = layer_table(PROFILE, Float)
    assert (table.find(wild(Float64)).numpy() < table.count).all()
    return table.at(wild(Float64))


def _source_outside_all_water():
    return source_state(layer_table(PROFILE, Float), np.array([-1e30, 1e30]))


def _walked():
    z, s = pairs(Float64)
    table = layer_table(PROFILE, Float)
    return walk(table, arrays_of(Float), z, Float64(1490), s, Float64(6e-4), Float64(100), True)


def _walked_far():
    x, p = pairs(Float64)
    x = dr.select(x < 1e6, x, dr.nan)
    return walk(layer_table(PROFILE, Float), arrays_of(Float), Float64(20), Float64(1499), Float64(0.1), p, x, True)


def _to_a_hit():
    table = layer_table(PROFILE, Float)
    sine, z = pairs(Float64)
    return to_hit(table, arrays_of(Float), source_state(table, np.array([20.0])), UInt32(0), sine, Float64(0.9),
                  Float64(100), PointState.at(table, z), dr.full(dr.mask_t(Float), True, dr.width(z)), Float64(0.01))


def _returns():
    table, lib = layer_table(PROFILE, Float), arrays_of(Float)
    place, first = pairs(Float64)
    place, first = (dr.select(abs(value) < 1e9, value, dr.nan) for value in (place, first))
    still = [dr.opaque(Float64, 0.0)] * 3
    return exact_return(table, lib, dr.opaque(Float64, 12.0), lib.Array3f64(place, 30.0, -5.0), Float64(0.1), still,
                        steady(still, still), first)[0]


def _fan_rows():
    table = layer_table(PROFILE, Float)
    fans = build_ray_fans(table, PROFILE, [5.0, 20.0], slab=(0, 50), max_range=60, rows=64)
    row, off = fans.row(dr.full(UInt32, 1, len(WILD)), wild(Float))
    rows = dr.width(fans.size) // 2
    assert ((row.numpy() >= rows) & (row.numpy() < 2 * rows)).all()
    return off


def _absorption():
    column = AbsorptionColumn(np.array([0.0, 50.0]), np.array([0.03, 0.02]))
    a, b = pairs(Float)
    return Absorption(column, PROFILE, 50.0, Float).two_way_db(a, b, Float(10), Float(6e-4))


def _volume():
    return volume_table(VolumeScattering([0.0, 10.0, 30.0], [-80.0, -70.0, -75.0]), Float).at(wild(Float))


def _sectors():
    found = sector(wild(Float), Float(20), 100.0)
    assert (found.numpy() < SECTORS).all()
    return found


def _lobes():
    log_q, alpha = pairs(Float)
    return LobeTable(arrays_of(Float), upload).look_up(log_q, alpha)


def _ratios():
    return RatioTable(arrays_of(Float), upload, 3.2).look_up(*pairs(Float))


def _quantiles():
    return draw(upload(Float, np.linspace(0, 1, CELLS + 1).astype(np.float32)), UInt32(0), wild(Float))


LOOKUPS = [value for name, value in list(globals().items()) if name.startswith("_") and callable(value)
           and getattr(value, "__module__", "") == __name__]


@pytest.mark.parametrize("look", LOOKUPS, ids=lambda look: look.__name__.strip("_"))
def test_no_number_leads_out_of_a_table(look, capfd):
    with watched():
        dr.eval(look())
        dr.sync_thread()
    assert "out-of-bounds" not in capfd.readouterr().err


@pytest.mark.parametrize("kind", [Float, Float64])
def test_nan_is_held_at_the_lower_end(kind):
    assert held(wild(kind), 0, 10).numpy().tolist() == [0, 10, 0, 10, 0, 10, 0, 0, 10]


def test_no_index_is_made_of_what_clip_lets_through():
    """`clip` lets NaN through, and a whole number made of that is out of every table."""
    for path in [*(ROOT / "mitsonar").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and re.search(r"(?i)u?int32(\W|$)|u?int32_array_t", ast.unparse(node.func)):
                assert "dr.clip(" not in "".join(map(ast.unparse, node.args)), f"{path}: {ast.unparse(node)}"


SCENE = """
import faulthandler
faulthandler.enable()
import numpy as np
import mitsonar
import mitsuba as mi
import drjit as dr
mi.set_variant("llvm_ad_mono")
from summer import SUMMER_TEXT
from mitsonar.validation.scenes import array_sonar, buried_bed, point_target
rng = np.random.default_rng(0)
distance, bearing, depth = rng.uniform(40, 200, 100), rng.uniform(0, 2 * np.pi, 100), rng.uniform(2, 38, 100)
places = [(150, 60, -18), *np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), -depth])]
scene = array_sonar({"bed": buried_bed(40.0, size=20.0), **{f"t{i}": point_target(p) for i, p in enumerate(places)}},
                    water={"profile": SUMMER_TEXT}, film={"range": 210.0}, integrator={"cell": 20.0},
                    sensor={"start": [0.0, 0.0, -17.0], "receive": "line", "receive_elements": 8,
                            "receive_pitch": 1 / 7, "receive_axis": "down", "receive_normal": "forward"})
dr.set_flag(dr.JitFlag.Debug, True)
for return_path in ("vector", "eigenray"):
    signals = mitsonar.impulse_response(scene, return_path=return_path)
    assert np.isfinite(signals.values).all()
"""


def test_points_to_which_no_ray_leads_end_no_process():
    """Through a thermocline some points lie in the shadow of some elements."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "inputs"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run([sys.executable, "-c", SCENE], capture_output=True, text=True, cwd=ROOT, timeout=300,
                          env=os.environ | {"PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    assert "out-of-bounds" not in done.stderr
