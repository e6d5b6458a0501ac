"""Detection of the bed in a multibeam's pings: a time, two angles and a level for every beam."""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsonar.device.turns import workers_ended
from mitsonar.hydrography.detection.bottom_track import BottomEchoes, reduced
from mitsonar.hydrography.detection.detection import Detections, Head, detect
from mitsonar.hydrography.detection.side_lobes import mean_between, of_main_lobes, through_side_lobes
from mitsonar.signal.matched_filtering import compression
from mitsonar.units import power_from_db

from ..limits import check_soundings
from ..soundings.instrument import PingMeasurement
from ..soundings.survey import SwathSurvey
from ..survey import PerSurroundings
from .beams import Halves, sector_beams

FEWEST_SAMPLES = 16                # samples of a ping in which the bed can be detected


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamMeasurement(PingMeasurement):
    """Measurement of a ping, arrays (B,), NaN where there is no sounding; lists go sector by sector."""

    sent: np.ndarray  # [s], transmission of the beam's sector, by the line's clock
    angle: np.ndarray  # [rad], by the instrument's own sound speed
    transmit_angle: np.ndarray  # [rad], likewise
    method: np.ndarray
    quality: np.ndarray
    deviation: np.ndarray  # [s], of the travel time
    angle_deviation: np.ndarray  # [rad]
    begin: np.ndarray  # samples begin <= n < end of the footprint
    end: np.ndarray
    incidence: np.ndarray  # [rad], on the bed across the track, as detection finds it
    halves: list[tuple[Halves, np.ndarray]]  # beams, and the times (T,) [s] of their samples
    pulse_length: list[float]  # [s], ∫|χ|² dt of the compressed pulses χ with peak 1


class SwathBeams:
    """Beams of a swath's pings, and the bed detected in them."""

    def __init__(self, survey: SwathSurvey, seed: int):
        self._survey, self._seed = survey, seed
        check_soundings(survey.sectors[0].survey, survey.beams)
        _check_beams(survey)
        self._sectors = PerSurroundings(survey, sector_beams)
        self._lengths = [compression(run.survey.pulse, run.survey.sampling_rate)[0] for run in survey.sectors]

    def measure(self, ping: int) -> BeamMeasurement:
        """Measure a ping."""
        return self._measured(ping, [(sector.halves(ping, self._seed), sector.time)
                                     for sector in self._sectors.at(ping)])

    @workers_ended()
    def _measured(self, ping: int, beams: list[tuple[Halves, np.ndarray]]) -> BeamMeasurement:
        """Detect the bed in a ping's beams, of all sectors, at the times of their samples."""
        sums = [reduced((halves.port, halves.starboard), time, length)
                for (halves, time), length in zip(beams, self._lengths)]
        detected = [self._detected(number, halves, ping, sums[number]) for number, (halves, _) in enumerate(beams)]
        detected = self._of_main_lobes(detected, beams, sums, ping)
        rows = [self._columns(number, detections, ping) for number, detections in enumerate(detected)]
        columns = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
        return BeamMeasurement(halves=beams, pulse_length=self._lengths, **columns)

    def _detected(self, number: int, halves: Halves, ping: int, sums: BottomEchoes,
                  without: np.ndarray | None = None) -> Detections:
        """Detect the bed in a sector's beams, except `without` (B,), within the depth gate."""
        sector, gate = self._sectors.at(ping)[number], self._survey.depth_gate
        sines, speed = sector.run.sines[ping], sector.survey.sound_speed(ping)
        head = Head(pulse_length=self._lengths[number], beam_width=sector.beam_width(sines), baseline=sector.baseline,
                    transmit_width=sector.transmit_width, gate=None if gate is None else
                    (2 * gate[0] / speed, float(sector.time[-1])))
        found = detect((halves.port, halves.starboard), time=sector.time, sines=sines, head=head, without=without,
                       sums=sums)
        if gate is None:
            return found
        depth = 0.5 * speed * found.time * np.sqrt(1 - np.minimum(sines ** 2, 1))
        return replace(found, valid=found.valid & (depth >= gate[0]) & (depth <= gate[1]))

    def _of_main_lobes(self, detected: list[Detections], beams: list[tuple[Halves, np.ndarray]],
                       sums: list[BottomEchoes], ping: int) -> list[Detections]:
        """Return the detections without those that may be echoes received by side lobes.

        A sector transmits across the whole swath, and its beams receive through side lobes the echoes from where
        another sector's beams look. Detection also takes slopes at the edge of a bed from the beams beyond the edge: a
        sector with such beams is detected once more, without them.
        """
        sectors = self._sectors.at(ping)
        level = [sector.survey.source_level_db for sector in sectors]
        checked = []
        for number, (found, sector) in enumerate(zip(detected, sectors)):
            sines, time = sector.run.sines[ping], sector.time
            begin, end = time[found.begin], time[np.maximum(found.end - 1, found.begin)]
            brought = np.zeros(len(sines))
            between = [mean_between(echoes, begin, end) for echoes in sums]
            for other, source in enumerate(sectors):
                others = source.run.sines[ping]
                intensity = between[other] * power_from_db(level[number] - level[other])
                brought = np.maximum(brought, through_side_lobes(sector.side_lobes(sines, others), intensity,
                                                                 _share(others, sector.lobe_width)))
            own = np.diagonal(between[number])
            main = of_main_lobes(own, brought, _share(sines, sector.lobe_width))
            again = found if main.all() else self._detected(number, beams[number][0], ping, sums[number],
                                                                         ~main)
            checked.append(replace(again, valid=again.valid & main))
        return checked

    def _columns(self, number: int, found: Detections, ping: int) -> dict[str, np.ndarray]:
        """Return the columns of `BeamMeasurement` for a sector, with angles by the instrument's own sound speed."""
        run = self._survey.sectors[number]
        beams, valid, said = len(found.time), found.valid, float(run.said[ping])
        angle = np.arcsin(np.clip((run.sines[ping] + found.angle_offset) * said, -1, 1))
        transmit = np.arcsin(np.clip(run.transmit_sines[ping] * said, -1, 1))
        return {"valid": valid, "sent": np.full(beams, run.survey.track.time[ping]),
                "travel_time": np.where(valid, found.time, np.nan), "angle": angle,
                "transmit_angle": np.full(beams, transmit), "sector": np.full(beams, number, np.int32),
                "method": np.where(valid, found.method, 0).astype(np.uint8),
                **{name: np.where(valid, getattr(found, name), np.nan) for name in
                   ("quality", "deviation", "angle_deviation", "intensity", "incidence")},
                "begin": found.begin, "end": found.end}


def _check_beams(survey: SwathSurvey) -> None:
    """Raise `ValueError` if pings of a line could not be detected, before the first is made."""
    first = survey.sectors[0].survey
    samples = first.samples - first.lead
    if samples < FEWEST_SAMPLES:
        raise ValueError(f"a ping has {samples} samples, and detection of the bed needs {FEWEST_SAMPLES}; give the "
                         "film a longer range")
    gate, end = survey.depth_gate, 0.5 * float(first.time[-1]) * first.planned_speed
    if gate is not None and gate[0] >= end:
        raise ValueError(f"depth_gate begins at {gate[0]:g} m, and the record ends at {end:.4g} m; give the film a "
                         "longer range, or a depth_gate that begins less deep")
    for run in survey.sectors:
        falling = np.argwhere(np.diff(run.sines, axis=1) <= 0)
        if len(falling):
            ping, beam = falling[0]
            raise ValueError(f"at ping {ping} beam {run.first + beam} and the next cannot be told apart: they look the "
                             "same way, or aside or behind the array; narrow swath_deg, take fewer beams, or turn the "
                             "head less (mounting_deg, roll)")


def _share(sines: np.ndarray, width: float) -> np.ndarray:
    """Return the steps from beam to beam over the width of a beam, 1 at most (B,)."""
    return np.minimum(np.gradient(sines) / width, 1.0) if len(sines) > 1 else np.ones(1)
