"""What is believed of the water and of the bed before their soundings are looked at.

    speeds      about the start, of deviation σ and covariance σ² (1 + √3 d / l) exp(-√3 d / l), d apart in depth
    bed         known: about the given depths; unknown: second differences from node to node of deviation `bed_bend`
    roll        about 0

The covariance is Matérn's of order 3/2 (Rasmussen and Williams, 2006, Gaussian Processes for Machine Learning,
eq. 4.17): profiles that have a gradient everywhere, and may change it within a length l.
"""
from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from ..gradients.sounding_bed import BedGrid

if TYPE_CHECKING:
    from scipy import sparse

__all__ = ["ProfilePrior", "bed_precision"]

FAR = 1000.0                       # [m] from the start that an unknown bed may be


@dataclass(frozen=True, kw_only=True)
class ProfilePrior:
    """Deviations and lengths that a fit begins with.

    Parameters
    ----------
    deviation : float [m/s]
        Of the speeds about the start.
    length : float [m]
        In depth, over which they belong together.
    head_deviation : float [m/s]
        Of the head's own sensor of sound speed.
    bed_deviation : float [m]
        Of a bed that is given; of one that is not, it plays no part.
    bed_bend : float [m]
        Of the second differences of a bed that is not given, from node to node.
    roll_deviation : float [rad]
        Of a roll that all beams are turned by; 0: there is none.

    Raises
    ------
    ValueError
        If a number is not finite, or not above zero (the roll's: below zero).
    """

    deviation: float = 10.0
    length: float = 15.0
    head_deviation: float = 0.3
    bed_deviation: float = 0.1
    bed_bend: float = 3.0
    roll_deviation: float = 0.0

    def __post_init__(self):
        for one in fields(self):
            value = getattr(self, one.name)
            least = 0.0 if one.name == "roll_deviation" else 1e-9
            if not (np.isfinite(value) and value >= least):
                raise ValueError(f"profile prior: {one.name} is {value:g}; give a number above zero.")

    def covariance(self, depth: np.ndarray) -> np.ndarray:
        """Give that of the speeds at depths (K,) [m]: (K, K) [m²/s²]."""
        apart = np.sqrt(3) * np.abs(depth[:, None] - depth) / self.length
        return self.deviation ** 2 * (1 + apart) * np.exp(-apart)


def bed_precision(bed: BedGrid, prior: ProfilePrior, known: bool) -> sparse.csc_array:
    """Give the inverse covariance of the bed's depths, sparse (J, J) [1/m²]."""
    from scipy import sparse

    count = bed.depth.size
    if known:
        return sparse.csc_array(sparse.identity(count) / prior.bed_deviation ** 2)
    rows = [sparse.identity(count) / FAR]
    for nodes, other, along_x in ((bed.x.size, bed.y.size, True), (bed.y.size, bed.x.size, False)):
        if nodes < 3:
            continue
        second = sparse.diags_array([np.ones(nodes - 2), -2 * np.ones(nodes - 2), np.ones(nodes - 2)],
                                    offsets=[0, 1, 2], shape=(nodes - 2, nodes))
        one = sparse.identity(other)
        rows.append((sparse.kron(one, second) if along_x else sparse.kron(second, one)) / prior.bed_bend)
    stack = sparse.vstack(rows).tocsr()
    return sparse.csc_array(stack.T @ stack)
