"""A multibeam echo sounder as the instrument of a line of soundings: beams, detection, strengths, water column.

Bottom backscattering strength of a swath's soundings, with what the instrument knows of its beams.

    corrected    source level, spreading and absorption along the bent path, patterns of both faces, area
    not          losses of volume, noise near the bed beyond the detection's own estimate, side lobes
"""
from __future__ import annotations

from dataclasses import fields

import numpy as np

from mitsonar.hydrography.detection.bottom_backscatter import (
    ensonified_area,
    mean_absorption,
    strength_db,
    transmission_loss_db,
)
from mitsonar.hydrography.detection.snippets import snippets
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.imaging.fan import levels
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.sectors import pattern_integral
from mitsonar.sonar.motion.track import mounting_matrix
from mitsonar.units import db_from_power

from ..soundings.line import Finding
from ..soundings.survey import SwathSurvey
from .beams import SectorBeams
from .measuring import BeamMeasurement, SwathBeams

WORDS = ("mean intensity over the footprint, less noise; corrected for source level, spreading and absorption along "
         "the bent path, patterns of transmitting and receiving faces, and the area that pulse and beams let sound at "
         "once on a bed that slopes across the track as the neighbouring beams find it")
FAINTEST = 1e-3                    # pressure of a face's pattern that is corrected for at most


class Strengths:
    """Make strengths out of intensities."""
    # absorption_db (S,) [dB/m]

    def __init__(self, survey: SwathSurvey, sectors: list[SectorBeams]):
        self._survey, self._sectors = survey, sectors
        top = -float(survey.track.position[:, 2].mean())
        bottom = max(survey.geometry.depth_range[1], top + 1)
        self.absorption_db = np.array([float(mean_absorption(run.survey.absorption, top, bottom))
                                       for run in survey.sectors])

    def of(self, ping: int, made: BeamMeasurement, final: Located, samples: int) -> dict[str, np.ndarray]:
        """Return strengths, and snippets of so many samples, 0 for none, by the record's names."""
        rows = [self._of_a_sector(number, ping, made, final, samples) for number in range(len(self._sectors))]
        return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}

    def _of_a_sector(self, number: int, ping: int, made: BeamMeasurement, final: Located,
                     samples: int) -> dict[str, np.ndarray]:
        sector, run = self._sectors[number], self._survey.sectors[number]
        survey, mine = run.survey, run.beams
        sines = run.sines[ping]
        distance, incidence = final.path_length[mine], made.incidence[mine]
        bed = self._survey.profile.at(final.depth[mine])
        alpha = float(self.absorption_db[number])
        place = Located(**{one.name: getattr(final, one.name)[mine] for one in fields(final)})
        loss = 2 * (transmission_loss_db(place, survey.absorption) - db_from_power(bed / survey.sound_speed(ping)))
        sent, heard = self._patterns(sector, ping, sines, distance)
        widths = {"pulse_length": made.pulse_length[number], "sound_speed": float(np.nanmean(bed)) if np.isfinite(
                      bed).any() else survey.sound_speed(ping),
                  "transmit_width": _width(survey.transmit, survey.wavelength, run.transmit_sines[ping]),
                  "receive_width": _width(survey.receive, survey.wavelength, sines)}
        stretch = (made.end[mine] - made.begin[mine]) / survey.sampling_rate
        area = ensonified_area(distance, incidence, stretch=stretch, **widths)
        patterns = {"transmit_pattern_db": 2 * db_from_power(sent), "receive_pattern_db": 2 * db_from_power(heard)}
        found = strength_db(made.intensity[mine], source_level_db=survey.source_level_db, loss_db=loss, area=area,
                            **patterns)
        along = distance * widths["transmit_width"]
        across = np.minimum(distance * widths["receive_width"] / np.maximum(np.cos(incidence), 0.05), 0.5 * bed
                            * widths["pulse_length"] / np.maximum(np.abs(np.sin(incidence)), 1e-3))
        values = {"backscatter_db": found, "footprint_along": along, "footprint_across": across}
        if samples:
            halves, time = made.halves[number]
            cut = snippets((halves.port, halves.starboard), time=time, detected=made.travel_time[mine],
                           begin=made.begin[mine], end=made.end[mine], samples=samples, incidence=incidence,
                           slant_range=distance, loss_db=loss, source_level_db=survey.source_level_db,
                           absorption_db=alpha, **widths, **patterns)
            values.update(snippet_start=cut.start, snippet_db=cut.strength_db)
        return values

    def _patterns(self, sector: SectorBeams, ping: int, sines: np.ndarray,
                  distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pressures of the faces' patterns towards soundings so far away, 1 on their axes: sent, and heard.

        Beams are known across at the receiving line and along at the transmitting one; near the head either array sees
        a sounding in a direction of its own.
        """
        run, turned = sector.run, mounting_matrix(*self._survey.mounting)
        arrays = run.survey.transmit, run.survey.receive
        between = (arrays[0].position.mean(0) - arrays[1].position.mean(0)) @ turned
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead, aside = (np.nan_to_num(part / distance) for part in between[:2])
        forward, found = float(run.transmit_sines[ping]), []
        for array, along, across in zip(arrays, (forward, forward + ahead), (sines - aside, sines)):
            along, across = np.broadcast_arrays(along, across)
            down = np.sqrt(np.maximum(1 - across ** 2 - along ** 2, 0))
            towards = np.stack([along, across, down], -1) @ turned.T
            pressure = array.element_pressure(towards, run.survey.wavelength, array.normal[0], array.along[0])
            found.append(np.maximum(np.abs(pressure), FAINTEST))
        return found[0], found[1]


def _width(array: Array, wavelength: float, sine: np.ndarray | float) -> np.ndarray:
    """∫ of a line's power pattern over the angle, where it is steered to a sine [rad]."""
    return pattern_integral(array, wavelength) / np.sqrt(np.maximum(1 - np.square(sine), 1e-3))


class MultibeamInstrument:
    """Measure the pings of a multibeam; see `soundings.Instrument`."""

    sonar, backscatter = "multibeam", WORDS

    def __init__(self, survey: SwathSurvey, seed: int, *, column: bool = False, snippets: int = 0):
        self._survey, self._column, self._snippets = survey, column, snippets
        self._beams = SwathBeams(survey, seed)
        self._strengths = Strengths(survey, self._beams.sectors)
        self.installation, self.absorption_db = _installation(survey), self._strengths.absorption_db

    def measure(self, ping: int) -> BeamMeasurement:
        """Measure a ping."""
        return self._beams.measure(ping)

    def measured(self, ping: int, made: BeamMeasurement, head_speed: float,
                 closing: np.ndarray | None = None) -> Measured:
        """Return times and angles; beams have been steered with the head's own sound speed, whatever that is."""
        said = self._survey.sectors[0].survey.sound_speed(ping) + self._survey.head_speed_error
        angle = made.angle
        if closing is not None:
            angle = np.arcsin(np.clip(np.sin(angle) * (1 + closing / said), -1, 1))
        beams = len(made.sent)
        return Measured(ping_time=np.full(beams, self._survey.track.time[ping]), transmit_time=made.sent,
                        travel_time=made.travel_time, angle=angle, transmit_angle=made.transmit_angle,
                        head_sound_speed=np.full(beams, said))

    def finding(self, ping: int, made: BeamMeasurement, final: Located) -> Finding:
        """Return detection, strengths and, where they are kept, snippets and water column."""
        values: dict[str, np.ndarray | float] = {"detection": made.method, "quality": made.quality,
                                                 **self._strengths.of(ping, made, final, self._snippets)}
        if self._snippets:
            values["snippet_rate"] = self._survey.sectors[0].survey.sampling_rate
        if self._column:
            values.update(self._of_the_column(ping, made))
        return Finding(variables=values)

    def _of_the_column(self, ping: int, made: BeamMeasurement) -> dict[str, np.ndarray]:
        """Return levels of all beams."""
        runs = self._survey.sectors
        angle = np.concatenate([np.arcsin(np.clip(run.sines[ping] * run.said[ping], -1, 1)) for run in runs])
        beams = [run.sines.shape[1] for run in runs]
        level = np.concatenate([levels(halves.whole) for halves, _ in made.halves])
        time = made.halves[0][1]
        # echoes change over the length of a pulse: two samples of it are kept
        rate = runs[0].survey.sampling_rate
        step = max(1, int(rate * min(made.pulse_length) / 2))
        return {"column_angle": angle, "column_sector": np.repeat(np.arange(len(runs)), beams),
                "column_start": np.full(len(angle), time[0]),
                "column_rate": np.full(len(angle), rate / step), "column_level_db": level[:, ::step]}


def _installation(survey: SwathSurvey) -> Installation:
    """Return the positions of the arrays on the platform."""
    offset = survey.voyage.trajectory.offset
    first = survey.sectors[0].survey
    return Installation(
        transmit_offset=offset + first.transmit.position.mean(0),
        receive_offset=offset + first.receive.position.mean(0),
        transmit_mounting=survey.mounting, receive_mounting=survey.mounting)
