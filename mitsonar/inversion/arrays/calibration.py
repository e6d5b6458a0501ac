"""Calibrate an array from the echoes of point targets: positions, delays and gains of elements.

    x̂ = argmin Σ ρ((t - t(x)) / σ_t) + |(x - x₀) / σ_x|²            `fit` on arrival times, ρ Huber's

t -> first the times of envelopes, then those of phases, whose cycles the former fix; σ_t -> deviations of peaks by
their noise, or those of residuals where these are more. The prior deviations σ_x settle what arrivals leave open: the
array as a whole may be moved and turned against platform and targets. Directions whose singular value is below 1 are
determined by the prior more than by the data. A channel's phase and its delay are the same at one carrier, and stand
in ``rx_delay``. Gains are ratios of elements, so that an error of the level has no effect.

References
----------
Huber (1964), Ann. Math. Statist. 35, 73; Rockah and Schultheiss (1987), IEEE Trans. ASSP 35, 286 and 724.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.sonar.pulses.pulses import pulse_of
from mitsonar.water.profile import SoundSpeedProfile

from ..fitting.answer import Answer, Fit, FittedParameter, named
from ..fitting.fitting import fit
from ..fitting.iteration import Stopping
from ..fitting.likelihood import Gaussian, Terms
from ..fitting.priors import Prior
from ..fitting.steps import TrustRegion
from .arrival_model import OF, UNITS, ArrivalModel
from .arrival_times import MeasuredArrivals, measured_arrivals

# σ_x where none is given; 0 holds still
BELIEVED = {"rx_position": 3e-3, "rx_delay": 1e-6, "tx_position": 0.0, "lever_arm": 0.0, "position_offset": 0.05,
            "attitude_offset": np.deg2rad(0.3), "velocity_offset": 0.2, "target_position": 0.1}
HUBER = 2.5                        # deviations beyond which a time counts less
ENVELOPES, PHASES, STEPS = 3, 5, 2  # fits by each, whose deviations are found anew, and their steps
LEAST_FALL = 1e-6                  # of the misfit, below which a fit stands still
SPREAD = 3.0                       # deviations within which peaks are looked for
LEAST = {"envelope": 1e-7, "phase": 5e-9}       # [s] of a deviation
MOST_LEFT_OUT = 0.3                # of the pings, whose cycles are wrong
SLIPPED = 0.4                      # [cycles] that envelopes are off on the median over elements, where cycles are wrong
MOST_AMBIGUOUS = 0.05              # share of phases near half a cycle off, from which cycles are in doubt
RIGID = ("shift forward", "shift to starboard", "shift down", "roll", "pitch", "yaw")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration(Answer):
    """Calibrated array, with uncertainties.

    Attributes
    ----------
    gain, gain_uncertainty : (E,) [-]
        Gains of the receivers' channels, about a mean of 1.
    rigid : dict of (float, float)
        Prior and posterior deviations [m] or [rad] of shifts and turns of the whole receive array: `RIGID`.
    residual : (float, float) [s]
        Residuals of arrivals by phase, after the envelopes and at the end: medians of magnitudes over 0.6745.
    used, asked : int
        Numbers of measured and of expected arrivals.
    ambiguous : float [-]
        Share of the phases that are more than a quarter of a cycle off.
    slipped : int
        Number of used echoes, of a target at a ping, whose envelopes indicate another cycle.
    left_out : (P,) bool
        Pings that were left out because of that.
    """

    gain: np.ndarray
    gain_uncertainty: np.ndarray
    rigid: dict[str, tuple[float, float]]
    residual: tuple[float, float]
    used: int
    asked: int
    ambiguous: float
    slipped: int
    left_out: np.ndarray

    @property
    def singular_values(self) -> np.ndarray:
        """Prior deviations over those of data alone, by direction, falling."""
        return self.observability.singular_values

    @property
    def effective(self) -> float:
        """Number of unknowns that the data determine."""
        return self.observability.effective

    def sentences(self) -> list[str]:
        """Return sentences about what the data determined."""
        said = [f"{self.used} of {self.asked} arrivals were measured; {self.effective:.0f} of "
                f"{len(self.singular_values)} unknowns are told by them, the others by what was believed."]
        for name, (before, after) in self.rigid.items():
            if after > 0.5 * before > 0:
                size = (f"{1e3 * after:.2g} mm of {1e3 * before:.2g}" if name.startswith("shift")
                        else f"{np.rad2deg(after):.2g} degrees of {np.rad2deg(before):.2g}")
                said.append(f"The array's {name} is not observable against platform and targets: {size} are left.")
        if self.ambiguous > MOST_AMBIGUOUS:
            said.append(f"{100 * self.ambiguous:.0f} % of the phases are more than a quarter of a cycle off: cycles "
                        "are in doubt; take more bandwidth, stronger targets or better beliefs.")
        if self.slipped:
            said.append(f"At {self.slipped} echoes of targets the envelopes say another cycle than the phases: what "
                        "was found is in doubt.")
        if self.left_out.any():
            said.append(f"Pings {', '.join(map(str, np.flatnonzero(self.left_out)))} were left out: their envelopes "
                        "and phases say different cycles.")
        return said

    def to_dataset(self) -> xr.Dataset:
        """Return a dataset with the names of `Fit.to_dataset`: each parameter with its start and deviations."""
        variables = {}
        for name, one in self.parameters.items():
            last = () if name == "rx_delay" else ("angle",) if name == "attitude_offset" else ("axis",)
            variables |= named(name, (*filter(None, [OF[name]]), *last), one)
        variables["rx_gain"] = (("rx",), self.gain, {"units": "1"})
        variables["rx_gain_deviation"] = (("rx",), self.gain_uncertainty, {"units": "1"})
        variables["singular_value"] = (("unknown",), self.singular_values, {"units": "1"})
        free = [name for name, one in self.parameters.items() if one.prior_deviation.any()]
        return xr.Dataset(variables, attrs={"kind": "fit", "parameters": free, "observable": " ".join(self.sentences()),
                                            "residual_before": self.residual[0], "residual_after": self.residual[1]})


def calibrated(signals: xr.DataArray, targets: np.ndarray, profile: SoundSpeedProfile, *,
               transmit: np.ndarray = np.zeros(3),
               believed: Mapping[str, float | np.ndarray] | None = None) -> Calibration:
    """Calibrate an array from the echoes of point targets.

    Parameters
    ----------
    signals : DataArray (ping, tx, rx, sample)
        Signals from `mitsonar.element_signals`, with the assumed array and track.
    targets : (K, 3) [m]
        Assumed positions of point targets, scene coordinates, z up. Their echoes have no phase of their own.
    profile : SoundSpeedProfile
        Sound-speed profile of the water.
    transmit : (3,) [m]
        Transmit element, or the middle of the transmit array, body frame.
    believed : dict or None
        Prior deviations of parameters, see `BELIEVED`, numbers or arrays of their shape; 0 fixes a parameter.

    Returns
    -------
    Calibration

    Raises
    ------
    ValueError
        If the signals have no track or pulse, a name is unknown, or too few echoes of the targets are found.
    """
    model, pulse, time = _model(signals, np.atleast_2d(np.asarray(targets, float)), profile, transmit)
    doubt = _deviations(model, believed or {})
    jacobian, free = model.linearised(model.start), np.concatenate([np.ravel(part) for part in doubt.values()])
    # deviations of predicted times
    reach = SPREAD * np.sqrt(jacobian.dense() ** 2 @ free ** 2).reshape(model.shape).max(-1)
    heard = measured_arrivals(np.asarray(signals.values)[:, 0], time, pulse, float(signals.attrs["sampling_rate"]),
                              predicted=jacobian.value.reshape(model.shape), doppler=model.doppler(), reach=reach)
    return found(model, heard, doubt, couplings=_couplings(pulse))


def found(model: ArrivalModel, heard: MeasuredArrivals, believed: dict[str, np.ndarray], *,
          couplings: Mapping[str, float] | None = None) -> Calibration:
    """Fit a model's parameters to measured arrivals."""
    coupling = {"envelope": 0.0, "phase": 0.0, **(couplings or {})}
    priors = {name: Prior(deviation=part) for name, part in believed.items() if part.any()}
    if not priors:
        raise ValueError("all parameters have a prior deviation of 0; give at least one above 0")
    models = {kind: model.coupled(by) for kind, by in coupling.items()}
    seen, left_out = np.isfinite(heard.time), np.zeros(model.shape[0], bool)
    if seen.sum() < 3 * model.shape[2] or seen.sum() < 0.1 * seen.size:
        raise ValueError(f"echoes of the targets were found in {seen.sum()} of {seen.size} places; give places and "
                         "deviations that hold them, and targets that stand out and apart")

    def fitted(kind: str, near: Fit | None, seen: np.ndarray, directions: int = 1) -> Fit:
        """Return the most probable values by envelopes or phases, starting from a fit or the start."""
        before = models[kind].value({} if near is None else near.values)
        likelihood = TimesLikelihood(heard, kind, seen, before)
        return fit(models[kind], likelihood, priors, method=TrustRegion(whole=True), directions=directions,
                   stopping=Stopping(iterations=STEPS, noise=None, fall=LEAST_FALL),
                   begin=None if near is None else lambda: near.unknowns)

    def residuals(answer: Fit) -> np.ndarray:
        predicted = models["phase"].value(answer.values)
        return TimesLikelihood(heard, "phase", seen, predicted).residual(predicted)

    while True:
        rough = fitted("envelope", None, seen)
        for _ in range(ENVELOPES - 1):
            rough = fitted("envelope", rough, seen)
        answer = rough
        for number in range(PHASES):               # all that is told is looked at by the last alone
            answer = fitted("phase", answer, seen, seen.size if number + 1 == PHASES else 1)
        envelopes = models["envelope"].value(answer.values).reshape(model.shape)
        slipped = _slipped(heard, np.where(seen, envelopes, np.nan)) & ~left_out[:, None]
        # a ping on another cycle bends all else: the others are asked again without it
        if not slipped.any() or left_out.sum() + slipped.any(1).sum() > MOST_LEFT_OUT * len(left_out):
            break
        left_out |= slipped.any(1)
        seen = seen & ~left_out[:, None, None]
    after = residuals(answer)
    gain, gain_doubt = _gains(heard)
    whole = {name: answer.parameters.get(name) or FittedParameter.still(start, model.units[name])
             for name, start in model.start.items()}
    return Calibration(
        parameters=whole, observability=answer.observability, gain=gain, gain_uncertainty=gain_doubt,
        rigid=_rigid(whole["rx_position"], answer.observability.singular_values),
        residual=(_spread(residuals(rough)), _spread(after)), used=int(seen.sum()), asked=seen.size,
        ambiguous=float(np.mean(np.abs(after) * heard.frequency > 0.25)), slipped=int(slipped.sum()),
        left_out=left_out)


class TimesLikelihood:
    """Compare arrivals of envelopes, or of the phases nearest to the predicted times; see `Likelihood`.

    Deviations are those of the peaks, or those of residuals about earlier predictions where these are more.
    """

    def __init__(self, heard: MeasuredArrivals, kind: str, seen: np.ndarray, before: np.ndarray):
        self._heard, self._kind, self.counted = heard, kind, seen.ravel()
        by = heard.bandwidth if kind == "envelope" else heard.frequency
        deviation = np.maximum(np.where(seen, heard.deviation(by), 1.0), LEAST[kind]).ravel()
        rest = self.residual(before) / deviation[self.counted]
        self._deviation = deviation * max(1.0, _spread(rest))
        self.expected = self._about(before).expected

    def terms(self, predicted: np.ndarray) -> Terms:
        """Return the misfit of times (N,); see `Likelihood.terms`."""
        return self._about(predicted).terms(predicted)

    def residual(self, predicted: np.ndarray) -> np.ndarray:
        """Return the delays [s] of the counted times over the predicted ones."""
        return (self._times(predicted) - predicted)[self.counted]

    def _about(self, predicted: np.ndarray) -> Gaussian:
        return Gaussian(np.where(self.counted, self._times(predicted), np.nan), self._deviation, robust=HUBER)

    def _times(self, predicted: np.ndarray) -> np.ndarray:
        times = self._heard.time if self._kind == "envelope" else self._heard.phase_time(
            predicted.reshape(self._heard.time.shape))
        return times.ravel()


def _model(signals: xr.DataArray, targets: np.ndarray, profile: SoundSpeedProfile, transmit: np.ndarray):
    """Return the model of arrivals, the pulse, and the times of the samples."""
    needed = ("x", "y", "z", "roll", "pitch", "heading", "ping_time", "rx_x", "rx_y", "rx_z", "time")
    missing = [name for name in needed if name not in signals.coords]
    missing += [name for name in ("pulse", "sampling_rate") if name not in signals.attrs]
    if missing or signals.dims != ("ping", "tx", "rx", "sample"):
        raise ValueError(f"signals over {', '.join(map(str, signals.dims))} without {', '.join(missing) or 'nothing'}; "
                         "give the result of mitsonar.element_signals, over ping, tx, rx and sample")
    track = Track(time=signals["ping_time"].values, position=np.stack([signals[axis].values for axis in "xyz"], 1),
                  **{angle: signals[angle].values for angle in ("roll", "pitch", "heading")})
    receive = np.stack([signals[f"rx_{axis}"].values for axis in "xyz"], 1)
    time = signals["time"].values
    return (ArrivalModel(track, receive, transmit, targets, profile, duration=float(time[-1])),
            pulse_of(signals.attrs["pulse"]), time)


def _couplings(pulse: Pulse) -> dict[str, float]:
    """Return κ of `arrival_model` [s]: peaks of a sweep of rate k are (η - 1) f₀/k too early."""
    sweeps = pulse.numbers is not None and "bandwidth" in pulse.numbers
    rate = (pulse.band[1] - pulse.band[0]) / pulse.duration if sweeps else np.inf
    return {"envelope": pulse.frequency / rate, "phase": 0.5 * pulse.duration}


def _deviations(model: ArrivalModel, believed: Mapping[str, float | np.ndarray]) -> dict[str, np.ndarray]:
    """Return prior deviations of all parameters, in their shapes."""
    unknown = [name for name in believed if name not in UNITS]
    if unknown:
        raise ValueError(f"{unknown[0]!r} is no parameter of a calibration; there are {', '.join(UNITS)}")
    found = {}
    for name, start in model.start.items():
        value = np.asarray(believed.get(name, BELIEVED[name]), float)
        try:
            found[name] = np.array(np.broadcast_to(value, start.shape))
        except ValueError:
            raise ValueError(f"deviations of {name} have the shape {value.shape}; give a number or {start.shape}"
                             ) from None
        if not (np.isfinite(found[name]).all() and np.all(found[name] >= 0)):
            raise ValueError(f"deviations of {name} must be finite numbers of at least 0")
    return found


def _slipped(heard: MeasuredArrivals, predicted: np.ndarray) -> np.ndarray:
    """Return pings (P, K) at which envelopes of a target are nearly half a cycle off the fitted phases."""
    off = np.ma.masked_invalid(heard.time - predicted)
    return np.ma.filled(np.abs(np.ma.median(off, axis=2)) * heard.frequency > SLIPPED, False)


def _spread(residual: np.ndarray) -> float:
    """Return a deviation of residuals that outliers do not change."""
    return float(np.median(np.abs(residual))) / 0.6745


def _gains(heard: MeasuredArrivals) -> tuple[np.ndarray, np.ndarray]:
    """Return gains of elements about a mean of 1, and their deviations, from the levels of all echoes."""
    level = np.log(np.abs(heard.peak)).reshape(-1, heard.peak.shape[-1])
    level = level[np.isfinite(level).all(1)]
    level = level - level.mean(1, keepdims=True)
    if not len(level):
        return np.full(level.shape[1], np.nan), np.full(level.shape[1], np.nan)
    gain = np.exp(np.median(level, 0))
    return gain / gain.mean(), 1.2533 * np.std(level, 0) / np.sqrt(len(level)) * gain


def _rigid(arms: FittedParameter, singular: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return prior and posterior deviations of shifts and turns of the receive array as a whole."""
    place, axes, told = arms.start - arms.start.mean(0), np.eye(3), {}
    for which, name in enumerate(RIGID):
        move = np.broadcast_to(axes[which], place.shape) if which < 3 else np.cross(axes[which - 3], place)
        size = np.sum(move ** 2)
        if size < 1e-12:
            continue
        after = np.tensordot(arms.seen, move / size, 2) / np.sqrt(1 + singular[:len(arms.seen)] ** 2)
        told[name] = float(np.linalg.norm(move / size * arms.prior_deviation)), float(np.linalg.norm(after))
    return told
