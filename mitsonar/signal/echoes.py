"""From hits to echo energy per time bin: the sonar equation, ray by ray.

A ray launched into ΔΩ lights dA = A ΔΩ / sin θ_i of a facet, and the echo's share of that patch at the receiver is

    p² = 10^(SL/10) B ΔΩ (σ / sin θ_i) 10^(-2 ᾱ L / 10) / A'                         [µPa²]
    A' = A (c_0 / c_h)²

SL source level, B two-way intensity pattern, σ scattering strength, θ_i grazing angle on the facet, ᾱ absorption, L arc
length, A ray-tube area per steradian of the outgoing leg: it cancels, and A' is that of the returning leg, from the
stratified reciprocity A c_0² p = A' c_h² p. What a time bin's rays bring adds up (Jackson & Richardson 2007; ray
form of the reverberation integral).

Sums are kept in 64-bit integers, so they do not depend on the order of additions, hence not on the number of threads.
One unit is 2^-50 of 10^(SL/10) 10^(-2 α R / 10) Φ / R², Φ the sonar's equivalent beam, R the bin's slant range, α
the least absorption of the water: 60 dB finer than a typical ray of a typical bin, with room for a bin 30 dB above a
perfect reflector that fills the beam.
"""
import drjit as dr
import numpy as np

from mitsonar.lookups import held
from mitsonar.propagation.device import arrays_of, upload
from mitsonar.water.column import column_integrals

__all__ = ["Absorption", "EchoSums", "echo_energy", "sum_size"]

UNIT_BITS = 50
LARGEST = 2.0 ** 58                # units a single echo may bring
ABSORPTION_STEPS = 1024


class Absorption:
    """Two-way absorption on the device; see `water.column` for the equation.

    Parameters
    ----------
    column : AbsorptionColumn
    profile : SoundSpeedProfile
    deepest : float [m]
        Of source and scene.
    like : Dr.Jit array or type
    top : float [m]
        Shallowest depth asked for.
    """

    def __init__(self, column, profile, deepest, like, top=0.0):
        self.lib = lib = arrays_of(like)
        deepest = max(float(deepest), 1.0)
        integrals, c_r = column_integrals(column, profile, deepest, ABSORPTION_STEPS, top)
        self.table = upload(lib.Float, integrals.astype(np.float32))
        self.top = dr.opaque(lib.Float, top)
        self.steps_per_metre = dr.opaque(lib.Float, ABSORPTION_STEPS / (deepest - top))
        self.c2 = dr.opaque(lib.Float, c_r ** 2)
        dr.eval(self.table)

    def __call__(self, z0, z1, arc_length, ray_parameter):
        """Loss 2 ᾱ L [dB] between depths z0 and z1 [m]; float32 arrays."""
        a, b = self._at(z0), self._at(z1)
        apart = z1 - z0
        far = abs(apart) > 0.5                              # nearer, float32 differences are worse than α itself
        per_metre = dr.select(far, 1 / dr.select(far, apart, 1), 0)
        mean, mean_product, e = ((b[i] - a[i]) * per_metre for i in range(3))
        square = ray_parameter * ray_parameter * self.c2
        flat = dr.maximum(1 - square * (1 + e), 0.01)       # about to turn: the expansion ends here
        mean += 0.5 * square / flat * (mean_product - mean * e)
        mean = dr.select(far, mean, 0.5 * (a[3] + b[3]))
        return 2 * mean * arc_length

    def _at(self, z):
        place = held((z - self.top) * self.steps_per_metre, 0, ABSORPTION_STEPS - 0.001)
        index = self.lib.UInt32(place)
        low, high = (dr.gather(self.lib.Array4f, self.table, index + i) for i in (0, 1))
        return low + (high - low) * (place - self.lib.Float(index))


def echo_energy(*, solid_angle, pattern, strength, sin_grazing, spreading_area, speed_ratio, loss):
    """Echo of one ray relative to 10^(SL/10) [1/m²].

    Parameters
    ----------
    solid_angle : ΔΩ [sr]
    pattern : B, two-way intensity pattern [-]
    strength : σ [-]
    sin_grazing : sin θ_i, of the incident ray on the facet [-]
    spreading_area : A [m²/sr], outgoing
    speed_ratio : c_h / c_0 [-]
    loss : two-way absorption as a power factor [-], relative to that of the bin's unit
    """
    shining = sin_grazing > 1e-6
    per_patch = dr.select(shining, strength / dr.select(shining, sin_grazing, 1), 0)
    return solid_angle * pattern * per_patch * loss * speed_ratio * speed_ratio / spreading_area


def sum_size(needed):
    """Entries to allocate for sums: Dr.Jit compiles the size of a scatter's target into the kernel, so few sizes
    exist."""
    return max(1 << 16, 1 << (int(needed) - 1).bit_length())


class EchoSums:
    """Integer sums of a block of pings, and their reading in physical units.

    Parameters
    ----------
    lib : Dr.Jit namespace
    rows : int
        Pings x sides of the block.
    labels : int
        Number of shapes.
    bins : int
    paths : int
        Number of paths; one is not told apart.
    """

    def __init__(self, lib, rows, labels, bins, paths=1):
        self.lib, self.rows, self.labels, self.bins, self.paths = lib, rows, labels, bins, paths
        self.energy = dr.zeros(lib.UInt64, sum_size(rows * labels * bins))
        self.depth = dr.zeros(lib.UInt64, sum_size(rows * bins))
        self.count = dr.zeros(lib.UInt64, sum_size(rows * bins))
        self.path_energy = dr.zeros(lib.UInt64, sum_size(rows * paths * bins)) if paths > 1 else None

    def add(self, *, row, label, bin, units, height, in_beam, active, path=None, counted=True):
        """Scatter echoes into their bins.

        Parameters
        ----------
        row, label, bin : UInt32 (R,)
            Row of the block; shape number from 1; time bin.
        units : Float64 (R,)
            Echo energy in units of the bin.
        height : Float (R,)
            Hit depth as a fraction [0, 1] of the scene's depth range.
        in_beam : Bool (R,)
            The ray lies in the main lobe.
        active : Bool (R,)
        path : UInt32 (R,) or None
            Number of the path from 1, where there is more than one.
        counted : bool
            Whether they are rays that arrive from where they hit, which light the bins.
        """
        lib = self.lib
        U = lib.UInt64
        units = dr.minimum(units, LARGEST)
        bins, labels = dr.opaque(lib.UInt32, self.bins), dr.opaque(lib.UInt32, self.labels)
        place = row * bins + bin
        whole = U(units + 0.5)
        dr.scatter_add(self.energy, whole, (row * labels + (label - 1)) * bins + bin, active)
        if self.path_energy is not None:
            paths = dr.opaque(lib.UInt32, self.paths)
            dr.scatter_add(self.path_energy, whole, (row * paths + (path - 1)) * bins + bin, active)
        # a quarter: depths must not overflow before the energies they are divided by
        dr.scatter_add(self.depth, U(units * lib.Float64(height) * 0.25 + 0.5), place, active)
        if counted:
            dr.scatter_add(self.count, dr.select(in_beam, U((1 << 32) + 1), U(1)), place, active)

    def read(self, unit, depth_range):
        """Give the sums as physical arrays.

        Parameters
        ----------
        unit : (bins,) [µPa²]
            Worth of one unit in each bin.
        depth_range : (float, float) [m]

        Returns
        -------
        dict of (rows, bins) arrays
            ``intensity`` [µPa²] float64, ``label_intensity`` (rows, labels, bins) of every instance, ``depth`` [m]
            float32, NaN where no echo, ``rays`` and ``rays_in_beam`` uint32; ``path_intensity`` (rows, paths, bins)
            [µPa²] where there is more than one path.
        """
        shape = (self.rows, self.bins)
        def values(sums, *shape):
            return sums.numpy()[:int(np.prod(shape))].reshape(shape)

        energy = values(self.energy, self.rows, self.labels, self.bins)
        total = energy.sum(1, dtype=np.uint64)
        height = values(self.depth, *shape) / np.maximum(total * 0.25, 1e-9)
        count = values(self.count, *shape)
        top, bottom = depth_range
        by_path = {}
        if self.path_energy is not None:
            by_path["path_intensity"] = values(self.path_energy, self.rows, self.paths, self.bins) * unit
        return {"intensity": total * unit[None], "label_intensity": energy * unit, **by_path,
                "depth": np.where(total > 0, top + height * (bottom - top), np.nan).astype(np.float32),
                "rays": (count & np.uint64(0xFFFFFFFF)).astype(np.uint32),
                "rays_in_beam": (count >> np.uint64(32)).astype(np.uint32)}
