"""Frames of an array's image in the beam domain: beams, and their truth from the same echoes.

    echoes     scatterers thinned to the resolution, targets, ghosts, water             `ping_echoes`
    grid       sums of the echoes over sine and time                                    `signal.beam_grid`
    beams      pulse, matched filter, line, noise                                       `signal.beam_grid`
    truth      energy of every instance, and what is hidden                             `truth`
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import mitsuba as mi
import numpy as np

from mitsonar.device.chance import ping_key
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.signal.beam_grid import BeamGrid, LineBeams, NoiseDensity
from mitsonar.signal.reception import delayed
from mitsonar.units import amplitude_from_db, power_from_db

from ..pressure.array_survey import ArraySurvey
from .blur import Blur
from .line import LineArray, refusal
from .ping_echoes import GridEchoes, PingEchoes, TargetEchoes
from .truth import FrameTruth

REFERRED = 0.01                    # [wavelengths] distance of the array's centre from the origin that is ignored


@dataclass(frozen=True, kw_only=True, eq=False)
class LaidPing:
    """Echoes of a ping that its truth is made from."""

    scatterers: GridEchoes | None
    targets: list[TargetEchoes]


def line_beams(survey: ArraySurvey, place: np.ndarray, weight: np.ndarray, sines: np.ndarray,
               scale: np.ndarray | None = None) -> LineBeams:
    """Return the beamformer of a survey's line; arguments as of `LineBeams`."""
    return LineBeams(
        mi.Float, position=place, weight=weight, sines=sines, pulse=survey.pulse, samples=survey.samples,
        sampling_rate=survey.sampling_rate, lead=survey.lead, start=survey.start, sound_speed=survey.planned_speed,
        absorption_db=survey.waters.only.mean_absorption_db, scale=scale)


def lay(echoes: PingEchoes, grid: BeamGrid, ping: int, seed: int) -> LaidPing:
    """Add a ping's echoes to a grid: scatterers, targets, ghosts and the water."""
    scatterers = echoes.of_scatterers(ping)
    if scatterers is not None:
        add(grid, scatterers)
    targets = list(echoes.of_targets(ping))
    for target in targets:
        add(grid, target.echoes)
    for placed in chain(echoes.mirrored(ping), echoes.by_chance(ping, seed)):
        add(grid, echoes.received(ping, placed))
    return LaidPing(scatterers=scatterers, targets=targets)


def add(grid: BeamGrid, echoes: GridEchoes) -> None:
    """Add echoes to a grid."""
    grid.add(column=echoes.column, sine=echoes.sine, real=echoes.real, imaginary=echoes.imaginary)


class LineFrames:
    """Beams of a survey's line, ping by ping; weight, sines and scale as of `LineBeams`."""

    def __init__(self, survey: ArraySurvey, echoes: PingEchoes, weight: np.ndarray, sines: np.ndarray,
                 scale: np.ndarray | None = None):
        self.survey, self.echoes, self.line = survey, echoes, echoes.line
        self._weight, self._scale, self._ends = weight, scale, (sines.min(), sines.max())
        self._beams = line_beams(survey, echoes.line.place, weight, sines, scale)
        rows = (tuple(part.tolist()) for part in (self.line.row_place / survey.wavelength, self.line.row_weight))
        self._noise = NoiseDensity.of(survey.noise, survey.source_level_db, *rows)

    def formed(self, ping: int, seed: int, sines: np.ndarray | None = None) -> tuple[np.ndarray, LaidPing]:
        """Form the beams (apertures, B, samples) of a ping at other sines (B,) if given.

        Without a scale they are those of a source level of 0 dB.
        """
        line = self._beams if sines is None else self._beams_of(sines)
        grid = line.grid()
        laid = lay(self.echoes, grid, ping, seed)
        beams = line.form_each(grid, doppler=self.echoes.doppler(ping), noise=self._noise,
                                      key=ping_key(seed, ping), sines=sines)
        return beams, laid

    def _beams_of(self, sines: np.ndarray) -> LineBeams:
        """Return the beamformer for sines (B,): the planned one or, where a step looks farther, that of all sines."""
        return self._beams if self._ends[0] <= sines.min() and sines.max() <= self._ends[1] else self._wide

    @cached_property
    def _wide(self) -> LineBeams:
        """Return the beamformer for all sines."""
        return line_beams(self.survey, self.line.place, self._weight, np.array([-1.0, 1.0]), self._scale)

    def truth(self, ping: int, laid: LaidPing, truth: FrameTruth) -> EnergyRecord:
        """Return the truth of a ping, arrays (B, ..., bins)."""
        return truth_of(self.echoes, ping, laid, truth)


def truth_of(echoes: PingEchoes, ping: int, laid: LaidPing, truth: FrameTruth) -> EnergyRecord:
    """Return the truth of a ping from its echoes, arrays (B, ..., bins)."""
    survey = echoes.survey
    return truth.of(
        laid.scatterers, echoes.hiding(ping, laid.scatterers), laid.targets,
        in_lobe=echoes.in_main_lobe(ping, laid.scatterers),
        origin=survey.track.position[ping], depth_below=float(survey.depth_below[ping]),
        farthest=0.5 * survey.time[-1] * survey.sound_speed(ping),
        source_power=float(power_from_db(survey.source_level_db)))


def why_not(survey: ArraySurvey, direction: np.ndarray) -> str:
    """Return the reason why an image of beams (B, 3) cannot be made in the beam domain; empty if it can."""
    reason = refusal(survey.receive, direction, survey.wavelength)
    if reason:
        return f"the receive array is neither a line nor parallel lines: {reason}"
    transmit = survey.transmit
    if len(transmit.faces()) > 1 and not (transmit.pattern == "omni" and transmit.baffle == "none"):
        return "the transmit elements look in different directions"
    if survey.ensonification != "scatterers":
        return "rays find the scatterers (ensonification)"
    if len(survey.sources.position) > 1 or np.any(survey.sources.position):
        return "rays start at other places than the array's centre (fans)"
    return ""


class Frames(LineFrames):
    """Frames of a survey with beams along directions (B, 3)."""

    def __init__(self, survey: ArraySurvey, direction: np.ndarray, *, per_cell: float):
        reason = why_not(survey, direction)
        if reason:
            raise ValueError(f"The image cannot be made in the beam domain: {reason}. Leave out picture, or set it to "
                             "elements.")
        line = LineArray.of(survey.receive, direction, survey.wavelength)
        sines = direction @ line.axis
        super().__init__(survey, PingEchoes(survey, line, per_cell=per_cell), line.received, sines)
        # beams are relative to the sum of the magnitudes of their weights, and beamformers know those without errors
        self._gain = np.abs(line.received).sum() / np.abs(line.weight).sum()
        self._direction, self.beams = direction, len(direction)
        self._truth = FrameTruth(
            Blur(sines[np.argsort(sines, kind="stable")], line.place / survey.wavelength, line.weight,
                 survey.pulse.bandwidth / survey.sampling_rate),
            lead=survey.lead, bins=survey.samples - survey.lead, named=survey.world.named)

    def frame(self, ping: int, seed: int) -> tuple[np.ndarray, EnergyRecord]:
        """Return the beams (B, samples) [µPa] of a ping, and their truth."""
        formed, laid = self.formed(ping, seed)
        beams = self._referred(formed[0]) * np.float32(self._gain * amplitude_from_db(self.survey.source_level_db))
        return beams, self.truth(ping, laid, self._truth)

    def _referred(self, beams: np.ndarray) -> np.ndarray:
        """Refer the beams of an array off the body's origin O to O, as beamformers of element signals do.

        Each sample moves by δ = (|P| - |P - r|) / c, with P = R û the beam's point and r the array's centre.
        """
        survey, centre = self.survey, self.line.centre
        if np.linalg.norm(centre) < REFERRED * survey.wavelength:
            return beams
        speed = survey.planned_speed
        far = self._direction @ centre / speed
        R = np.maximum(0.5 * speed * survey.time[survey.lead:], np.linalg.norm(centre))
        point = R[:, None] * self._direction[:, None]                                        # (B, S, 3)
        near = (R - np.linalg.norm(point - centre, axis=-1)) / speed - far[:, None]
        turn = np.exp(-2j * np.pi * survey.frequency * near).astype(np.complex64)
        return delayed(beams, far, survey.sampling_rate, survey.frequency) * turn
