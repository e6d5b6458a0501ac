"""Signals of an echo sounder's face and of the halves of its quadrants, ping by ping, and the truth of its bins.

    placed     scatterers, targets, ghosts and the water around the sonar, once a ping      `beam_domain.ping_echoes`
    received   by the whole face, and by lines of two halves along and athwart the face     `PingEchoes.received`
    truth      energies of the whole face's echoes, spread over bins as the compressed pulse spreads them

The face is a line of one element; the quadrants are two lines of two elements. Their noises are independent: noise of
the whole face and noise in the difference of its halves are. A half has twice the noise of the whole.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import drjit as dr
import numpy as np

from mitsonar.device.chance import ping_key, sonar_seed
from mitsonar.imaging.echo_sounder import compressed_power
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.signal.beam_grid import BeamGrid
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.units import amplitude_from_db, db_from_power

from ..beam_domain.blur import OneBeam
from ..beam_domain.frames import LaidPing, LineFrames, add
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import GridEchoes, PingEchoes, TargetEchoes
from ..beam_domain.placed_echoes import PlacedEchoes
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
        beam = {"per_cell": FINER * survey.per_cell, "lobe": (receive.along[0], cell, 1.0),
                "turning": (survey.track.rotation() @ across, cell)}
        whole = PingEchoes(survey, LineArray.of_element(receive), **beam)
        self._whole, self._halves = _Receiver(survey, whole, np.ones((1, 1))), []
        if quadrants is not None:
            split = split_survey(survey, quadrants)
            self._halves = [_Receiver(split, PingEchoes(
                split, LineArray.along(quadrants, axis, survey.wavelength), beside=whole, **beam), np.eye(2))
                for axis in (receive.along[0], across)]
        per_bin = (survey.samples - survey.lead) // bins
        self._truth = FrameTruth(PulseBlur(survey.pulse, survey.sampling_rate, per_bin), lead=survey.lead, bins=bins,
                                 named=survey.world.named, per_bin=per_bin)
        self._amplitude = np.float32(amplitude_from_db(survey.source_level_db))

    def ping(self, ping: int, seed: int) -> PingSignals:
        """Return the signals of a ping, and the truth of its bins."""
        receivers = [self._whole, *self._halves]
        grids = [receiver.grid() for receiver in receivers]
        echoes, laid = self._whole.echoes, LaidPing(scatterers=None, targets=[])

        def received(placed: PlacedEchoes) -> GridEchoes:
            if self._halves:
                dr.eval(vars(placed))
            on_grids = [receiver.echoes.received(ping, placed) for receiver in receivers]
            for grid, some in zip(grids, on_grids):
                add(grid, some)
            return on_grids[0]

        scatterers = echoes.scatterers(ping)
        if scatterers is not None:
            laid = replace(laid, scatterers=received(scatterers))
        for label, placed in echoes.targets(ping):
            some = received(placed)
            laid.targets.append(TargetEchoes(echoes=some, label=np.broadcast_to(label.numpy(), dr.width(some.sine))))
        for placed in chain(echoes.mirrored(ping), echoes.by_chance(ping, seed)):
            received(placed)
        seeds = [seed, *(sonar_seed(seed, name) for name in ("along", "athwart"))]
        whole, *halves = (receiver.signals(grid, ping, own) * self._amplitude
                          for receiver, grid, own in zip(receivers, grids, seeds))
        return PingSignals(whole=whole[0], halves=halves, truth=self._whole.truth(ping, laid, self._truth))


def split_survey(survey: ArraySurvey, quadrants: Array) -> ArraySurvey:
    """Return the survey of a face's quadrants; with a part of the face, each has as much more noise."""
    noise, more = survey.noise, float(db_from_power(len(quadrants.position)))
    if noise is not None:
        ambient, own = (None if level is None else level + more for level in (noise.ambient_db, noise.self_noise_db))
        noise = replace(noise, position=quadrants.position, ambient_db=ambient, self_noise_db=own)
    return replace(survey, receive=quadrants, noise=noise)


class _Receiver(LineFrames):
    """Line of receivers that look straight ahead."""

    def __init__(self, survey: ArraySurvey, echoes: PingEchoes, weight: np.ndarray):
        super().__init__(survey, echoes, weight, np.zeros(1))

    def grid(self) -> BeamGrid:
        """Return an empty grid."""
        return self._beams.grid()

    def signals(self, grid: BeamGrid, ping: int, seed: int) -> np.ndarray:
        """Return the signals (apertures, samples) of a ping's echoes on a grid, for a source level of 0 dB."""
        return self._beams.form_each(grid, doppler=self.echoes.doppler(ping), noise=self._noise,
                                     key=ping_key(seed, ping))[:, 0]


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
