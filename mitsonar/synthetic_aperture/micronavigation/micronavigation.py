"""Micronavigation by displaced phase centres: the track of a sonar from ping to ping, estimated from its own echoes.

    X_(p+1) = X_p + R(ψ_p) (R(ψ°_p)ᵀ (X°_(p+1) - X°_p) + [surge, sway, heave]_p)
    ψ_(p+1) = ψ_p + ψ°_(p+1) - ψ°_p + yaw_p

X°, ψ° -> the ``trajectory`` of the navigation; surge, sway, heave, yaw -> its errors from one ping to the next, in the
frame of the first ping, from the overlap of both pings (`step`). Receivers move while echoes arrive, so positions are
those half a delay after each transmission, and headings those one delay after it.

The coherence falls with the distance of phase centres, which determines the surge. Delays over windows of range
determine sway and heave separately where the windows' grazing angles differ, else only their sum. The tilt of the
delays along the receivers determines the yaw. Errors of yaw add up to errors of sway. Roll and pitch are not estimated;
they are those of the navigation.

References
----------
Bellettini and Pinto (2002), IEEE J. Oceanic Eng. 27, 780.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from mitsonar.signal.matched_filtering import compression, matched_filter
from mitsonar.sonar.pulses.pulses import pulse_of

from ..focusing.poses import MOTION, Poses, poses_of
from ..products.coherence import aperture_coherence, beam_spread, delay_deviation
from ..record import check_raw
from .pairs import NODES, Arrays, Correction, PingPairs, arrays_of, ground_points, overlapping, pair_delays, together
from .step import (
    HIGHEST,
    LEAST,
    SurgeEstimate,
    Trust,
    correlated,
    finer,
    fitted_surge,
    lagged,
    laid_on_ground,
    least_squares,
    phase_covariance,
    slants,
)
from .track import PARTS, integrated, since, step_record

PASSES = 2                         # over the strip; the second starts from the result of the first
NEAR = 0.01                        # [m], search of the second pass
TURNS = 4                          # the first by envelopes, the others by phases, each with the previous correction
STEEP = 1.05                       # least range in altitudes: nearer, a window of range spans many angles
WIDE = 0.625                       # of the receivers' spacing: phase centres that determine the surge
TABLE = 1025


def micronavigate(raw: xr.Dataset, trajectory: xr.Dataset | None = None, *, window: float = 4.0,
                  search: float = 0.05, trust: Trust | None = None) -> xr.Dataset:
    """Estimate the track of a sonar from the overlap of its successive pings.

    Parameters
    ----------
    raw : Dataset
        Raw echoes. Their true trajectory is used only if `trajectory` is None.
    trajectory : Dataset or None
        Navigation to correct: motion_time, motion_x and so on. None: `straightened` of the true trajectory.
    window : float [m]
        Length of the windows of slant range; the record is cut into as many as fit.
    search : float [m]
        Largest error of the navigation from ping to ping, in slant range.
    trust : Trust or None
        Standard deviations of the navigation; None: the defaults of `Trust`.

    Returns
    -------
    Dataset
        Variables over ``step`` (from one ping to the next) and ``window``. surge, sway, heave [m] and yaw [rad] are the
        errors of the navigation, each with its theoretical standard deviation, _deviation. slant [m] is the decrease
        of the distance to the bed, with slant_deviation. coherence is that of the nearest phase centres, expected its
        theoretical value. pair_apart and pair_coherence are the distance of the phase centres and the coherence of
        every pair. motion_* is the corrected trajectory, which `focus` takes.

    Raises
    ------
    ValueError
        If `raw` has no raw echoes or fewer than two pings, pings do not overlap, or no window fits.
    """
    check_raw(raw)
    believed = straightened(raw) if trajectory is None else trajectory
    for name, value in (("window", window), ("search", search)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value} m; give a finite number above 0")
    if raw.sizes["ping"] < 2:
        raise ValueError("micronavigation compares successive pings, and there is one; give two or more")
    first = _Strip(raw=raw, poses=poses_of(believed), window=window, search=search, trust=trust or Trust())
    strip, known = first, None
    for _ in range(PASSES):
        steps = step_record(strip.steps(known), strip.ranges.mean(1), strip.arrays, strip.time, strip.poses)
        steps = since(steps, strip.poses, first.poses)
        track = integrated(steps, believed, first.poses)
        strip = replace(first, poses=poses_of(track), search=NEAR)
        known = np.stack([steps[name].values for name in PARTS], -1)
    return steps.merge(track).assign_attrs(looks=strip.looks, frequency=float(raw.attrs["frequency"]))


def straightened(raw: xr.Dataset) -> xr.Dataset:
    """Return the straight line of constant speed, depth and attitude that is nearest to the true trajectory."""
    time = raw["motion_time"].values
    even = np.polynomial.polynomial.polyvander((time - time.mean()) / max(np.ptp(time), 1e-9), 1)

    def straight(name: str) -> np.ndarray:
        values = np.asarray(raw[name].values, float)
        if name in ("motion_x", "motion_y"):
            return even @ np.linalg.lstsq(even, values, rcond=None)[0]
        return np.full(len(values), values.mean())

    return xr.Dataset({"motion_time": ("motion", time), **{name: ("motion", straight(name)) for name in MOTION}})


@dataclass(frozen=True, kw_only=True)
class _Strip:
    """Raw echoes with the present trajectory and the options of `micronavigate`."""

    raw: xr.Dataset
    poses: Poses
    window: float
    search: float
    trust: Trust

    def steps(self, known: np.ndarray | None) -> list[SurgeEstimate]:
        """Return the estimates of all steps; `known` (P - 1, 4) are the corrections made so far."""
        steps, before = [], self.compressed(0)
        for ping in range(1, self.raw.sizes["ping"]):
            after = self.compressed(ping)
            so_far = Correction() if known is None else Correction(**dict(zip(PARTS, map(float, known[ping - 1]))))
            steps.append(self.step(ping, before, after, so_far))
            before = after
        return steps

    @cached_property
    def arrays(self) -> Arrays:
        return arrays_of(self.raw)

    @cached_property
    def time(self) -> np.ndarray:
        """Times (P,) [s] of the middle of each pulse; echoes of a moving sonar have the phase of that time."""
        return np.asarray(self.raw["ping_time"].values, float) + 0.5 * pulse_of(self.raw.attrs["pulse"]).duration

    @cached_property
    def rate(self) -> float:
        return float(self.raw.attrs["sampling_rate"])

    @cached_property
    def frequency(self) -> float:
        return float(self.raw.attrs["frequency"])

    @cached_property
    def pulse_length(self) -> float:
        return compression(pulse_of(self.raw.attrs["pulse"]), self.rate)[0]

    @cached_property
    def looks(self) -> float:
        """Number of independent samples of a window."""
        return 2 * self.window / (self.arrays.sound_speed * self.pulse_length)

    @cached_property
    def ranges(self) -> np.ndarray:
        """Slant ranges (W, n) of the windows' samples."""
        speed, time = self.arrays.sound_speed, self.raw["time"].values
        above = self.arrays.bed_depth - float(self.poses.spline(self.time)[:, 2].mean())
        duration = float(pulse_of(self.raw.attrs["pulse"]).duration)
        nearest = max(0.5 * speed * float(time[0]) + 2 * self.search, STEEP * above)
        farthest = 0.5 * speed * (float(time[-1]) - duration) - 2 * self.search
        count = int((farthest - nearest) / self.window)
        if count < 1:
            raise ValueError(f"a window of {self.window:g} m does not fit into the {max(farthest - nearest, 0):.3g} m "
                             "of bed that the echoes cover; give a shorter window")
        size = int(self.window / (0.5 * speed / self.rate))
        return nearest + self.window * (np.arange(count)[:, None] + (np.arange(size) + 0.5) / size)

    @cached_property
    def theory(self) -> CubicSpline:
        """Coherence as a function of the distance of phase centres [m], for elements without noise."""
        lengths = float(self.raw.attrs["tx_length"]), float(self.raw.attrs["rx_length"])
        wide = np.linspace(-2.5 * max(lengths), 2.5 * max(lengths), TABLE)
        return CubicSpline(wide, aperture_coherence(wide, *lengths, self.arrays.sound_speed / self.frequency))

    @cached_property
    def spread(self) -> float:
        """Rms sine of the echoes' directions from abeam, limited where the nearest bed ends."""
        above = self.arrays.bed_depth - float(self.poses.spline(self.time)[:, 2].mean())
        return min(beam_spread(float(self.raw.attrs["tx_length"]), float(self.raw.attrs["rx_length"]),
                               self.arrays.sound_speed / self.frequency),
                   0.5 * float(np.sqrt(1 - min(above / self.ranges[0, 0], 1.0) ** 2)))

    def compressed(self, ping: int) -> np.ndarray:
        signal = self.raw["signal"].isel(ping=ping).values
        if not np.isfinite(signal).all():
            raise ValueError(f"the signals of ping {ping} contain values that are no numbers; repair or remove it")
        return finer(matched_filter(signal.astype(np.complex128), pulse_of(self.raw.attrs["pulse"]), self.rate))

    def step(self, ping: int, before: np.ndarray, after: np.ndarray, so_far: Correction) -> SurgeEstimate:
        """Return the estimate of the step to a ping; `trust` applies to the navigation before `so_far`."""
        correction, middle = Correction(), float(self.ranges.mean())
        time, sender = self.time[ping - 1:ping + 1], self.raw["transmitter"].values[ping - 1:ping + 1]
        spacing = np.diff(np.unique(np.round(self.arrays.rx[:, 0], 9)))
        reach = WIDE * float(spacing.min()) if len(spacing) else 0.5 * float(self.raw.attrs["rx_length"])
        for turn in range(TURNS):
            pairs = overlapping(self.poses, self.arrays, time, sender, middle, reach, correction)
            late, change, coherence = self._measured(pairs, time, sender, before, after, correction, turn == 0)
            surge, surge_error, strength = fitted_surge(np.mean(np.abs(coherence), 1), pairs.apart, self.theory,
                                                        self.looks * len(self.ranges), so_far.surge + correction.surge,
                                                        self.trust.surge)
            chosen = _nearest(pairs, surge)
            weight = self._weight(pairs, chosen, surge, strength, coherence, turn == 0)
            offset, covariance = least_squares(late[chosen], change[chosen], weight, together(so_far, correction),
                                               self.trust)
            known = correction
            correction = Correction(surge=known.surge + surge, sway=known.sway + float(offset[0]),
                                    heave=known.heave + float(offset[1]), yaw=known.yaw + float(offset[2]))
        shorter, deviation = slants(late[chosen] - (change[chosen] @ (offset * [0, 0, 1])), change[chosen], weight,
                                    self.arrays.sound_speed, self.trust)
        sway, heave, yaw = np.sqrt(np.diagonal(covariance))
        # change of each window's distance to the bed by the correction before the last turn
        known_delay = np.mean(change[chosen][..., :2], 0) @ [known.sway, known.heave]
        return SurgeEstimate(correction=correction, pairs=pairs, apart=pairs.apart + surge,
                     deviation=Correction(surge=surge_error, sway=float(sway), heave=float(heave), yaw=float(yaw)),
                     slant=shorter - 0.5 * self.arrays.sound_speed * known_delay, slant_deviation=deviation,
                     coherence=np.abs(coherence), expected=self.theory(pairs.apart + surge))

    def _measured(self, pairs: PingPairs, time: np.ndarray, sender: np.ndarray, before: np.ndarray, after: np.ndarray,
                  correction: Correction, by_envelope: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return lateness (Q, W) [s], its derivatives by sway, heave and yaw, and coherence (Q, W)."""
        ranges = self.ranges
        nodes = np.linspace(ranges[0, 0], ranges[-1, -1], NODES)
        ways = [pair_delays(self.poses, self.arrays, time, sender, pairs,
                            ground_points(self.poses, self.arrays, time, sender, pairs, nodes, correction, ahead),
                            correction) for ahead in (-self.spread, self.spread)]
        delays, change = (0.5 * (astern + ahead) for astern, ahead in zip(*ways))
        first = float(self.raw["time"].values[0])
        before_bed, after_bed = (
            laid_on_ground(signal, channel, first, self.rate, nodes, delay, ranges.ravel(), self.frequency)
            for signal, channel, delay in ((before, pairs.first, delays[0]), (after, pairs.second, delays[1])))
        coherence = correlated(before_bed, after_bed, len(ranges))
        change = CubicSpline(nodes, change, axis=1)(ranges.mean(1))
        if by_envelope:
            spacing = float(ranges[0, 1] - ranges[0, 0])
            lag, height = lagged(before_bed, after_bed, len(ranges), max(int(np.ceil(self.search / spacing)), 2))
            return 2 * spacing * lag / self.arrays.sound_speed, change, height
        return -np.angle(coherence) / (2 * np.pi * self.frequency), change, coherence

    def _weight(self, pairs: PingPairs, chosen: np.ndarray, surge: float, strength: float, coherence: np.ndarray,
                by_envelope: bool) -> np.ndarray:
        """Return the inverse covariances (W, Q, Q) of the lateness."""
        if by_envelope:
            clipped = np.clip(np.abs(coherence[chosen]), LEAST, HIGHEST)
            spread = delay_deviation(clipped, self.looks, 1 / (self.pulse_length * np.sqrt(12)))
            return np.stack([np.diag(1 / part ** 2) for part in spread.T])
        phases = phase_covariance(pairs, chosen, surge, self.theory, strength, self.looks)
        weight = np.linalg.inv(phases) * (2 * np.pi * self.frequency) ** 2
        return np.broadcast_to(weight, (len(self.ranges), *weight.shape))


def _nearest(pairs: PingPairs, surge: float) -> np.ndarray:
    """Return, for every receiver of the second ping, the pair whose phase centres are nearest."""
    order = np.argsort(np.abs(pairs.apart + surge), kind="stable")
    return np.sort(order[np.unique(pairs.second[order], return_index=True)[1]])
