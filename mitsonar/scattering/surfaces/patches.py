"""Patches: random variation of seabed strength from place to place, which makes amplitudes K-distributed.

    σ(x, y) = σ g(⌊x/d⌋, ⌊y/d⌋),      g ~ Gamma(ν, 1/ν):  <g> = 1, <g²> = 1 + 1/ν
    p(A) = 4/(√λ Γ(ν)) (A/√λ)^ν K_(ν-1)(2 A/√λ),  <A²> = λ ν,  <A⁴>/<A²>² = 2 (1 + 1/ν)

ν -> ``shape``, d -> ``size`` [m]: the second line is the amplitude of an echo from a resolution cell within a patch,
Gaussian times √g (Jakeman 1980, J. Phys. A 13, 31; Abraham and Lyons 2002, IEEE J. Oceanic Eng. 27, 800). A cell that
holds N patches has N times the ν. g is hashed from the patch alone, as scatterers are from their cell, so every
element, ping and run meets the same seabed. It is drawn from a table of means over cells of equal probability, whose
mean is 1 to the last digit; the variance within the cells is lost, 1e-3 of <g²> at ν = 0.1 and less above.

With a border of width w, a place may belong to a patch up to w/2 away, as between sediments (`borders`). Its g has the
same distribution, but a resolution cell on a border averages both patches and varies less than ν implies.
"""
import drjit as dr
import numpy as np

from mitsonar.device.chance import Salt, hashed
from mitsonar.device.types import ArrayTypes, Bool, Float, Upload

from .borders import displacement

SMALLEST_SHAPE, LARGEST_SHAPE = 0.1, 1000.0
CELL_BITS = 13                     # the table has 2^13 cells


def gamma_cells(shape: float, count: int) -> np.ndarray:
    """Return the means of ``count`` cells of equal probability of Gamma(ν, 1/ν)."""
    # the mean over x < q is the distribution function of Gamma(ν + 1) at q
    from scipy.special import gammainc, gammaincinv

    edge = gammaincinv(shape, np.arange(count + 1) / count)
    return count * np.diff(np.concatenate([gammainc(shape + 1, edge[:-1]), [1.0]]))


class Patches:
    """Relative strength of the patch at a place."""
    # size [m]; border [m]

    def __init__(self, shape: float, size: float, lib: ArrayTypes, upload: Upload,
                 border: float = 0.0):
        if not SMALLEST_SHAPE <= shape <= LARGEST_SHAPE:
            raise ValueError(f"patchiness is {shape}; it must lie in {SMALLEST_SHAPE:g}..{LARGEST_SHAPE:g}.")
        if not 0 < size < np.inf:
            raise ValueError(f"patch_size is {size} m; it must be above 0.")
        if not 0 <= border <= size:
            raise ValueError(f"patch_border is {border} m; it must lie in 0..{size:g}, the size of the patches.")
        self.border = float(border)
        self.shape, self.size, self.lib = float(shape), float(size), lib
        self._per_metre = dr.opaque(lib.Float, 1 / self.size)
        self._cells = upload(lib.Float, gamma_cells(self.shape, 1 << CELL_BITS).astype(np.float32))
        dr.eval(self._cells)

    def at(self, x: Float, y: Float, active: Bool | bool = True) -> Float:
        """Return g [-], Float (R,), at places x and y [m] Float (R,)."""
        lib = self.lib
        if self.border:
            aside = displacement(lib, x, y)
            x, y = (v + part * dr.opaque(lib.Float, self.border) for v, part in zip((x, y), aside))
        i, j = (lib.UInt32(lib.Int32(dr.floor(v * self._per_metre))) for v in (x, y))
        return dr.gather(lib.Float, self._cells, hashed(lib, i, j, lib.UInt32(Salt.PATCH)) >> (32 - CELL_BITS), active)
