"""Compute signals of elements as a function of arrays, platform and point targets, and their Jacobian.

    y     the signals of `mitsonar.element_signals`, to the byte, real and imaginary parts one after the other
    J v, Jᵀ w    exact in delays and phases of all echoes, over the fast sums: `levers`

The signals of a ping are an operation of Dr.Jit, attached to the motion at this ping, and the motion to parameters.
Losses of signals, beams or pictures therefore propagate to elements, point targets and the track.

Scatterers, rays and noise are those of the start for all values. The Jacobian leaves out changes of spreading,
absorption, element patterns and scattering strength, about 1/(k R) of it, and the edges of shadows. Points of the
water and bounces that are drawn by chance move with the sonar in y, and stand still in J.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.device.turns import one_at_a_time
from mitsonar.echoes.ensonification import Ensonification
from mitsonar.echoes.point_targets import PointTargets
from mitsonar.scene.errors import as_exception
from mitsonar.signal.accumulation import ImpulseResponses
from mitsonar.signal.gathering import GatheredWeights
from mitsonar.signal.impulses import BandLimited, Later
from mitsonar.signal.reception import absorbed, delayed, received, transposed
from mitsonar.survey.energy.phased_echoes import band_of
from mitsonar.survey.integrator import integrator_of
from mitsonar.survey.pressure.array_survey import ArraySurvey
from mitsonar.survey.pressure.ensonified_ping import ensonification_of
from mitsonar.survey.pressure.ping_source import PingSource
from mitsonar.survey.pressure.pressure import SUMS_BYTES, PingPressure, PressureRecord
from mitsonar.survey.pressure.signals import LEAD, SentPiece, echoes_of_the_pulse, sent_pieces
from mitsonar.survey.sensor import sonar_of
from mitsonar.survey.survey import PerSurroundings
from mitsonar.units import amplitude_from_db

from ..model import Values
from .levers import DELAYS, STRENGTHS, Gradients, LeveredDelays, LeverTargetEnds, Motion, Quantity, Tangents
from .parameters import MOVING, OF_PINGS, RECEIVING, STRENGTHENING, Altered, ElementParameters

LEFT_OUT = ("spreading, absorption, patterns and scattering strengths as they change with place", "edges of shadows",
            "points of the water and bounces drawn by chance")


class ElementModel:
    """Signals of a sonar's elements as a `ForwardModel`.

    Parameters
    ----------
    scene : mitsuba.Scene
        Scene from `mitsonar.load_file`.
    keys : sequence of str
        Names of parameters, as in `element_parameters`.
    pings : sequence of int
        Numbers of the pings, counted from 0.
    sensor : int
        Number of the sensor.
    seed : int
        Seed of noise, and of rays where rays ensonify the scatterers.

    Attributes
    ----------
    start, units : dict
        Start values and units of the parameters.
    shape : (int, int, int, 2)
        Shape of y: pings, receive elements, samples, real and imaginary part.
    left_out : tuple of str
        Effects that the Jacobian leaves out.

    Raises
    ------
    ValueError
        If the sensor has no arrays, or a parameter or ping does not exist.
    """

    left_out = LEFT_OUT

    @property
    def survey(self) -> ArraySurvey:
        """Survey with the start values."""
        return self._survey

    def __init__(self, scene: mi.Scene, keys: Sequence[str], *, pings: Sequence[int] = (0,), sensor: int = 0,
                 seed: int = 0):
        sonar, integrator = sonar_of(scene.sensors()[sensor]), integrator_of(scene)
        try:
            self._survey = integrator.array_survey(scene, sonar, LEAD, seed)
        except RuntimeError as error:
            raise as_exception(error) from error
        self._survey.world.still.refuse_bodies("gradients need")
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
        self._survey.refuse_field("gradients")
        self._ensonifications = PerSurroundings(self._survey, ensonification_of)
        self.shape = len(pings), self._survey.receive.elements, self._survey.samples - self._survey.lead, 2

    def __repr__(self) -> str:
        keys = ", ".join(f"{key} {value.shape}" for key, value in self.start.items())
        return f"ElementModel of {self.shape[0]} pings, {self.shape[1]} receivers, {self.shape[2]} samples by {keys}"

    @one_at_a_time
    def value(self, values: Values) -> np.ndarray:
        """Return the signals for values; see `ForwardModel.value`."""
        run = self._run(values)
        record = run.record()
        return np.concatenate([_flat(run.kept(run.signals(record.at(ping)))) for ping in self._pings])

    @one_at_a_time
    def linearised(self, values: Values) -> ElementJacobian:
        """Return the signals about values, with their Jacobian; see `ForwardModel.linearised`."""
        return ElementJacobian(self._run(values), self._parameters, self.shape)

    def _run(self, values: Values) -> _Run:
        altered = self._parameters.altered(self._parameters.checked(values))

        def ensonification(ping: int) -> Ensonification:
            around = self._ensonifications.at(ping)
            return around.with_targets(PointTargets(altered.targets, band_of(altered.survey.pulse),
                                                    around.water.profile))

        return _Run(altered=altered, ensonification=lru_cache(maxsize=1)(ensonification), seed=self._seed)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Run:
    """Compute the signals of pings with some values."""

    altered: Altered
    ensonification: Callable[[int], Ensonification]  # around a ping
    seed: int

    @property
    def survey(self) -> ArraySurvey:
        return self.altered.survey

    def record(self) -> PressureRecord:
        """Return the record that sums the echoes."""
        return PressureRecord(self.survey, seed=self.seed, ensonification=self.ensonification)

    def signals(self, now: PingPressure) -> np.ndarray:
        """Return the signals (rx, samples) of a ping before the delays and gains of the receivers."""
        survey = self.survey
        signals = amplitude_from_db(survey.source_level_db) * echoes_of_the_pulse(now)
        if survey.noise is not None:
            signals = signals + survey.noise.drawn(survey.samples, self.seed, now.ensonified.ping)
        return signals

    def kept(self, signals: np.ndarray) -> np.ndarray:
        """Return the received signals with delays and gains, cut to the requested samples: complex64."""
        signals = self._late(signals) if self.survey.receive.delay.any() else signals
        gain = self._gain
        return self._cut(signals if np.all(gain == 1) else signals * gain[:, None])

    def by_channel(self, signals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of `kept` by the delays [1/s] and by the gains of the receivers."""
        return (self._cut(self._late(signals, rate=True) * self._gain[:, None]),
                self._cut(self._late(signals) * self.survey.receive.channel[:, None]))

    @property
    def _gain(self) -> np.ndarray:
        """Return the factors of the receivers' signals (rx,): gains times channels."""
        return self.altered.gain * self.survey.receive.channel

    def response_weights(self, weights: np.ndarray, ping: int, sent: SentPiece, factor: float) -> np.ndarray:
        """Return weights of a class's responses for weights (rx, samples) of signals."""
        survey, pulse = self.survey, sent.pulse
        found = transposed(lambda response: received(response, pulse, survey.sampling_rate, factor), weights)
        absorption_db = survey.waters.at(ping).mean_absorption_db
        if absorption_db is not None:
            found = absorbed(found, survey.sampling_rate, survey.frequency, absorption_db,
                             survey.sound_speed(ping), survey.start - sent.begin, transposed=True)
        return found

    def weights(self, kept: np.ndarray) -> np.ndarray:
        """Return weights of signals for weights (rx, kept samples) of `kept`: its transpose."""
        survey = self.survey
        wide = np.zeros((len(kept), survey.samples), np.complex64)
        wide[:, survey.lead:] = kept * np.conj(self._gain)[:, None]
        wide[~survey.receive.working] = 0
        return transposed(self._late, wide) if survey.receive.delay.any() else wide

    def _late(self, signals: np.ndarray, rate: bool = False) -> np.ndarray:
        survey = self.survey
        return delayed(signals, survey.receive.delay, survey.sampling_rate, survey.frequency, rate=rate)

    def _cut(self, signals: np.ndarray) -> np.ndarray:
        signals = np.array(signals[:, self.survey.lead:])
        signals[~self.survey.receive.working] = 0
        return signals.astype(np.complex64)


class _LeveredRecord(PressureRecord):
    """Sum echoes with their levers bound; `like` makes the sums for a number of sheets."""

    def __init__(self, run: _Run, *, targets: np.ndarray, like: Callable[[int], ImpulseResponses] | None):
        super().__init__(run.survey, seed=run.seed, ensonification=run.ensonification)
        self._targets, self._like = LeverTargetEnds(targets), like

    def delays(self, source: PingSource, ping: int) -> LeveredDelays:
        survey = self.survey.within(ping)
        return LeveredDelays(source=source, transmit=survey.transmit, receive=survey.receive,
                             wavelength=survey.wavelength, sampling=survey.sampling, counts=self.counts,
                             targets=self._targets)

    def sums(self, sheets: int = 1) -> ImpulseResponses:
        return super().sums(sheets) if self._like is None else self._like(sheets)


class ElementJacobian:
    """Hold element signals about some values, as a `Linearised`."""
    # value (N,)

    def __init__(self, run: _Run, parameters: ElementParameters, shape: tuple[int, int, int, int]):
        self._run, self._parameters, self._shape = run, parameters, shape
        self._targets = np.array([target.position for target in run.altered.targets]).reshape(-1, 3)
        # with its echoes, which all pings of a platform at rest share
        self._first = run.record().at(parameters.pings[0])
        self._signals = [run.signals(self._at(number)) for number in range(len(parameters.pings))]
        self.value = np.concatenate([_flat(run.kept(signals)) for signals in self._signals])

    @one_at_a_time
    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        moved = self._parameters.checked(tangents, whole=False)
        with dr.resume_grad():
            leaves = {key: mi.Float64(tangent.ravel()) for key, tangent in moved.items()}
            return np.concatenate([self._forward(number, self._motion(leaves, number))
                                   for number in range(len(self._parameters.pings))])

    @one_at_a_time
    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        cotangent = np.asarray(cotangent, float)
        if cotangent.shape != self.value.shape:
            raise ValueError(f"weights have the shape {cotangent.shape}; give one for each of the "
                             f"{self.value.shape[0]} numbers of the record")
        start = self._parameters.start
        with dr.resume_grad():
            leaves = {key: dr.zeros(mi.Float64, value.size) for key, value in start.items()}
            dr.enable_grad(leaves)
            dr.backward(dr.dot(dr.concat(self.attached(leaves)), mi.Float64(cotangent)))
            return {key: dr.grad(leaf).numpy().reshape(start[key].shape) for key, leaf in leaves.items()}

    def attached(self, leaves: Mapping[str, mi.Float64]) -> list[mi.Float64]:
        """Return the flat signals of every ping, attached to parameters (flat Float64 by name)."""
        return [dr.custom(_SignalOperation, self, number, self._motion(leaves,
                                                                      number)) for number in range(self._shape[0])]

    def _motion(self, leaves: Mapping[str, mi.Float64], number: int) -> Motion:
        motion = self._parameters.motion(leaves, self._run.survey, number)
        dr.eval(motion)
        return motion

    # ---- one ping

    def _at(self, number: int) -> PingPressure:
        """Return a ping of the record; the echoes of the first one are kept."""
        return self._first.record.at(self._parameters.pings[number], self._first) if number else self._first

    def _value(self, number: int) -> mi.Float64:
        return mi.Float64(self.value.reshape(self._shape[0], -1)[number])

    def _forward(self, number: int, motion: Motion) -> np.ndarray:
        """Return J v of a ping for its motion, flat."""
        run, survey = self._run, self._run.survey
        found = np.zeros((survey.receive.elements, survey.samples), np.complex64)
        level = amplitude_from_db(survey.source_level_db)
        for quantity, kernel, names in self._quantities:
            if any(np.any(part.numpy()) for name in names for part in [motion[name]]):
                def like(sheets: int, quantity: Quantity = quantity, kernel: Any = kernel) -> ImpulseResponses:
                    return Tangents(mi.Float, quantity, motion, kernel=kernel, sheets=sheets, samples=survey.samples,
                                    elements=survey.receive.elements, sampling_rate=survey.sampling_rate,
                                    frequency=survey.frequency)

                found = found + level * echoes_of_the_pulse(self._levered(number, like))
        total = run.kept(found).astype(complex)
        if self._parameters.has(RECEIVING):
            by_delay, by_gain = run.by_channel(self._signals[number])
            real, imaginary = motion["rx_gain"].numpy()
            total += by_delay * motion["rx_delay"].numpy()[:, None] + by_gain * (real + 1j * imaginary)[:, None]
        return _flat(total)

    def _backward(self, number: int, weights: np.ndarray) -> Motion:
        """Return Jᵀ w of a ping, by its motion, for weights (rx, samples) of its signals."""
        ping, survey, parameters = self._parameters.pings[number], self._run.survey, self._parameters
        motion = self._motion({}, number)
        dr.enable_grad(motion)
        levered, wide = self._levered(number), self._run.weights(weights)
        wide = (amplitude_from_db(survey.source_level_db) * wide).astype(np.complex64)
        wanted = [(quantity, kernel) for (quantity, kernel, _), names in zip(self._quantities, (MOVING, STRENGTHENING))
                  if parameters.has(names)]
        most = max(1, SUMS_BYTES // (8 * wide.size))
        for sent in sent_pieces(survey, ping) if wanted else []:
            classes = levered.record.classes(sent.factors, (sent.begin, sent.pulse))
            for first in range(0, len(classes.factors), most):
                now = range(first, min(first + most, len(classes.factors)))
                sheets = np.stack([self._run.response_weights(wide, ping, sent, float(classes.factors[one]))
                                   for one in now])
                for quantity, kernel in wanted:
                    gathered = GatheredWeights(mi.Float, sheets, kernel=kernel, sampling_rate=survey.sampling_rate,
                                               frequency=survey.frequency)
                    levered.add_all(cast(Any, Gradients(gathered, quantity, motion)), classes, now)
        found = dr.grad(motion)
        if parameters.has(RECEIVING):
            by_delay, by_gain = (np.conj(part) * weights for part in self._run.by_channel(self._signals[number]))
            found["rx_delay"] = mi.Float64(np.real(by_delay).sum(1))
            gain = by_gain.sum(1)
            found["rx_gain"] = type(motion["rx_gain"])(np.stack([gain.real, gain.imag]))
        return found

    @property
    def _quantities(self) -> list[tuple[Quantity, BandLimited, tuple[str, ...]]]:
        survey = self._run.survey
        later = Later(frequency=survey.frequency, sampling_rate=survey.sampling_rate)
        return [(DELAYS, later, ("place", "rx", "tx", "tx_delay", "target")),
                (STRENGTHS, BandLimited(), ("tx_strength", "target_strength"))]

    def _levered(self, number: int, like: Callable[[int], ImpulseResponses] | None = None) -> PingPressure:
        """Return a ping whose echoes have levers; `like` makes its sums for a number of sheets, if it has any."""
        record = _LeveredRecord(self._run, targets=self._targets, like=like)
        return PingPressure(record=record, ensonified=self._at(number).ensonified)


class _SignalOperation(dr.CustomOp):
    """Attach the signals of a ping to its motion."""

    def eval(self, jacobian: ElementJacobian, number: int, motion: Motion) -> mi.Float64:
        self._jacobian, self._number = jacobian, number
        return jacobian._value(number)

    def forward(self) -> None:
        self.set_grad_out(mi.Float64(self._jacobian._forward(self._number, cast(Motion, self.grad_in("motion")))))

    def backward(self) -> None:
        weights = cast(Any, self.grad_out()).numpy().view(complex).reshape(self._jacobian._shape[1:3])
        self.set_grad_in("motion", self._jacobian._backward(self._number, weights))

    def name(self) -> str:
        return "element signals"


def attached_signals(model: ElementModel, parameters: mi.SceneParameters, pings: Sequence[int]) -> mi.TensorXf:
    """Return a model's signals [µPa], (ping, receiver, sample, real or imaginary), attached to parameters of its scene.

    The keys of the model are among the parameters, at their present values, and its pings are `pings`.
    """
    leaves = {}
    for key in model.start:
        leaf = mi.Float64(dr.ravel(parameters[key]))
        if key.rpartition(".")[2] in OF_PINGS:
            leaf = dr.ravel(dr.gather(arrays_of(mi.Float).Array3f64, leaf, mi.UInt32(list(pings))))
        leaves[key] = leaf
    return mi.TensorXf(mi.Float(dr.concat(model.linearised({}).attached(leaves))), shape=model.shape)


def _flat(signals: np.ndarray) -> np.ndarray:
    """Return complex numbers as flat float64, real and imaginary parts one after the other."""
    return np.ascontiguousarray(signals, complex).view(float).ravel()
