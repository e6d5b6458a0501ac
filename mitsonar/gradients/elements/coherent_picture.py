"""Compute coherent pictures as a function of arrays, platform and point targets, and their Jacobian.

    p = A s(x),    I = |p|²,      A = B M D⁻¹,    Aᴴ = D⁻ᴴ Mᴴ Bᴴ
    dp = A J v,    dI = 2 Re(p* dp)
    Jᵀ Aᴴ w,       w = 2 p I'                         w -> weights of p, real and imaginary parts

s, J -> signals of elements and their Jacobian (`elements`), A -> linear map to the beams: D -> delays of the receivers,
which beamforming undoes; M -> matched filter; B -> delay and sum at every range. Beams are formed with the arrays of
the start. A later change of elements is therefore an error of the beams.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.imaging import fan
from mitsonar.signal.beamforming.transposed import delay_and_sum_transposed
from mitsonar.signal.matched_filtering import matched_filter
from mitsonar.signal.reception import delayed, transposed
from mitsonar.survey.fan import forward_looking, kind as array
from mitsonar.survey.integrator import integrator_of
from mitsonar.survey.pressure.array_survey import ArraySurvey
from mitsonar.survey.sensor import Sensor, sonar_of

from ..model import Linearised, Values
from .elements import ElementModel


class CoherentFan:
    """Form beams of a ping in directions (B, 3), body frame, from element signals; `shape` holds beams and samples.

    The survey's record leads by a pulse; beams are formed with a sound speed [m/s].
    """

    def __init__(self, survey: ArraySurvey, direction: np.ndarray, speed: float):
        self._survey, self._direction = survey, direction
        self.shape = len(direction), survey.samples - survey.lead
        receive = survey.receive
        places = {f"rx_{axis}": ("rx", column) for axis, column in zip("xyz", receive.position.T)}
        self._frame = xr.DataArray(
            np.zeros((1, 1, receive.elements, self.shape[1]), np.complex64), dims=("ping", "tx", "rx", "sample"),
            coords={"time": ("sample", survey.time[survey.lead:]), "rx_weight": ("rx", receive.weight),
                    "rx_delay": ("rx", receive.delay), **places},
            attrs={"frequency": survey.frequency, "sampling_rate": survey.sampling_rate, "sound_speed": speed})

    def beams(self, signals: np.ndarray) -> np.ndarray:
        """Return beams (B, S) [µPa], complex64, for signals (rx, S) [µPa]."""
        frame = self._frame.copy(data=signals[None, None].astype(np.complex64))
        return fan.formed(frame, self._survey.pulse, self._direction)[0]

    def transposed(self, weights: np.ndarray) -> np.ndarray:
        """Return weights of signals (rx, S) for weights of beams (B, S): the conjugate transpose."""
        survey, delay = self._survey, self._survey.receive.delay
        summed = delay_and_sum_transposed(self._frame, self._direction, weights[None])[0, 0]
        found = transposed(lambda signals: matched_filter(signals, survey.pulse, survey.sampling_rate), summed)
        return delayed(found, delay, survey.sampling_rate, survey.frequency) if delay.any() else found


# each takes the survey and the sensor of its kind
KINDS: dict[str, Callable[..., tuple[np.ndarray, np.ndarray]]] = {
    "array": array.directions, "forward_looking": forward_looking.directions}
PARTS = "intensity", "amplitude"


class CoherentPicture:
    """Model the picture of a sonar's beams, with speckle, noise and targets, as a `ForwardModel`."""

    def __init__(self, scene: mi.Scene, keys: Sequence[str], *, pings: Sequence[int] | None = None, sensor: int = 0,
                 seed: int = 0, of: str = "intensity"):
        sonar = sonar_of(scene.sensors()[sensor])
        kind = sonar.kind
        if kind not in KINDS:
            raise ValueError(f"gradients of coherent pictures are of {' and '.join(KINDS)}, and this sensor is a "
                             f"{kind}; give the scene one of them, or take the signals of its elements")
        if of not in PARTS:
            raise ValueError(f"of is {of!r}; give one of {', '.join(PARTS)}")
        self._of, pings = of, _all_pings(scene, sonar) if pings is None else pings
        self._elements = ElementModel(scene, keys, pings=pings, sensor=sensor, seed=seed)
        survey = self._elements.survey
        directions = KINDS[kind](survey, sonar)[1]
        self._fans = [CoherentFan(survey, directions, survey.sound_speed(int(ping))) for ping in pings]
        self.start, self.units, self.left_out = self._elements.start, self._elements.units, self._elements.left_out
        self.shape = (len(pings), *self._fans[0].shape, *((2,) if of == "amplitude" else ()))

    def __repr__(self) -> str:
        keys = ", ".join(f"{key} {value.shape}" for key, value in self.start.items())
        return f"CoherentPicture of {self.shape[0]} pings, {self.shape[1]} beams, {self.shape[2]} samples by {keys}"

    def value(self, values: Values) -> np.ndarray:
        """Return the picture for values; see `ForwardModel.value`."""
        return _shown(_beams(self._fans, self._elements.value(values), self._elements.shape), self._of)

    def linearised(self, values: Values) -> CoherentJacobian:
        """Return the picture about values, with its Jacobian; see `ForwardModel.linearised`."""
        return CoherentJacobian(self._elements.linearised(values), self._elements.shape, self._fans, self._of)


class CoherentJacobian:
    """Hold a coherent picture about some values, as a `Linearised`; `beams` are complex (P, B, S) [µPa].

    There is one fan for each ping; `shape` is that of the elements' record, and `of` as in `CoherentPicture`.
    """

    def __init__(self, elements: Linearised, shape: tuple[int, int, int, int], fans: Sequence[CoherentFan],
                 of: str):
        self._elements, self._shape, self._fans, self._of = elements, shape, fans, of
        self.beams = _beams(fans, elements.value, shape)
        self.value = _shown(self.beams, of)

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        moved = _beams(self._fans, self._elements.forward(tangents), self._shape)
        return _shown(moved, self._of) if self._of == "amplitude" else 2 * np.real(self.beams.conj() * moved).ravel()

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        cotangent = np.asarray(cotangent, float)
        if cotangent.shape != self.value.shape:
            raise ValueError(f"weights have the shape {cotangent.shape}; give one for each of the "
                             f"{self.value.shape[0]} numbers of the picture")
        weights = cotangent.view(complex) if self._of == "amplitude" else 2 * self.beams.ravel() * cotangent
        scale = np.abs(weights).max(initial=0)                         # float32 inside: far from its ends
        if scale == 0:
            return self._elements.backward(np.zeros(int(np.prod(self._shape))))
        weights = (weights / scale).reshape(self.beams.shape)
        signals = np.stack([fan.transposed(one) for fan, one in zip(self._fans, weights, strict=True)]).astype(complex)
        found = self._elements.backward(np.ascontiguousarray(signals).view(float).ravel())
        return {name: scale * gradient for name, gradient in found.items()}


def _all_pings(scene: mi.Scene, sonar: Sensor) -> range:
    return range(integrator_of(scene).survey(scene, sonar).track.pings)


def _beams(fans: Sequence[CoherentFan], signals: np.ndarray, shape: tuple[int, int, int, int]) -> np.ndarray:
    """Return beams (P, B, S), complex128, for a record of signals."""
    pings = np.ascontiguousarray(signals).view(complex).reshape(shape[:3])
    return np.stack([fan.beams(one) for fan, one in zip(fans, pings, strict=True)]).astype(complex)


def _shown(beams: np.ndarray, of: str) -> np.ndarray:
    return beams.view(float).ravel() if of == "amplitude" else (np.abs(beams) ** 2).ravel()
