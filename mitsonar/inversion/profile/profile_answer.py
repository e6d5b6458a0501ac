"""Answer of a fit of a sound-speed profile: speeds, deviations, and what the soundings determined."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.water.profile import SoundSpeedProfile

from ..fitting.answer import FittedParameter, named

LEAST_SPAN = 0.25                  # of the column, that nodes must be told over for a profile to be one
ONE_WAY = 0.15                     # directions nearer to each other than this are one
WELL = 1 / 3                       # of the prior's deviation, that a node's must be below to count as told


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileFit:
    """Speeds at the nodes of a profile, fitted to times of soundings.

    Attributes
    ----------
    depth : array (K,) [m]
        Depths of the nodes.
    start, speed : array (K,) [m/s]
        Speeds before and after the fit.
    deviation, prior_deviation : array (K,) [m/s]
        Deviations after and before the fit, with all prior knowledge of the water. Where a node is not `told`, the
        deviation holds only if the layers lie in the order of the start.
    told : array (K,) of bool
        Nodes that the soundings determine by themselves. Over a bed of one depth, times and angles do not depend on the
        order of the layers above it: they determine which share of the water has which speed, and no more. Only nodes
        between the shallowest and the deepest soundings, if these differ, and the head's by its sensor are determined.
    singular_values : array (K,)
        Singular values of the times by the speeds, both in units of their deviations, with bed and roll free: values
        above 1 are determined by the soundings more than by the prior.
    patterns : array (K, K) [m/s]
        Pattern of each singular value in rows, one deviation large.
    column_mean, column_mean_deviation : float [m/s]
        Mean speed from the head down to the middle of the bed, and its deviation.
    bed_depths : array (3,) [m]
        Depths of the soundings: 2nd, 50th and 98th percentile.
    bed : array (ny, nx) [m]
        Depths of the bed's nodes.
    roll : float [rad]
        Roll offset.
    directions : float
        Rms distance between the unit vectors, in the horizontal plane, along which a patch of the bed was seen, in the
        middle of all soundings; infinite for a known bed, nearly 0 for a single line.
    soundings : int
        Number of soundings.
    noise : float [s]
        Deviation of the two-way times: as given, or as estimated if that is larger.
    misfit : array (I,) [s]
        Rms misfit of times by iteration.
    head_depth : float [m]
        Depth of the head.
    stopped : str
        Reason why the iterations ended.
    rival : array (K,) [m/s] or None
        If the answer is not a profile: another answer, with the layers in another order.
    rival_misfit : float [s]
        Rms misfit of the rival.
    """

    depth: np.ndarray
    start: np.ndarray
    speed: np.ndarray
    deviation: np.ndarray
    prior_deviation: np.ndarray
    told: np.ndarray
    singular_values: np.ndarray
    patterns: np.ndarray
    column_mean: float
    column_mean_deviation: float
    bed_depths: np.ndarray
    bed: np.ndarray
    roll: float
    directions: float
    soundings: int
    noise: float
    misfit: np.ndarray
    head_depth: float
    stopped: str
    rival: np.ndarray | None = None
    rival_misfit: float = np.nan

    @property
    def resolved(self) -> np.ndarray:
        """Share of each node that is known by the soundings, not from before: (K,), 0 to 1."""
        return 1 - (self.deviation / self.prior_deviation) ** 2

    @property
    def parameters(self) -> float:
        """Return the number of independent values that the soundings determine."""
        square = self.singular_values ** 2
        return float((square / (1 + square)).sum())

    @property
    def is_overlapping(self) -> bool:
        """Return True if the bed is known or was seen at several angles, which separates depth from speed."""
        return self.directions > ONE_WAY

    @property
    def is_profile(self) -> bool:
        """Return True if nodes are determined over enough of the column to call the answer a profile."""
        some = self.depth[self.told & (self.depth > self.head_depth)]
        if not self.is_overlapping:
            return False
        column = self.bed_depths[-1] - self.head_depth
        return bool(some.size >= 2 and np.ptp(some) >= LEAST_SPAN * column)

    @property
    def profile(self) -> SoundSpeedProfile:
        """Return the answer as a profile.

        Raises
        ------
        ValueError
            If the soundings do not determine one.
        """
        if not self.is_profile:
            raise ValueError(self.verdict)
        return SoundSpeedProfile(self.depth, self.speed)

    @property
    def verdict(self) -> str:
        """Return one or two sentences on what was observable."""
        low, _, high = self.bed_depths
        mean = (f"the mean sound speed from the head to the bed is {self.column_mean:.2f} +- "
                f"{self.column_mean_deviation:.2f} m/s")
        if not self.is_overlapping:
            return ("each part of the bed was seen from one direction only, so that its depth and the speed of sound "
                    "trade places: nothing is told of the water but what the smoothness of the bed makes of it; survey "
                    "lines that overlap or cross, or give the bed.")
        if not self.is_profile:
            other = "" if self.rival is None else (
                f" (other layers, up to {np.abs(self.rival - self.speed).max():.1f} m/s different, meet the times to "
                f"{1e6 * self.rival_misfit:.0f} us where these meet them to {1e6 * self.misfit[-1]:.0f})")
            return (f"soundings between {low:.1f} and {high:.1f} m do not tell a profile: rays down to one depth leave "
                    f"no trace of the order of the layers above{other}; {mean}; to know more, survey a slope that "
                    "rises to where the layers lie, from several lines.")
        some = self.told & (self.depth > self.head_depth)
        above = int((~self.told & (self.depth < low)).sum())
        rest = (f"; of the {above} nodes above {low:.0f} m no more is told than their mean" if above else "")
        return (f"soundings between {low:.1f} and {high:.1f} m tell the speed at {int(some.sum())} of the "
                f"{self.depth.size} nodes, to {np.median(self.deviation[some]):.2f} m/s in the middle{rest}; {mean}.")

    def to_dataset(self) -> xr.Dataset:
        """Return all of it as a dataset, the speeds by the names of `Fit.to_dataset`."""
        speed = FittedParameter(value=self.speed, start=self.start, uncertainty=self.deviation,
                                prior_deviation=self.prior_deviation, resolved=self.resolved, seen=self.patterns,
                                unseen=self.patterns[:0], unit="m/s")
        variables = {**named("sound_speed", ("node",), speed), "told": ("node", self.told.astype(np.int8)),
                     "depth": ("node", self.depth, {"units": "m"}),
                     "singular_value": ("pattern", self.singular_values, {"units": "1"}),
                     "sound_speed_seen": (("pattern", "node"), self.patterns, {"units": "m/s"}),
                     "misfit": ("iteration", self.misfit, {"units": "s"}),
                     "bed_depth": (("y", "x"), self.bed, {"units": "m"})}
        if self.rival is not None:
            variables["sound_speed_rival"] = ("node", self.rival, {"units": "m/s"})
        about = {"kind": "fit", "parameters": ["sound_speed"], "observable": self.verdict, "stopped": self.stopped,
                 "soundings": self.soundings, "noise_s": self.noise, "column_mean_m_s": self.column_mean,
                 "column_mean_deviation_m_s": self.column_mean_deviation, "head_depth_m": self.head_depth,
                 "roll_rad": self.roll, "directions": self.directions}
        return xr.Dataset(variables, attrs=about)
