"""Earliest arrival at a point: aimed on the device, searched exhaustively in NumPy where aiming may miss it.

Within the range that no two rays to the point's depth share (`sole_range`) the ray that aiming finds is the only one.
All other points, and those where aiming fails, use the reference (`eigenrays`), which misses no ray. Most pings have no
such points, or a few at the edge of a shadow.
"""
from dataclasses import dataclass

import drjit as dr
import numpy as np

from mitsonar.device.arrays import compressed, picked, upload
from mitsonar.device.types import ArrayTypes, Bool, Float, Float64, UInt32
from mitsonar.water.profile import SoundSpeedProfile

from ..numpy_rays.eigenrays import eigenray
from .aiming import CLOSE_ENOUGH, aim
from .layer_table import LayerTable, within_sole_range
from .two_point import MAX_TUBE_GAIN, PointState, SourceState, to_hit


@dataclass(frozen=True, kw_only=True)
class Arrival:
    """Rays from sources to points, (R,) each."""

    found: Bool
    travel_time: Float64  # [s]
    arc_length: Float  # [m]
    spreading_area: Float  # [m²/sr]
    ray_parameter: Float64  # [s/m]
    launch_sine: Float64  # positive down
    arrival_sine: Float
    sound_speed: Float64  # [m/s]: at the point


def earliest(table: LayerTable, lib: ArrayTypes, source: SourceState | PointState, source_index: UInt32,
             x: Float64, z: Float64, active: Bool) -> Arrival:
    """Find and evaluate the earliest direct or once-turned ray from sources to points."""
    # source_index (R,); x, z (R,) [m]; active (R,)
    active &= dr.isfinite(x) & dr.isfinite(z)
    end = PointState.at(table, z)
    sine0, cosine0, found = aim(table, lib, source, source_index, x, end, active)
    time, arc, area, p, sine, c, _ = to_hit(table, lib, source, source_index, sine0, cosine0, x, end, found,
                                            dr.opaque(lib.Float64, CLOSE_ENOUGH))
    z0, _, _ = source.gather(lib, source_index)
    found &= dr.isfinite(time) & dr.isfinite(p)
    unsure = active & ~(found & within_sole_range(table, z0, z, x))
    state = {"found": found, "travel_time": time, "arc_length": arc, "spreading_area": area, "ray_parameter": p,
             "launch_sine": sine0, "arrival_sine": sine, "sound_speed": c}
    dr.eval(state, unsure)
    some = compressed(unsure)
    if dr.width(some):
        count = max(map(dr.width, (unsure, *state.values())))
        index = dr.arange(lib.UInt32, count)
        source_depth, distance, depth = (picked(value, some).numpy() for value in (z0, x, z))
        state = {name: picked(value, index) for name, value in state.items()}
        for name, value in _looked_for(table.profile, source_depth, depth, distance).items():
            kind = type(state[name])
            dr.scatter(state[name], upload(kind, value.astype(dr.zeros(kind, 1).numpy().dtype)), some)
    return Arrival(**state)


def _looked_for(profile: SoundSpeedProfile, source_depth: np.ndarray, depth: np.ndarray,
                distance: np.ndarray) -> dict[str, np.ndarray]:
    """Return the fields of an `Arrival` from the reference."""
    ray = eigenray(profile, source_depth, depth, distance)
    found = ray.exists
    area = np.maximum(ray.spreading_area, (distance ** 2 + (depth - source_depth) ** 2) / MAX_TUBE_GAIN)
    return {"found": found, "travel_time": ray.travel_time, "arc_length": ray.arc_length, "spreading_area": area,
            "ray_parameter": ray.ray_parameter, "launch_sine": np.sin(ray.launch_angle),
            "arrival_sine": np.sin(ray.arrival_angle), "sound_speed": profile.at(depth)}
