"""Sound-speed layers as Dr.Jit arrays, with depth moments of 1/c² for the O(1) eigenray series.

    c(z)   = c_k + g_k (z - z_k)                     inside layer k, z positive down          [m/s]
    M_n(z) = ∫ e^n dz, e = c^-2 / r0 - 1, n = 1..4   measured from the first node             [m]

The moments give, between any two depths, the mean of 1/c² and its central moments in a handful of operations, however
many layers lie between (`two_point`). Layers are split so that c changes by at most 1 % in each: three Gauss points
then integrate the part of a layer to 1e-15 (two would not do: e^4 needs degree 4), and the split moves no number,
because the profile is linear either way.
"""

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.device.types import ArrayTypes, Bool, DrJitArray, Float, Float64, Record, UInt32
from mitsonar.water.profile import SoundSpeedProfile

from .sole_range import sole_range

FAR = 1.0e5            # [m] thickness of the constant half-spaces above and below the profile
SPEED_STEP = 0.01      # largest relative change of sound speed inside one layer
LOOKUP_SIZE = 2048
EDGE = 1e-7            # [m] tolerance of an edge; it changes arrivals by less than 1e-10 s
SAFE = 1 - 1e-6         # factor on a range, as single precision may round up
GAUSS = ((0.5 - 0.5 * 0.6 ** 0.5, 5 / 18), (0.5, 8 / 18), (0.5 + 0.5 * 0.6 ** 0.5, 5 / 18))


class LayerTable(Record):
    """Layers of a `SoundSpeedProfile` on the device; see the module's equations for the symbols."""

    lib: ArrayTypes       # Dr.Jit namespace the arrays live in
    layers: Float64       # Float64 (8 K,): z_k, c_k, g_k, z_{k+1}, M_1..M_4 at z_k
    lookup: UInt32        # UInt32 (LOOKUP_SIZE,): layer of the shallow edge of each depth bin
    top: Float64          # Float64 (1,): first node [m]
    bins_per_metre: Float64
    reference: Float64    # Float64 (1,): r0 [s²/m²]
    scale: Float64        # Float64 (1,): 1 / r0
    last: UInt32          # UInt32 (1,): index of the last layer
    cells: Float64        # Float64 (2 K,): number of the cell of `sole` as a line over depth, slope and offset
    sole: Float           # Float (C C,): `sole_range` by cells [m]
    sole_cells: Float64   # Float64 (1,): C
    radius: Float64       # Float64 (1,): of the tightest bend of a ray [m]
    profile: SoundSpeedProfile  # source of the table
    count: int

    @property
    def uniform(self) -> bool:
        """Return True if the sound speed is the same everywhere, so that rays are straight."""
        return not np.ptp(self.profile.sound_speed)

    def find(self, depth: Float64) -> UInt32:
        """Return the index of the layer that holds each depth [m]: for a node the layer below, for NaN the first.
        """
        lib, depth = self.lib, dr.detach(depth)            # a place in a table has no gradient
        cell = held((depth - self.top) * self.bins_per_metre, 0, LOOKUP_SIZE - 1)
        k = dr.gather(lib.UInt32, self.lookup, lib.UInt32(cell))
        k = dr.select(depth < self.top, 0, k)
        return _step_down(lib, dr.detach(self.layers), k, depth, self.last)

    def shape(self, k: UInt32, active: Bool | bool = True) -> tuple[Float64, Float64, Float64, Float64]:
        """Return depth, sound speed and gradient of layer k, and the depth of its lower side."""
        row = dr.gather(self.lib.Array4f64, self.layers, 2 * k, active)
        return row[0], row[1], row[2], row[3]

    def sole_range(self, depth: Float64, other: Float64) -> Float:
        """Return the range [m] within which no two rays lead from a depth to another: see `sole_range`."""
        lib, ranges = self.lib, []
        # a depth at an edge is in both cells, of which one may have the larger range; but a level ray along the edge
        # of uniform water is missing in the other cell
        for aside in (-EDGE, EDGE):
            number = []
            for z in (depth + aside, other + aside):
                line = dr.gather(lib.Array2f64, self.cells, self.find(z))
                number.append(dr.floor(held(dr.fma(line[0], z, line[1]), 0, self.sole_cells - 1)))
            index = lib.UInt32(dr.fma(number[0], self.sole_cells, number[1]))
            ranges.append(dr.gather(lib.Float, self.sole, index))
        known = dr.select(abs(depth - other) < 3 * EDGE, dr.minimum(*ranges), dr.maximum(*ranges))
        return dr.maximum(known, self.least_turn(depth, other))

    def least_turn(self, depth: Float64, other: Float64) -> Float:
        """Return the range [m] below which no ray between two depths turns: those that do are long if depths differ."""
        height = dr.minimum(abs(depth - other), self.radius)
        return self.lib.Float(SAFE * dr.sqrt(height * (2 * self.radius - height)))

    def speed(self, depth: Float64) -> tuple[Float64, Float64]:
        """Return the sound speed [m/s] and its gradient [1/s] at each depth."""
        z_k, c_k, gradient, _ = self.shape(self.find(depth))
        return dr.fma(gradient, depth - z_k, c_k), gradient

    def at(self, depth: Float64) -> tuple[Float64, list[Float64]]:
        """Return the sound speed [m/s] and the four moments M_n at each depth."""
        speed, _, moments = self.medium(depth)
        return speed, moments

    def medium(self, depth: Float64) -> tuple[Float64, Float64, list[Float64]]:
        """Return the sound speed [m/s], its gradient [1/s] and the four moments M_n at each depth."""
        k = self.find(dr.detach(depth))             # which layer it is has no gradient
        z_k, c_k, g, _ = self.shape(k)
        moments = dr.gather(self.lib.Array4f64, self.layers, 2 * k + 1)
        moments = [moments[i] for i in range(4)]
        length = depth - z_k
        for place, weight in GAUSS:
            c = dr.fma(g * length, place, c_k)
            e = self.scale / (c * c) - 1
            power = weight * length * e
            for i in range(4):
                moments[i] += power
                power *= e
        return dr.fma(g, length, c_k), g, moments


@dr.syntax
def within_sole_range(table: LayerTable, depth: Float64, other: Float64, x: Float64) -> Bool:
    """Return True for ranges x (R,) [m] below `LayerTable.sole_range`, which is looked up only where it decides."""
    sole = x < table.least_turn(depth, other)
    if ~sole:
        sole = x < table.sole_range(depth, other)
    return sole


@dr.syntax
def _step_down(lib: ArrayTypes, layers: Float64, k: UInt32, depth: Float64, last: UInt32) -> UInt32:
    """Walk from the look-up's layer to the one that holds the depth, mostly in at most one step."""
    more = (k < last) & (depth >= dr.gather(lib.Float64, layers, 8 * k + 3))
    while more:
        k += 1
        more = (k < last) & (depth >= dr.gather(lib.Float64, layers, 8 * k + 3, more))
    return k


def layer_table(profile: SoundSpeedProfile, like: DrJitArray | type) -> LayerTable:
    """Make the device table of a profile."""
    lib = arrays_of(like)
    z, c = _split(np.asarray(profile.depth, float), np.asarray(profile.sound_speed, float))
    reference = float(np.mean(c ** -2))
    x, w = np.polynomial.legendre.leggauss(12)
    thickness = np.diff(z)
    e = (c[:-1, None] + np.diff(c)[:, None] * (x + 1) / 2) ** -2 / reference - 1
    powers = np.stack([(e ** n * w / 2).sum(1) * thickness for n in range(1, 5)], -1)         # (layer, moment)
    at_node = np.concatenate([np.zeros((1, 4)), np.cumsum(powers, 0)])                        # (node, moment)
    # constant half-spaces above and below, so that every depth lies in a layer
    edge = (c[[0, -1], None] ** -2 / reference - 1) ** np.arange(1, 5)
    z = np.concatenate([[z[0] - FAR], z, [z[-1] + FAR]])
    c = np.concatenate([c[:1], c, c[-1:]])
    at_node = np.concatenate([-FAR * edge[:1], at_node, at_node[-1:] + FAR * edge[1:]])
    gradient = np.diff(c) / np.diff(z)
    rows = np.concatenate([z[:-1, None], c[:-1, None], gradient[:, None], z[1:, None], at_node[:-1]], 1)  # (layer, 8)
    sole = sole_range(profile)
    cells = np.transpose(sole.places(z[:-1], z[1:]))                                          # (layer, 2)
    float_type = dr.zeros(lib.Float, 1).numpy().dtype
    top, bottom = z[1], max(z[-2], z[1] + 1.0)
    bins = top + (bottom - top) * np.arange(LOOKUP_SIZE) / LOOKUP_SIZE
    lookup = np.clip(np.searchsorted(z, bins, side="right") - 1, 0, len(rows) - 1)
    table = LayerTable(
        lib=lib, layers=upload(lib.Float64, rows), lookup=upload(lib.UInt32, lookup.astype(np.uint32)),
        top=dr.opaque(lib.Float64, top), bins_per_metre=dr.opaque(lib.Float64, LOOKUP_SIZE / (bottom - top)),
        reference=dr.opaque(lib.Float64, reference), scale=dr.opaque(lib.Float64, 1 / reference),
        last=dr.opaque(lib.UInt32, len(rows) - 1), count=len(rows), profile=profile,
        cells=upload(lib.Float64, cells), sole=upload(lib.Float, (SAFE * sole.range).astype(float_type)),
        sole_cells=dr.opaque(lib.Float64, len(sole.range)), radius=dr.opaque(lib.Float64, sole.radius))
    dr.eval(table.layers, table.lookup, table.cells, table.sole)
    return table


def _split(z: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split layers until sound speed changes by at most SPEED_STEP in each."""
    if len(z) == 1:
        return np.array([z[0], z[0] + 1.0]), np.repeat(c, 2)
    parts = np.maximum(1, np.ceil(np.abs(np.diff(c)) / (SPEED_STEP * c[:-1]))).astype(int)
    inner = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(z[:-1], z[1:], parts)]
    depth = np.concatenate([*inner, z[-1:]])
    return depth, np.interp(depth, z, c)
