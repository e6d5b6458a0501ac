"""Signals of elements as a function of arrays, platform and point targets, and their Jacobian.

    y     what `mitsonar.element_signals` gives, the same bytes, real and imaginary parts one after the other
    J v, Jᵀ w    exact in delays and phases of all echoes: `element_levers`; over the fast sums: `element_sums`

Scatterers, rays and noise are those of the start for all values. Left out of the Jacobian, about 1/(k R) of it: how
spreading, absorption, elements' patterns and strengths of scattering change; and what comes out of shadows or falls
into them. Points of the water and bounces that are drawn by chance move with the sonar in y, and stand still in J.
"""
from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from mitsonar.echoes.ensonification import Ensonification
from mitsonar.echoes.point_targets import PointTargets
from mitsonar.scene.errors import as_exception
from mitsonar.signal.accumulation import ImpulseResponses
from mitsonar.signal.gathering import GatheredWeights
from mitsonar.signal.impulses import BandLimited, Later
from mitsonar.signal.reception import delayed
from mitsonar.survey.energy.target_echoes import band_of
from mitsonar.survey.pressure.array_survey import ArraySurvey
from mitsonar.survey.pressure.ensonified_ping import EnsonifiedPing, ensonification_of
from mitsonar.survey.pressure.ping_source import PingSource
from mitsonar.survey.pressure.pressure import SUMS_BYTES, PressureRecord
from mitsonar.survey.pressure.signals import LEAD, echoes_of_the_pulse, sent_pieces
from mitsonar.units import amplitude_from_db

from ..model import Values
from .levers import LeveredDelays, Motion, TargetEnds
from .parameters import Altered, ElementParameters
from .reception import delayed_transposed, later, response_weights
from .sums import DelayGradients, DelayTangents, StrengthGradients, StrengthTangents

LEFT_OUT = ("spreading, absorption, patterns and scattering strengths as they change with place", "edges of shadows",
            "points of the water and bounces drawn by chance")


class ElementModel:
    """Signals of a sonar's elements as a `ForwardModel`.

    Parameters
    ----------
    scene : mitsuba.Scene
        As `mitsonar.load_file` gives it.
    keys : sequence of str
        Parameters, as `element_parameters` names them.
    pings : sequence of int
    sensor : int
        Number of the sensor.
    seed : int
        Of noise, and of rays where they ensonify the scatterers.

    Attributes
    ----------
    start, units : dict
        Of the parameters.
    shape : (int, int, int, 2)
        Of y: pings, receive elements, samples, real and imaginary part.
    left_out : tuple of str
        What the Jacobian does not hold.

    Raises
    ------
    ValueError
        If the sensor has no arrays, there is no such parameter or ping.
    """

    left_out = LEFT_OUT

    @property
    def survey(self) -> ArraySurvey:
        """The run at the start."""
        return self._survey

    def __init__(self, scene: mi.Scene, keys: Sequence[str], *, pings: Sequence[int] = (0,), sensor: int = 0,
                 seed: int = 0):
        sonar: Any = scene.sensors()[sensor]
        integrator: Any = scene.integrator()
        try:
            self._survey: ArraySurvey = integrator.array_survey(scene, sonar, LEAD)
        except RuntimeError as error:
            raise as_exception(error) from error
        count = self._survey.track.pings
        for ping in pings:
            if not 0 <= ping < count:
                raise ValueError(f"ping {ping} was asked for, but the track has {count}, counted from 0")
        if not len(pings) or len(set(pings)) < len(pings):
            raise ValueError(f"{len(pings)} pings were asked for, {len(set(pings))} of them different; name each once, "
                             "and at least one")
        offsets = [np.zeros((1, 3)) if error is None else error
                   for error in (sonar.route.position_error, sonar.route.attitude_error)]
        self._parameters = ElementParameters(
            self._survey, keys, sensor=sonar.id(), pings=pings,
            offsets=(np.broadcast_to(offsets[0], (count, 3))[list(pings)],
                     np.broadcast_to(offsets[1], (count, 3))[list(pings)]))
        self._seed, self._pings = sonar.own_seed(seed), [int(ping) for ping in pings]
        self.start, self.units = self._parameters.start, self._parameters.units
        self._ensonification = ensonification_of(self._survey)
        self.shape = len(pings), self._survey.receive.elements, self._survey.samples - self._survey.lead, 2

    def __repr__(self) -> str:
        keys = ", ".join(f"{key} {value.shape}" for key, value in self.start.items())
        return f"ElementModel of {self.shape[0]} pings, {self.shape[1]} receivers, {self.shape[2]} samples by {keys}"

    def value(self, values: Values) -> np.ndarray:
        """Return the signals of values; see `ForwardModel.value`."""
        run = self._run(values)
        return np.concatenate([_flat(run.kept(run.signals(ping))) for ping in self._pings])

    def linearised(self, values: Values) -> ElementJacobian:
        """Return the signals about values, with their Jacobian; see `ForwardModel.linearised`."""
        return ElementJacobian(self._run(values), self._parameters, self.shape)

    def _run(self, values: Values) -> _Run:
        altered = self._parameters.altered(self._parameters.checked(values))
        ensonification = copy.copy(self._ensonification)
        ensonification.targets = PointTargets(altered.targets, band_of(altered.survey.pulse),
                                              altered.survey.water.profile)
        return _Run(altered=altered, ensonification=ensonification, seed=self._seed)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Run:
    """A run with some values: from pings to signals."""

    altered: Altered
    ensonification: Ensonification
    seed: int

    @property
    def survey(self) -> ArraySurvey:
        return self.altered.survey

    def record(self) -> PressureRecord:
        """What sums the echoes."""
        return _given(PressureRecord(self.survey, seed=self.seed), self.ensonification)

    def signals(self, ping: int, record: PressureRecord | None = None) -> np.ndarray:
        """Signals of a ping before the receivers' own delays, and gains: (rx, samples)."""
        survey, record = self.survey, record or self.record()
        signals = amplitude_from_db(survey.source_level_db) * echoes_of_the_pulse(record, ping, lambda share: None)
        if survey.noise is not None:
            signals = signals + survey.noise.drawn(survey.samples, self.seed, ping)
        return signals

    def kept(self, signals: np.ndarray) -> np.ndarray:
        """What receivers make of them, and the samples that are asked for: complex64."""
        survey = self.survey
        if survey.receive.delay.any():
            signals = delayed(signals, survey.receive.delay, survey.sampling_rate, survey.frequency)
        return self._cut(signals if np.all(self.altered.gain == 1) else signals * self.altered.gain[:, None])

    def later(self, signals: np.ndarray) -> np.ndarray:
        """What `kept` changes by as the receivers' delays grow, per second."""
        survey = self.survey
        found = later(signals, survey.receive.delay, survey.sampling_rate, survey.frequency)
        return self._cut(found * self.altered.gain[:, None])

    def delayed(self, signals: np.ndarray) -> np.ndarray:
        """The same before the gains."""
        survey = self.survey
        return self._cut(delayed(signals, survey.receive.delay, survey.sampling_rate, survey.frequency))

    def weights(self, kept: np.ndarray) -> np.ndarray:
        """The transpose of `kept`: of the weights (rx, kept samples) of what is asked for, those of the signals."""
        survey = self.survey
        wide = np.zeros((len(kept), survey.samples), np.complex64)
        wide[:, survey.lead:] = kept * np.conj(self.altered.gain)[:, None]
        wide[~survey.receive.working] = 0
        if survey.receive.delay.any():
            wide = delayed_transposed(wide, survey.receive.delay, survey.sampling_rate, survey.frequency)
        return wide

    def _cut(self, signals: np.ndarray) -> np.ndarray:
        signals = np.array(signals[:, self.survey.lead:])
        signals[~self.survey.receive.working] = 0
        return signals.astype(np.complex64)


def _given(record: Any, ensonification: Ensonification) -> Any:
    record.ensonification = ensonification
    return record


class _LeveredRecord(PressureRecord):
    """A record whose sums bind the levers of echoes. `like` makes the sums, of how many sheets."""

    def __init__(self, survey: ArraySurvey, *, seed: int, targets: np.ndarray, like: Any = None):
        super().__init__(survey, seed=seed)
        self._targets, self._like = TargetEnds(targets), like

    def delays(self, source: PingSource) -> LeveredDelays:
        survey = self.survey
        return LeveredDelays(source=source, transmit=survey.transmit, receive=survey.receive,
                             wavelength=survey.wavelength, sampling=survey.sampling, counts=self.counts,
                             targets=self._targets)

    def sums(self, sheets: int = 1) -> ImpulseResponses:
        return self._like(sheets)

    def taken_over(self, ensonified: EnsonifiedPing) -> None:
        """Take the echoes of a ping that are known already."""
        self._ensonified = ensonified


class ElementJacobian:
    """Element signals about some values, as a `Linearised`."""
    # value (N,)

    def __init__(self, run: _Run, parameters: ElementParameters, shape: tuple[int, int, int, int]):
        self._run, self._parameters, self._shape = run, parameters, shape
        self._record = run.record()
        self._targets = np.array([target.position for target in run.altered.targets]).reshape(-1, 3)
        self._signals = [run.signals(ping, self._record) for ping in parameters.pings]
        self.value = np.concatenate([_flat(run.kept(signals)) for signals in self._signals])

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        run, parameters = self._run, self._parameters
        survey, moved = run.survey, parameters.checked(tangents, whole=False)
        late, gain = parameters.receivers(moved)
        level, parts = amplitude_from_db(survey.source_level_db), []
        for number, ping in enumerate(parameters.pings):
            motion = parameters.motion(moved, survey, number)
            found = np.zeros((survey.receive.elements, survey.samples), np.complex64)
            for sums, kernel, counts in ((DelayTangents, self._later, motion.delays),
                                         (StrengthTangents, BandLimited(), motion.strengths)):
                if counts:
                    def like(sheets: int, sums: Any = sums, kernel: Any = kernel,
                             motion: Any = motion) -> ImpulseResponses:
                        return sums(mi.Float, motion, kernel=kernel, sheets=sheets, elements=survey.receive.elements,
                                    samples=survey.samples, sampling_rate=survey.sampling_rate,
                                    frequency=survey.frequency)

                    found = found + level * echoes_of_the_pulse(self._levered(ping, like), ping, lambda share: None)
            total = run.kept(found).astype(complex)
            signals = self._signals[number]
            if late.any():
                total += run.later(signals) * late[:, None]
            if gain.any():
                total += run.delayed(signals) * gain[:, None]
            parts.append(_flat(total))
        return np.concatenate(parts)

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        run, parameters = self._run, self._parameters
        cotangent = np.asarray(cotangent, float)
        if cotangent.shape != self.value.shape:
            raise ValueError(f"weights have the shape {cotangent.shape}; give one for each of the "
                             f"{self.value.shape[0]} numbers of the record")
        found = {name: np.zeros(start.shape) for name, start in parameters.start.items()}
        weights = cotangent.reshape(self._shape)
        for number, ping in enumerate(parameters.pings):
            kept, signals = weights[number, ..., 0] + 1j * weights[number, ..., 1], self._signals[number]
            if parameters.receives:
                late = np.real(np.conj(kept) * run.later(signals)).sum(1)
                gain = (np.conj(run.delayed(signals)) * kept).sum(1)
                parameters.add_receivers(late, gain, found)
            if parameters.moves or parameters.strengthens:
                motion = self._motion(number, ping, run.weights(kept))
                parameters.add_gradient(motion, run.survey, number, found)
        return found

    def _motion(self, number: int, ping: int, weights: np.ndarray) -> Motion:
        """Gradient by what moves at a ping, of weights of its signals."""
        survey = self._run.survey
        total = Motion.none(receivers=survey.receive.elements, senders=survey.transmit.elements,
                            targets=len(self._targets))
        record, speed = self._levered(ping, None), survey.sound_speed(ping)
        weights = (amplitude_from_db(survey.source_level_db) * weights).astype(np.complex64)
        wanted: list[tuple[Any, BandLimited]] = [(DelayGradients, self._later)] if self._parameters.moves else []
        wanted += [(StrengthGradients, BandLimited())] if self._parameters.strengthens else []
        most = max(1, SUMS_BYTES // (8 * weights.size))
        for sent in sent_pieces(survey, ping):
            classes = record.classes(sent.factors, (sent.begin, sent.pulse))
            for first in range(0, len(classes.factors), most):
                now = range(first, min(first + most, len(classes.factors)))
                sheets = np.stack([response_weights(weights, survey, sent, float(classes.factors[one]), speed)
                                   for one in now])
                for gradients, kernel in wanted:
                    gathered = GatheredWeights(mi.Float, sheets, kernel=kernel, sampling_rate=survey.sampling_rate,
                                               frequency=survey.frequency)
                    record.add_all(gradients(gathered, total), classes, now, ping)
        return total

    @property
    def _later(self) -> Later:
        survey = self._run.survey
        return Later(frequency=survey.frequency, sampling_rate=survey.sampling_rate)

    def _levered(self, ping: int, like: Any) -> _LeveredRecord:
        record = _given(_LeveredRecord(self._run.survey, seed=self._run.seed, targets=self._targets, like=like),
                        self._run.ensonification)
        record.taken_over(self._record.ensonified(ping))
        return record


def _flat(signals: np.ndarray) -> np.ndarray:
    """Real and imaginary parts of complex numbers one after the other, float64."""
    return np.ascontiguousarray(signals, complex).view(float).ravel()
