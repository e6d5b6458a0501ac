"""Measure a time, two angles and a level for every beam of a multibeam ping."""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsonar.hydrography.detection.bottom_track import reduced
from mitsonar.hydrography.detection.detection import Detections, Head, detect
from mitsonar.hydrography.detection.side_lobes import mean_between, of_main_lobes, through_side_lobes
from mitsonar.signal.matched_filtering import compression
from mitsonar.units import power_from_db

from ..limits import check_soundings
from ..soundings.survey import SwathSurvey
from .beams import Halves, SectorBeams, sector_beams

FEWEST_SAMPLES = 16                # of a ping, that the bed can be found in


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamMeasurement:
    """Hold the measurement of a ping; arrays (B,) unless noted, NaN where there is no sounding."""

    valid: np.ndarray
    sent: np.ndarray  # [s]: transmission of the beam's sector by the line's clock, and from then to the reception
    travel_time: np.ndarray  # [s]
    angle: np.ndarray  # [rad]: as the instrument takes them to be
    transmit_angle: np.ndarray  # [rad]: as the instrument takes them to be
    sector: np.ndarray
    method: np.ndarray
    quality: np.ndarray
    deviation: np.ndarray  # [s]: of the time
    angle_deviation: np.ndarray  # [rad]
    intensity: np.ndarray  # [µPa²]: mean of the echo, as received
    begin: np.ndarray  # of its samples
    end: np.ndarray  # of its samples
    incidence: np.ndarray  # [rad]: on the bed across the track, as detection finds it
    halves: list[tuple[Halves, np.ndarray]]  # (T,) [s]: beams and the times of their samples, sector by sector
    pulse_length: list[float]  # [s]: ∫|χ|² dt of the compressed pulses χ with peak 1, sector by sector


class SwathBeams:
    """Form and detect the beams of a swath's pings."""

    def __init__(self, survey: SwathSurvey, seed: int):
        self._survey, self._seed = survey, seed
        check_soundings(survey.sectors[0].survey, survey.beams)
        _check_beams(survey)
        self.sectors = sector_beams(survey)
        self._lengths = [_pulse_length(sector) for sector in self.sectors]

    def measure(self, ping: int) -> BeamMeasurement:
        """Measure a ping."""
        beams = [(sector.halves(ping, self._seed), sector.time) for sector in self.sectors]
        detected = [self._detected(sector, halves, ping, length)
                    for sector, (halves, _), length in zip(self.sectors, beams, self._lengths)]
        detected = self._of_main_lobes(detected, beams, ping)
        rows = [self._said(number, found, ping) for number, found in enumerate(detected)]
        columns = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
        return BeamMeasurement(halves=beams, pulse_length=self._lengths, **columns)

    def _detected(self, sector: SectorBeams, halves: Halves, ping: int, pulse_length: float,
                  without: np.ndarray | None = None) -> Detections:
        """Return the bed in a sector's beams."""
        survey, sines = sector.run.survey, sector.run.sines[ping]
        gate = self._survey.depth_gate
        speed = survey.sound_speed(ping)
        head = Head(pulse_length=pulse_length, beam_width=sector.beam_width(sines), baseline=sector.baseline,
                    transmit_width=sector.transmit_width, gate=None if gate is None else
                    (2 * gate[0] / speed, float(sector.time[-1])))
        found = detect((halves.port, halves.starboard), time=sector.time, sines=sines, head=head, without=without)
        return found if gate is None else _within(found, sines, speed, gate)

    def _of_main_lobes(self, detected: list[Detections], beams: list[tuple[Halves, np.ndarray]],
                       ping: int) -> list[Detections]:
        """Return detections without those that side lobes may have brought.

        A sector sends across the whole swath, and its beams receive by side lobes what another sector's beams look at.
        Beams at the edge of a bed took their slope from the beams beyond it, too: a sector that has such beams is
        detected in again, without them.
        """
        echoes = [reduced((halves.port, halves.starboard), time, length)
                  for (halves, time), length in zip(beams, self._lengths)]
        level = [sector.run.survey.source_level_db for sector in self.sectors]
        checked = []
        for number, (found, sector) in enumerate(zip(detected, self.sectors)):
            sines, time = sector.run.sines[ping], sector.time
            begin, end = time[found.begin], time[np.maximum(found.end - 1, found.begin)]
            brought = np.zeros(len(sines))
            for other, (seen, run) in enumerate(zip(echoes, self.sectors)):
                others = run.run.sines[ping]
                intensity = mean_between(seen, begin, end) * power_from_db(level[number] - level[other])
                brought = np.maximum(brought, through_side_lobes(sector.side_lobes(sines, others), intensity,
                                                                 _share(others, sector.lobe_width)))
            own = np.diagonal(mean_between(echoes[number], begin, end))
            seen = of_main_lobes(own, brought, _share(sines, sector.lobe_width))
            again = found if seen.all() else self._detected(sector, beams[number][0], ping, self._lengths[number],
                                                            ~seen)
            checked.append(replace(again, valid=again.valid & seen))
        return checked

    def _said(self, number: int, found: Detections, ping: int) -> dict[str, np.ndarray]:
        """Return angles as the instrument has them, by the head's own sound speed."""
        run = self._survey.sectors[number]
        beams = len(found.time)
        said = float(run.said[ping])
        angle = np.arcsin(np.clip((run.sines[ping] + found.angle_offset) * said, -1, 1))
        transmit = np.arcsin(np.clip(run.transmit_sines[ping] * said, -1, 1))
        there = found.valid
        return {"valid": there, "sent": np.full(beams, run.survey.track.time[ping]),
                "travel_time": np.where(there, found.time, np.nan), "angle": angle,
                "transmit_angle": np.full(beams, transmit), "sector": np.full(beams, number, np.int32),
                "method": np.where(there, found.method, 0).astype(np.uint8),
                **{name: np.where(there, getattr(found, name), np.nan) for name in
                   ("quality", "deviation", "angle_deviation", "intensity", "incidence")},
                "begin": found.begin, "end": found.end}


def _check_beams(survey: SwathSurvey) -> None:
    """Refuse a line of which a ping could not be detected, before the first is made."""
    first = survey.sectors[0].survey
    samples = first.samples - first.lead
    if samples < FEWEST_SAMPLES:
        raise ValueError(f"a ping has {samples} samples, and detection of the bed needs {FEWEST_SAMPLES}; give the "
                         "film a longer range")
    gate, end = survey.depth_gate, 0.5 * float(first.time[-1]) * first.sound_speed(0)
    if gate is not None and gate[0] >= end:
        raise ValueError(f"depth_gate begins at {gate[0]:g} m, and the record ends at {end:.4g} m; give the film a "
                         "longer range, or look less deep")
    for run in survey.sectors:
        falling = np.argwhere(np.diff(run.sines, axis=1) <= 0)
        if len(falling):
            ping, beam = falling[0]
            raise ValueError(f"at ping {ping} beam {run.first + beam} and the next cannot be told apart: they look the "
                             "same way, or aside or behind the array; narrow swath_deg, take fewer beams, or turn the "
                             "head less (mounting_deg, roll)")


def _share(sines: np.ndarray, width: float) -> np.ndarray:
    """Return steps from beam to beam over the width of a beam, 1 at most (B,)."""
    return np.minimum(np.gradient(sines) / width, 1.0) if len(sines) > 1 else np.ones(1)


def _pulse_length(sector: SectorBeams) -> float:
    """∫|χ|² dt of the compressed pulse [s]."""
    survey = sector.run.survey
    return compression(survey.pulse, survey.sampling_rate)[0]


def _within(found: Detections, sines: np.ndarray, speed: float, gate: tuple[float, float]) -> Detections:
    """Return detections of which those deeper than the gate are none."""
    depth = 0.5 * speed * found.time * np.sqrt(1 - np.minimum(sines ** 2, 1))
    return replace(found, valid=found.valid & (depth >= gate[0]) & (depth <= gate[1]))
