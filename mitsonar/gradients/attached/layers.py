"""Attach the layers of a profile to its node speeds.

    c_k = (1 - w) c_lo + w c_hi               w the place of layer k's upper side between two nodes of the profile
    g_k = (c_{k+1} - c_k) / h_k
    M_n(z_{k+1}) = M_n(z_k) + ∫ e^n dz,  e = c^-2 / r0 - 1,  n = 1..4

as in `propagation.layer_table`. The numbers are those of the table to the last bit, and only derivatives come from the
equations above. Depths and the reference r0 are constant: the series of `two_point` expands about the mean between two
depths, whatever r0 is.
"""
from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.types import Float64, UInt32
from mitsonar.propagation.device_rays.layer_table import FAR, GAUSS, LayerTable


class LayerPlaces(NamedTuple):
    """Hold the places of the K layers of a table in its profile, NumPy arrays (K,)."""

    top: np.ndarray  # [m]
    bottom: np.ndarray  # [m]
    upper: np.ndarray  # number of the node above
    lower: np.ndarray  # number of the node below
    node_depth: np.ndarray  # [m]: of `upper`
    per_metre: np.ndarray  # [1/m]: one over the distance between the two nodes


def layer_places(table: LayerTable) -> LayerPlaces:
    """Return the places of the layers of a table in its profile."""
    top, bottom = table.layers.numpy().reshape(-1, 8)[:, [0, 3]].T
    depth = table.profile.depth
    upper = np.searchsorted(depth, (top + bottom) / 2) - 1
    lower = np.minimum(upper + 1, depth.size - 1)
    upper = np.maximum(upper, 0)
    distance = depth[lower] - depth[upper]
    per_metre = np.divide(1.0, distance, out=np.zeros(len(top)), where=distance > 0)
    return LayerPlaces(top, bottom, upper, lower, depth[upper], per_metre)


def attached_layers(table: LayerTable, speeds: Float64) -> LayerTable:
    """Return the same table, attached to the speeds (N,) [m/s] at the profile's nodes."""
    nodes = table.profile.depth.size
    if dr.width(speeds) != nodes:
        raise ValueError(f"layers: {dr.width(speeds)} sound speeds for the {nodes} nodes of the profile; give one for "
                         "each node.")
    rows = dr.replace_grad(table.layers, _rows(table, speeds))
    return LayerTable(**{**vars(table), "layers": rows})


def _rows(table: LayerTable, speeds: Float64) -> Float64:
    """Compute the rows of `LayerTable.layers` from the speeds."""
    lib, places = table.lib, layer_places(table)
    index = dr.arange(lib.UInt32, table.count)
    lower, upper = (upload(lib.UInt32, node.astype(np.uint32)) for node in (places.lower, places.upper))

    def speed_at(depth: np.ndarray) -> Float64:
        share = np.where(places.per_metre > 0, (depth - places.node_depth) * places.per_metre, 0.0)
        weight = upload(lib.Float64, np.clip(share, 0, 1))
        return dr.lerp(_picked(speeds, upper), _picked(speeds, lower), weight)

    thickness = upload(lib.Float64, places.bottom - places.top)
    speed, beyond = speed_at(places.top), speed_at(places.bottom)
    gradient = (beyond - speed) / thickness
    ends = (index == 0) | (index == table.count - 1)           # no sum runs through the water beyond the profile
    moments = []
    first = table.scale / dr.square(speed) - 1                 # of the uniform water above: its top has -FAR e^n
    above = first
    for _ in range(4):
        moments.append(dr.select(index == 0, -FAR * above, 0))
        above = above * first
    powers = [lib.Float64(0)] * 4
    for place, weight in GAUSS:
        e = table.scale / dr.square(dr.lerp(speed, beyond, place)) - 1
        power = weight * thickness * e
        for n in range(4):
            powers[n] = powers[n] + power
            power = power * e
    for n in range(4):
        inner = dr.select(ends, 0, powers[n])
        moments[n] += dr.prefix_reduce(dr.ReduceOp.Add, inner, exclusive=True)
    rows = dr.zeros(lib.Float64, 8 * table.count)
    for n, column in enumerate((speed, gradient)):
        dr.scatter(rows, column, 8 * index + n + 1)
    for n, column in enumerate(moments):
        dr.scatter(rows, column, 8 * index + n + 4)
    return rows


def _picked(values: Float64, index: UInt32) -> Float64:
    return dr.gather(type(values), values, index)
