"""Volume scattering strength against depth on the device.

    s_v(z) = c + exp(a + b (z - z_0))      in the piece around the depth z, z_0 its upper edge

The pieces are those of `water.VolumeScattering`. Bisection finds the piece, so that edges of layers stay sharp.
"""
import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.types import ArrayTypes, Bool, DrJitArray, Float, Record, UInt32

from .volume import VolumeScattering

NOTHING = -200.0                   # exponent of a piece without exponential term: e^-200 is 0 in float32


class VolumeTable(Record):
    """Pieces of a `VolumeScattering` as Dr.Jit arrays."""

    lib: ArrayTypes       # Dr.Jit namespace of the arrays
    edges: Float          # (E,) [m]
    pieces: Float         # (4 (E + 1),): a, b, c, z_0
    count: UInt32         # (1,): E

    def at(self, depth: Float, active: Bool | bool = True) -> Float:
        """Return s_v (R,) [1/m] at depths (R,) [m]."""
        piece = _pieces_above(self.lib, self.edges, self.count, depth, active)
        row = dr.gather(self.lib.Array4f, self.pieces, piece, active)
        return row[2] + dr.exp(dr.fma(row[1], depth - row[3], row[0]))


@dr.syntax
def _pieces_above(lib, edges, count, depth, active):
    """Return the number of edges at or above each depth, by bisection."""
    low, high = lib.UInt32(0), lib.UInt32(count)
    more = (low < high) & lib.Bool(active)
    while more:
        middle = (low + high) // 2
        above = dr.gather(lib.Float, edges, middle, more) <= depth
        low, high = dr.select(above, middle + 1, low), dr.select(above, high, middle)
        more = more & (low < high)
    return low


def volume_table(volume: VolumeScattering, like: DrJitArray | type) -> VolumeTable:
    """Return volume scattering as a table on the device."""
    lib = arrays_of(like)
    a, b, c = volume.pieces.T
    start = np.concatenate([volume.edges[:1], volume.edges])
    with np.errstate(invalid="ignore"):
        a = np.maximum(a + b * start, NOTHING)
    table = VolumeTable(lib=lib, edges=upload(lib.Float, volume.edges.astype(np.float32)),
                        pieces=upload(lib.Float, np.stack([a, b, c, start], -1).astype(np.float32)),
                        count=dr.opaque(lib.UInt32, len(volume.edges)))
    dr.eval(table.edges, table.pieces)
    return table
