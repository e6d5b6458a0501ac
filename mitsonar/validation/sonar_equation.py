"""Sonar equation of a level bed or sea surface, integrated over exact eigenrays: expected levels.

    <p²>(t1, t2) = 10^(SL/10) ∫ Φ(x) σ(θ) (c_b/c_0)² 10^(-2 α L/10) / A² x dx      over x with t1 <= 2 T(x) < t2

x -> horizontal range, T, L, A -> travel time, arc length and spreading area of the eigenray to the bed, θ its grazing
angle there, c_b and c_0 the sound speeds at bed and sonar, Φ = ∫ b_t² b_r² dφ over the azimuths of the beam. Neither
Mitsuba nor random rays are used. (Urick 1983; Jackson and Richardson 2007, ch. 2.)
"""
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from mitsonar.propagation.numpy_rays.eigenrays import eigenray, eigenrays
from mitsonar.water.profile import SoundSpeedProfile

NODES = 40_001


@dataclass(frozen=True, eq=False)
class FlatBed:
    """Direct eigenrays from a sonar to a level plane, at ranges (x,) from nadir to the last direct ray."""

    across: np.ndarray  # [m]: horizontal range
    time: np.ndarray  # [s]: one way
    length: np.ndarray  # [m]: one way
    launch: np.ndarray  # [rad]: at the sonar, from the horizontal
    grazing: np.ndarray  # [rad]: at the plane, from the horizontal
    spread: np.ndarray  # [1/m^4]: (c_b/c_0)² / A², the loss of a point scatterer there and back

    @classmethod
    def of(cls, profile: SoundSpeedProfile, sonar_depth: float, bed_depth: float, longest: float) -> "FlatBed":
        """Return the rays out to the horizontal range `longest` [m], or to the first range with a second arrival.

        The plane may lie above the sonar, as the sea surface does, if the water is empty otherwise.
        """
        across = np.linspace(0, longest, NODES)
        ray = eigenray(profile, sonar_depth, bed_depth, across)
        ratio = float(profile.at(bed_depth) / profile.at(sonar_depth))
        towards = np.sign(bed_depth - sonar_depth)
        columns = (across, ray.travel_time, ray.arc_length, towards * ray.launch_angle, towards * ray.arrival_angle,
                   (ratio / ray.spreading_area) ** 2)
        single = np.logical_and.accumulate(ray.exists & np.isnan(ray.turning_depth)
                                            & (towards * ray.arrival_angle > 0))
        # from some time on, rays that turn within the water arrive too
        more = eigenrays(profile, sonar_depth, bed_depth, across[::100])
        lowest = bed_depth if towards > 0 else np.inf
        turned = np.where((more.turning_depth > 0) & (more.turning_depth < lowest), more.travel_time, np.inf)
        single &= ray.travel_time < np.min(turned, initial=np.inf)
        return cls(*(column[single] for column in columns))

    def energy(self, edges: np.ndarray, strength: Callable[[np.ndarray], np.ndarray], absorption_db: float,
               azimuths: np.ndarray | float) -> np.ndarray:
        """Return the integral over the plane between two-way times."""
        # edges [s]; absorption_db [dB/m]; azimuths [rad] -> [1/m²]
        density = azimuths * strength(self.grazing) * self.spread * 10 ** (-0.2 * absorption_db * self.length)
        within = cumulative_trapezoid(density * self.across, self.across, initial=0)
        return np.diff(np.interp(edges, 2 * self.time, within, left=0.0, right=np.nan))

    def beam_azimuths(self, along_intensity: Callable[[np.ndarray], np.ndarray], sides: int = 1) -> np.ndarray:
        """Return the integral Φ (x,) [rad] of a two-way pattern along the platform over the azimuths of one side."""
        azimuth = np.linspace(0, 1, 4001) ** 3 * np.pi / 2                # dense where the beam is
        some = np.unique((np.linspace(0, 1, 800) ** 3 * (len(self.across) - 1)).astype(int))     # Φ ~ 1/x near nadir
        ring = [2 * sides * trapezoid(along_intensity(np.cos(self.launch[i]) * np.sin(azimuth)), azimuth) for i in some]
        return np.interp(self.across, self.across[some], ring)

    def grazing_at(self, time: np.ndarray) -> np.ndarray:
        """Return the grazing angles [rad] of the rays that return at two-way times [s]."""
        return np.interp(time, 2 * self.time, self.grazing)
