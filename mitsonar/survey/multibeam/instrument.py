"""Multibeam echo sounder as the instrument of a line of soundings: beams, detection, strengths, water column.

Strengths are bottom backscattering strengths, made with what the instrument knows of its beams:

    corrected        source level, spreading and absorption along the bent path, patterns of both faces, area
    not corrected    losses in the volume, noise near the bed beyond the detection's own estimate, side lobes
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import xarray as xr

from mitsonar.device.rotations import mounting_matrix
from mitsonar.hydrography.detection.bottom_backscatter import ensonified_area, mean_absorption, strength_db
from mitsonar.hydrography.detection.snippets import snippets
from mitsonar.hydrography.detection.written_strength import StrengthWriting, angle_correction_db
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.imaging.fan import levels
from mitsonar.imaging.recording import PingRecorder, recorded_levels
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.sectors import pattern_integral
from mitsonar.units import db_from_power

from ..soundings.instrument import absorption_to_bed, face_pattern_db, two_way_loss_db
from ..soundings.line import Finding
from ..soundings.survey import SectorRun, SwathSurvey
from ..survey import PerSurroundings
from .beams import Halves
from .measuring import BeamMeasurement, SwathBeams

WORDS = ("mean intensity over the footprint, less noise; corrected for source level, spreading and absorption along "
         "the bent path, patterns of transmitting and receiving faces, and the area that pulse and beams let sound at "
         "once on a bed that slopes across the track as the neighbouring beams find it")


class MultibeamInstrument:
    """Instrument that measures the pings of a multibeam; see `soundings.line.Instrument`."""

    sonar, backscatter = "multibeam", WORDS

    def __init__(self, survey: SwathSurvey, seed: int, *, column: bool = False, snippets: int = 0):
        self._survey, self._column, self._snippets = survey, column, snippets
        self._seed = seed
        self.measure = SwathBeams(survey, seed).measure
        self._absorption = PerSurroundings(survey, lambda part: np.array(
            [absorption_to_bed(part, run.survey.waters.only.absorption) for run in part.sectors]))
        offset, first = survey.voyage.trajectory.offset, survey.sectors[0].survey
        self.installation = Installation(
            transmit_offset=offset + first.transmit.position.mean(0),
            receive_offset=offset + first.receive.position.mean(0),
            transmit_mounting=survey.mounting, receive_mounting=survey.mounting)

    def absorption_db(self, ping: int) -> np.ndarray:
        """Return the absorption (S,) [dB/m] of a ping's sectors, mean from the sonar down to the lowest bed."""
        return self._absorption.at(ping)

    def measured(self, ping: int, made: BeamMeasurement, head_speed: float,
                 closing: np.ndarray | None = None) -> Measured:
        """Return times and angles; the head's own sound speed has steered the beams, whatever `head_speed` is."""
        said = self._survey.sectors[0].survey.sound_speed(ping) + self._survey.head_speed_error
        angle = made.angle
        if closing is not None:
            angle = np.arcsin(np.clip(np.sin(angle) * (1 + closing / said), -1, 1))
        beams = len(made.sent)
        return Measured(ping_time=np.full(beams, self._survey.track.time[ping]), transmit_time=made.sent,
                        travel_time=made.travel_time, angle=angle, transmit_angle=made.transmit_angle,
                        head_sound_speed=np.full(beams, said))

    def finding(self, ping: int, made: BeamMeasurement, final: Located) -> Finding:
        """Return detection, strengths and, if they are kept, snippets and water column."""
        rows = [self._strengths(number, ping, made, final) for number in range(len(self._survey.sectors))]
        values: dict[str, np.ndarray | float] = {
            "detection": made.method, "quality": made.quality,
            **{name: np.concatenate([row[name] for row in rows]) for name in rows[0]}}
        if self._survey.strength_writing is not None:
            values.update(_written(self._survey.strength_writing, ping, values, final))
            del values["window_error_db"]
        if self._snippets:
            values["snippet_rate"] = self._survey.sectors[0].survey.sampling_rate
        if self._column:
            values.update(self._water_column(ping, made))
        return Finding(variables=values)

    def _strengths(self, number: int, ping: int, made: BeamMeasurement, final: Located) -> dict[str, np.ndarray]:
        """Return strengths, footprints and snippets of a sector's soundings, by the record's names."""
        run = self._survey.sectors[number]
        survey, mine, sines = run.survey.within(ping), run.beams, run.sines[ping]
        water = survey.waters.only
        distance, incidence = final.path_length[mine], made.incidence[mine]
        bed = water.profile.at(final.depth[mine])
        place = Located(**{field.name: getattr(final, field.name)[mine] for field in fields(final)})
        loss = two_way_loss_db(place, water.absorption, bed, survey.sound_speed(ping))
        widths = {"pulse_length": made.pulse_length[number], "sound_speed": float(np.nanmean(bed)) if np.isfinite(
                      bed).any() else survey.sound_speed(ping),
                  "transmit_width": _width(survey.transmit, survey.wavelength, run.transmit_sines[ping]),
                  "receive_width": _width(survey.receive, survey.wavelength, sines)}
        stretch = (made.end[mine] - made.begin[mine]) / survey.sampling_rate
        area = ensonified_area(distance, incidence, stretch=stretch, **widths)
        patterns = self._patterns(run, ping, distance)
        across = np.minimum(distance * widths["receive_width"] / np.maximum(np.cos(incidence), 0.05), 0.5 * bed
                            * widths["pulse_length"] / np.maximum(np.abs(np.sin(incidence)), 1e-3))
        known = {"source_level_db": survey.source_level_db, "loss_db": loss, **patterns}
        values = {"backscatter_db": strength_db(made.intensity[mine], area=area, **known),
                  "footprint_along": distance * widths["transmit_width"], "footprint_across": across}
        if (writing := self._survey.strength_writing) is not None:
            sloping, level = (ensonified_area(distance, tilted, **widths)
                              for tilted in (incidence, np.pi / 2 - place.grazing))
            speckle = np.zeros(len(distance))
            if (window := writing.window) is not None:
                short = ensonified_area(distance, incidence, stretch=window, **widths)
                speckle = strength_db(_about(*made.halves[number], made.travel_time[mine], window), area=short,
                                      **known) - values["backscatter_db"]
            values["window_error_db"] = speckle
            values["written_error_db"] = writing.errors_db(
                ping, number, angle=made.angle[mine], distance=distance, area_error_db=db_from_power(sloping / level),
                absorption_db=mean_absorption(water.absorption, place.source_depth, place.depth),
                window_error_db=speckle)
        if self._snippets:
            halves, time = made.halves[number]
            cut = snippets((halves.port, halves.starboard), time=time, detected=made.travel_time[mine],
                           begin=made.begin[mine], end=made.end[mine], samples=self._snippets, incidence=incidence,
                           slant_range=distance, loss_db=loss, source_level_db=survey.source_level_db,
                           absorption_db=float(self.absorption_db(ping)[number]), **widths, **patterns)
            values.update(snippet_start=cut.start, snippet_db=cut.strength_db)
        return values

    def _patterns(self, run: SectorRun, ping: int, distance: np.ndarray) -> dict[str, np.ndarray]:
        """Return the patterns [dB] of both faces towards a sector's soundings at distances (B,) [m].

        The angle across is known at the receiving line, the angle along at the transmitting line; near the head each
        array sees a sounding in a direction of its own.
        """
        survey, sines, turned = run.survey.within(ping), run.sines[ping], mounting_matrix(*self._survey.mounting)
        between = (survey.transmit.position.mean(0) - survey.receive.position.mean(0)) @ turned
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead, aside = (np.nan_to_num(part / distance) for part in between[:2])
        forward, patterns = float(run.transmit_sines[ping]), {}
        for name, along, across in (("transmit", forward, sines - aside), ("receive", forward + ahead, sines)):
            along, across = np.broadcast_arrays(along, across)
            down = np.sqrt(np.maximum(1 - across ** 2 - along ** 2, 0))
            towards = np.stack([along, across, down], -1) @ turned.T
            patterns[f"{name}_pattern_db"] = face_pattern_db(getattr(survey, name), towards, survey.wavelength)
        return patterns

    def _water_column(self, ping: int, made: BeamMeasurement) -> dict[str, np.ndarray]:
        """Return the levels of all beams."""
        survey, runs = self._survey, self._survey.sectors
        angle = np.concatenate([np.arcsin(np.clip(run.sines[ping] * run.said[ping], -1, 1)) for run in runs])
        level = np.concatenate([levels(halves.whole) for halves, _ in made.halves])
        # echoes change over the length of a pulse: two samples of that length are kept
        rate = runs[0].survey.sampling_rate
        step = max(1, int(rate * min(made.pulse_length) / 2))
        level = level[:, ::step]
        columns = {} if survey.column_recorder is None else {"column_recorded_db": self._recorded(
            ping, level, made.halves[0][1][::step])}
        return {**columns, "column_angle": angle,
                "column_sector": np.repeat(np.arange(len(runs)), [run.sines.shape[1] for run in runs]),
                "column_start": np.full(len(angle), made.halves[0][1][0]),
                "column_rate": np.full(len(angle), rate / step), "column_level_db": level}


    def _recorded(self, ping: int, level: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return the levels (B, T) of the recorder's counts of a ping, without its gain; `time` (T,) [s]."""
        survey, recorder = self._survey, self._survey.column_recorder
        assert recorder is not None
        picture = xr.Dataset({"level": (("ping", "beam", "range"), level[None].astype(np.float32))}, coords={
            "ping": [ping], "ping_time": ("ping", survey.track.time[[ping]]), "time": ("range", time),
            "range": 0.5 * survey.sectors[0].survey.planned_speed * time})
        absorption = float(self.absorption_db(ping)[0])
        return recorded_levels(PingRecorder(recorder, self._seed, absorption_db=absorption).added(picture)).values[0]


def _about(halves: Halves, time: np.ndarray, detected: np.ndarray, window: float) -> np.ndarray:
    """Return the mean intensities (B,) [µPa²] of beams in a window [s] about detections (B,) [s]; NaN without one."""
    power, step = np.abs(halves.whole.astype(complex)) ** 2, time[1] - time[0]
    whole = np.concatenate([np.zeros((len(power), 1)), np.cumsum(power, axis=1)], axis=1)
    middle = np.where(np.isfinite(detected), (detected - time[0]) / step, 0)
    begin = np.clip(np.rint(middle - 0.5 * (window / step - 1)).astype(int), 0, len(time) - 1)
    end = np.clip(begin + max(round(window / step), 1), 1, len(time))
    rows = np.arange(len(power))
    return np.where(np.isfinite(detected), (whole[rows, end] - whole[rows, begin]) / (end - begin), np.nan)


def _written(writing: StrengthWriting, ping: int, values: Mapping[str, np.ndarray | float],
             final: Located) -> dict[str, np.ndarray | float]:
    """Return the strengths of a ping as the instrument writes them, and what it assumes."""
    incidence, error = np.pi / 2 - final.grazing, np.asarray(values["written_error_db"])
    strength = np.asarray(values["backscatter_db"]) + error
    normal, oblique = writing.response(strength, incidence)
    laws = {law: angle_correction_db(incidence, law, normal_db=normal, oblique_db=oblique, crossover=writing.crossover)
            for law in (writing.beam_law, writing.image_law)}
    written: dict[str, np.ndarray | float] = {
        "written_backscatter_db": strength + laws[writing.beam_law], "normal_incidence_db": normal,
        "oblique_incidence_db": oblique, "crossover_angle": writing.crossover, "written_gain_db": writing.gain_db(ping)}
    if "snippet_db" in values:
        written["written_snippet_db"] = np.asarray(values["snippet_db"]) + (
            error - np.asarray(values["window_error_db"]) + laws[writing.image_law])[:, None]
    return written


def _width(array: Array, wavelength: float, sine: np.ndarray | float) -> np.ndarray:
    """Return the integral of a line's power pattern over the angle [rad], steered to a sine."""
    return pattern_integral(array, wavelength) / np.sqrt(np.maximum(1 - np.square(sine), 1e-3))
