"""Signals of an echo sounder's face and of the halves of its quadrants, ping by ping, and the truth of its bins.

    placed     scatterers, targets, ghosts and the water around the sonar, once a ping      `beam_domain.ping_echoes`
    received   by the whole face and by its quadrants; halves are means of two quadrants    `beam_domain.elements`
    truth      energies of the whole face's echoes, spread over bins as the compressed pulse spreads them

The noises of the face and of its quadrants are independent: noise of the whole face and noise in the difference of its
halves are. A half has twice the noise of the whole.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from mitsonar.device.chance import Salt, ping_key, salted
from mitsonar.imaging.echo_sounder import compressed_power
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.units import amplitude_from_db, db_from_power

from ..beam_domain.blur import OneBeam
from ..beam_domain.elements import ElementFrames
from ..beam_domain.frames import LaidPing, truth_of
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.truth import FrameTruth
from ..pressure.array_survey import ArraySurvey

FINER = 4.0                        # scatterers for each one of a fan's resolution cell: a single beam has few cells
WIDEST = 1.05                      # largest sine, as seen by a face that moves
FAINTEST = 1e-5                    # share of the compressed pulse's maximum that is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class PingSignals:
    """Compressed signals of a ping."""

    whole: np.ndarray  # (samples,) [µPa], of the face
    halves: list[np.ndarray]  # (2, samples) [µPa] along (aft, fore) and athwart (port, starboard); empty: single beam
    truth: EnergyRecord  # arrays (1, ..., bins), intensities as means over bins


class FaceSignals:
    """Signals of an echo sounder."""

    def __init__(self, survey: ArraySurvey, quadrants: Array | None, bins: int):
        receive = survey.receive
        across = np.cross(receive.normal[0], receive.along[0])
        cell = survey.wavelength / receive.length
        self._echoes = PingEchoes(survey, LineArray.of_element(receive), per_cell=FINER * survey.per_cell,
                                  lobe=(receive.along[0], cell, 1.0), parts=quadrants,
                                  turning=(survey.track.rotation() @ across, cell))
        self._frames = ElementFrames(survey, None if quadrants is None else split_survey(survey, quadrants))
        self._ahead = [] if quadrants is None else [
            quadrants.position @ axis > 0 for axis in (receive.along[0], across)]
        per_bin = (survey.samples - survey.lead) // bins
        self._truth = FrameTruth(PulseBlur(survey.pulse, survey.sampling_rate, per_bin), lead=survey.lead, bins=bins,
                                 named=survey.world.named, per_bin=per_bin)
        self._amplitude = np.float32(amplitude_from_db(survey.source_level_db))

    def ping(self, ping: int, seed: int) -> PingSignals:
        """Return the signals of a ping, and the truth of its bins."""
        echoes = self._echoes
        scatterers, targets = echoes.of_scatterers(ping), list(echoes.of_targets(ping))
        received = [] if scatterers is None else [scatterers]
        received += [target.echoes for target in targets]
        received += [echoes.received(ping, placed)
                     for placed in chain(echoes.mirrored(ping), echoes.by_chance(ping, seed))]
        signals = self._amplitude * self._frames.signals(ping, received, echoes.doppler_classes(ping),
                                                         salted(ping_key(seed, ping), Salt.BEAM_NOISE))
        whole, quadrants = signals[0], signals[1:]
        truth = truth_of(echoes, ping, LaidPing(scatterers=scatterers, targets=targets), self._truth)
        return PingSignals(whole=whole, truth=truth, halves=[
            np.stack([quadrants[half].mean(0) for half in (~ahead, ahead)]) for ahead in self._ahead])


def split_survey(survey: ArraySurvey, quadrants: Array) -> ArraySurvey:
    """Return the survey of a face's quadrants; with a part of the face, each has as much more noise."""
    noise, more = survey.noise, float(db_from_power(len(quadrants.position)))
    if noise is not None:
        ambient, own = (None if level is None else level + more for level in (noise.ambient_db, noise.self_noise_db))
        noise = replace(noise, position=quadrants.position, ambient_db=ambient, self_noise_db=own)
    return replace(survey, receive=quadrants, noise=noise)


class PulseBlur(OneBeam):
    """Spread of an echo's energy over bins by the whole compressed pulse, which may be longer than many bins."""

    def __init__(self, pulse: Pulse, sampling_rate: float, per_bin: int):
        self.edges = np.array([-WIDEST, WIDEST])
        # an echo may lie anywhere in its bin, and the power is averaged over each bin
        box = np.ones(per_bin) / per_bin
        spread = np.convolve(np.convolve(compressed_power(pulse, sampling_rate), box), box)
        middle = len(spread) // 2
        spread, middle = spread[middle % per_bin::per_bin], middle // per_bin
        aside = middle - int(np.flatnonzero(spread > FAINTEST * spread.max())[0])
        self._spread = spread[middle - aside:middle + aside + 1]

    def shown(self, energy: np.ndarray, first_beam: int) -> np.ndarray:
        """Return the mean powers, float32 (1, t), of energies (1, t)."""
        spread = np.convolve(energy[0], self._spread)[len(self._spread) // 2:]
        return spread[None, :energy.shape[1]].astype(np.float32)
