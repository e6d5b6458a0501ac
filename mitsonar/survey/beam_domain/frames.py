"""Frames of an array's picture in the beam domain: beams and their truth from the same echoes.

    echoes     scatterers thinned to the resolution, targets, ghosts, water              `ping_echoes`
    grid       their sums over sine and time                                             `signal.beam_grid`
    beams      pulse, matched filter, line, noise                                        `signal.beam_grid`
    truth      whose energy, and what is hidden                                          `truth`

All echoes of a ping on a grid of sine and time, the beams of a survey's line, and the truth of a ping.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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


@dataclass(frozen=True, kw_only=True, eq=False)
class LaidPing:
    """Hold the echoes that the truth of a ping is made from."""

    scatterers: GridEchoes | None  # none where there are none
    targets: list[TargetEchoes]

    def truth(self, echoes: PingEchoes, ping: int, truth: FrameTruth) -> EnergyRecord:
        """Return the truth of the ping whose echoes these are, arrays (B, ..., bins)."""
        survey = echoes.survey
        return truth.of(
            self.scatterers, echoes.hiding(ping, self.scatterers), self.targets, origin=survey.track.position[ping],
            depth_below=float(survey.depth_below[ping]), farthest=0.5 * survey.time[-1] * survey.sound_speed(ping),
            source_power=float(power_from_db(survey.source_level_db)))


def line_beams(survey: ArraySurvey, place: np.ndarray, weight: np.ndarray, sines: np.ndarray) -> LineBeams:
    """Return what forms the beams of a survey's line; arguments as of `LineBeams`."""
    return LineBeams(
        mi.Float, position=place, weight=weight, sines=sines, pulse=survey.pulse, samples=survey.samples,
        sampling_rate=survey.sampling_rate, lead=survey.lead, start=survey.start, sound_speed=survey.sound_speed(0),
        absorption_db=survey.absorption_db)


def lay(echoes: PingEchoes, grid: BeamGrid, ping: int, seed: int) -> LaidPing:
    """Add a ping's echoes to a grid: scatterers, targets, ghosts, the water."""
    scatterers = echoes.of_scatterers(ping)
    if scatterers is not None:
        add(grid, scatterers)
    targets = list(echoes.of_targets(ping))
    for target in targets:
        add(grid, target.echoes)
    for some in chain(echoes.mirrored(ping), echoes.by_chance(ping, seed)):
        add(grid, echoes.received(ping, some))
    return LaidPing(scatterers=scatterers, targets=targets)


def add(grid: BeamGrid, echoes: GridEchoes) -> None:
    """Add echoes to a grid."""
    grid.add(column=echoes.column, sine=echoes.sine, real=echoes.real, imaginary=echoes.imaginary)


REFERRED = 0.01                    # wavelengths that an array's centre may lie off the origin, and still be there


def why_not(survey: ArraySurvey, direction: np.ndarray) -> str:
    """Say why a picture of beams (B, 3) cannot be made in the beam domain; empty where it can."""
    why = refusal(survey.receive, direction, survey.wavelength)
    if why:
        return f"the receive array is no line, nor rows of lines: {why}"
    transmit = survey.transmit
    if len(transmit.faces()) > 1 and not (transmit.pattern == "omni" and transmit.baffle == "none"):
        return "the transmit elements look different ways"
    if survey.ensonification != "scatterers":
        return "rays are to find the scatterers (ensonification)"
    if len(survey.sources.position) > 1 or np.any(survey.sources.position):
        return "rays are to start at other places than the array's centre (fans)"
    return ""


class Frames:
    """Make the frames of a survey."""
    # direction (B, 3)

    def __init__(self, survey: ArraySurvey, direction: np.ndarray, *, per_cell: float):
        why = why_not(survey, direction)
        if why:
            raise ValueError(f"the picture cannot be made in the beam domain: {why}; leave out picture, or let it be "
                             "elements")
        self.survey = survey
        self.line = line = LineArray.of(survey.receive, direction, survey.wavelength)
        self.echoes = PingEchoes(survey, line, per_cell=per_cell)
        sines = direction @ line.axis
        self._order = np.argsort(sines, kind="stable")
        self._direction = direction
        self._beams = line_beams(survey, line.place, line.weight, sines)
        self._noise = NoiseDensity.of(survey.noise, survey.source_level_db)
        self._truth = FrameTruth(
            Blur(sines[self._order], line.place / survey.wavelength, line.weight,
                 survey.pulse.bandwidth / survey.sampling_rate),
            lead=survey.lead, bins=survey.samples - survey.lead, named=survey.geometry.named)

    @property
    def beams(self) -> int:
        """Return the number of beams."""
        return len(self._direction)

    def frame(self, ping: int, seed: int,
              progress: Callable[[float], None] | None = None) -> tuple[np.ndarray, EnergyRecord]:
        """Make one frame."""
        # -> beams (B, samples) [µPa]
        survey, grid = self.survey, self._beams.grid()
        laid = lay(self.echoes, grid, ping, seed)
        beams = self._beams.form(grid, doppler=self.echoes.doppler(ping), noise=self._noise, key=ping_key(seed, ping))
        beams = self._referred(beams) * np.float32(amplitude_from_db(survey.source_level_db))
        return beams, laid.truth(self.echoes, ping, self._truth)

    def _referred(self, beams: np.ndarray) -> np.ndarray:
        """Refer the beams of an array off the body's origin O to O: every beam by as much as its own points are nearer.

        δ = (|P| - |P - r|) / c, P = R û the beam's point and r the array's centre, as beamformers of elements do.
        """
        survey, centre = self.survey, self.line.centre
        if np.linalg.norm(centre) < REFERRED * survey.wavelength:
            return beams
        speed = survey.sound_speed(0)
        far = self._direction @ centre / speed
        R = np.maximum(0.5 * speed * survey.time[survey.lead:], np.linalg.norm(centre))
        point = R[:, None] * self._direction[:, None]                                        # (B, S, 3)
        near = (R - np.linalg.norm(point - centre, axis=-1)) / speed - far[:, None]
        turn = np.exp(-2j * np.pi * survey.frequency * near).astype(np.complex64)
        return delayed(beams, far, survey.sampling_rate, survey.frequency) * turn
