"""Main lobe of a sidescan's faces along the platform, by range, and on the device by gate.

    b(u, R) = p_t(u, R) p_r(u, R)

the complex two-way pressure of both faces (`sonar.faces.near_field`) at the cosine u along the platform and the range
R.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.sonar.faces.near_field import near_pressure
from mitsonar.sonar.faces.sidescan import Sidescan

WIDEST = 0.2                       # cosine at which lobes are cut: pings are too far apart for wider lobes to matter
LOBE_END = 1e-3                    # two-way intensity at which the main lobe ends (-30 dB)
STEP = 1 / 32                      # step of cosines, in wavelengths over the face's length
NODES = 64                         # nodes in a lobe's table
PER_OCTAVE = 6.0                   # ranges of the beam's table
NEAREST, NEAREST_LENGTHS = 0.5, 0.5      # [m], and in lengths of the face: shortest range of the beam's table


@dataclass(frozen=True, kw_only=True)
class SideBeam:
    """The main lobe along the platform, tabulated at some ranges."""

    ranges: np.ndarray  # (K,) [m]: ascending
    edge: np.ndarray  # (K,) [-]: cosine u at the edge of the lobe
    pressure: np.ndarray  # (K, N) [-]: two-way, from the axis to the edge, for phases that fall with the distance

    @property
    def width(self) -> np.ndarray:
        """Return the equivalent two-way widths ψ = ∫ |b|² du (K,) [-]."""
        power = np.abs(self.pressure) ** 2
        return 2 * self.edge / (power.shape[1] - 1) * (power.sum(1) - 0.5 * (power[:, 0] + power[:, -1]))

    def nearest(self, distance: np.ndarray) -> np.ndarray:
        """Return the index of the range (...) whose ratio to a distance (...) [m] is nearest to 1."""
        if len(self.ranges) == 1:
            return np.zeros(np.shape(distance), int)
        return np.searchsorted(np.sqrt(self.ranges[1:] * self.ranges[:-1]), distance)


def main_lobe(sonar: Sidescan, farthest: float) -> SideBeam:
    """Return the two-way main lobe along the platform, down to -30 dB, up to a range [m]."""
    wavelength, length = sonar.wavelength, max(sonar.transmit.length, sonar.receive.length)
    nearest = max(NEAREST, NEAREST_LENGTHS * length)
    # beyond this range the beam no longer changes
    far = max(nearest, min(farthest, 8 * length ** 2 / wavelength))
    ranges = np.geomspace(nearest, far, 1 + int(np.ceil(PER_OCTAVE * np.log2(far / nearest))))
    widest, step = WIDEST, WIDEST / NODES
    if length:
        widest, step = min(2 * wavelength / length + length / nearest, WIDEST), STEP * wavelength / length
    u = np.linspace(0, widest, NODES + int(widest / step))
    pressure = near_pressure(sonar.transmit, u, ranges, wavelength)
    pressure = pressure * (pressure if sonar.one_face else near_pressure(sonar.receive, u, ranges, wavelength))
    pressure /= np.abs(pressure).max(1, keepdims=True)
    edge, table = np.empty(len(ranges)), np.empty((len(ranges), NODES), complex)
    for number, lobe in enumerate(pressure):
        edge[number] = u[min(np.flatnonzero(np.abs(lobe) ** 2 > LOBE_END)[-1] + 1, len(u) - 1)]
        table[number] = np.interp(np.linspace(0, edge[number], NODES), u, lobe)
    # `near_pressure` has phases that rise with the distance
    return SideBeam(ranges=ranges, edge=edge, pressure=table.conj())


class GateBeam:
    """The lobe of each gate on the device."""

    def __init__(self, beam: SideBeam, slant_range: np.ndarray, per_width: float):
        # slant_range (gates,) [m]; per_width [1/m]: scatterers per equivalent width and metre of slant range
        lib = arrays_of(mi.Float)
        steps = np.diff(beam.pressure, axis=1, append=beam.pressure[:, -1:])
        table = np.stack([np.real(beam.pressure), np.imag(beam.pressure), np.real(steps), np.imag(steps)], -1)
        self._table, self._packet = upload(mi.Float, table.astype(np.float32)), lib.Array4f
        self._nodes = dr.opaque(mi.UInt32, beam.pressure.shape[1])
        number = beam.nearest(np.maximum(slant_range, 1e-3))
        self._beam = upload(mi.UInt32, number.astype(np.uint32))
        self._edge = upload(mi.Float, beam.edge[number].astype(np.float32))
        self._density = upload(mi.Float, (per_width / beam.width[number]).astype(np.float32))
        dr.eval(self._table, self._beam, self._edge, self._density)

    def density(self, gate: mi.UInt32) -> mi.Float:
        """Return the density q / (ΔR ψ) [1/m] of gates."""
        return dr.gather(mi.Float, self._density, gate)

    def edge(self, gate: mi.UInt32) -> mi.Float:
        """Return the cosines u at the edge of the lobes of gates."""
        return dr.gather(mi.Float, self._edge, gate)

    def lobe(self, gate: mi.UInt32) -> tuple[mi.Float, mi.UInt32]:
        """Return the edges of the lobes of gates, and where their tables begin."""
        return self.edge(gate), dr.gather(mi.UInt32, self._beam, gate) * self._nodes

    def pressure(self, lobe: tuple[mi.Float, mi.UInt32], u: mi.Float, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        """Return the complex two-way pressure b of lobes at cosines u; 0 beyond their edges."""
        (edge, begin), last = lobe, mi.Float(self._nodes - 1)
        inside = active & (abs(u) < edge)
        node = held(abs(u) * (last / edge), 0, last)
        four = dr.gather(self._packet, self._table, begin + mi.UInt32(node), inside)
        part = node - dr.floor(node)
        real, imaginary = (dr.select(inside, four[k] + part * four[k + 2], 0) for k in (0, 1))
        return real, imaginary
