"""Interferometric sidescan as the instrument of a line of soundings: a sounding for every bin, both sides in one swath.

Signals of a side's rows come from the beam domain: each row is a line of one element, whose only beam is not steered.
Waves are plane over the rows, and the pulse arrives at them one after the other. The truth of the bins is made from the
same echoes.

The instrument reads a phase with its own sound speed c_h, as a sine that is c_h / c of the true one. It refers what a
face receives to the sonar's centre (`hydrography.faces_aside`). The error of a sounding's depth h follows from the
deviations of angle and time: σ_h² = (y σ_θ)² + (c σ_t cos θ / 2)², y its distance across the track; its quality is
log10 h / σ_h.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.device.chance import sonar_seed
from mitsonar.echoes.scatterers.thinned_scatterers import ACROSS
from mitsonar.hydrography.detection.bottom_backscatter import strength_db
from mitsonar.hydrography.detection.faces_aside import AsideFace
from mitsonar.hydrography.detection.quality import gravity_deviation
from mitsonar.hydrography.record import BY_PHASE, NOT_DETECTED
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.hydrography.reduction.uncertainty import Deviations
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.units import amplitude_from_db

from ..beam_domain.blur import OneBeam
from ..beam_domain.frames import LaidPing, LineFrames
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.truth import FrameTruth
from ..soundings.instrument import PingMeasurement, absorption_to_bed, face_pattern_db, two_way_loss_db
from ..soundings.line import Finding
from ..survey import PerSurroundings
from .plan import SIDES, InterferometricSurvey, up_along

WIDEST = 1.05                      # largest sine: rows that move receive echoes from beyond 1
NODES = 2001                       # samples of the beam along the track
HIGHEST = np.deg2rad(1.0)          # least depression of a sounding, in the body frame


@dataclass(frozen=True, kw_only=True, eq=False)
class RowMeasurement(PingMeasurement):
    """Measurement of a ping, arrays (B,): port's bins from the last to the first, then starboard's from the first.

    A sounding is valid if it is coherent enough and within the sector; `sector` is 0 to port, 1 to starboard;
    `travel_time` is that of the bin's middle; `intensity` is the mean of the rows over the window.
    """

    sine: np.ndarray  # along the rows' axis, by the true sound speed at the head
    sine_deviation: np.ndarray
    coherence: np.ndarray
    phase: np.ndarray  # [rad]
    level: np.ndarray  # [µPa²], mean over the bin of the sum of the rows' powers

    def by_side(self, values: np.ndarray) -> np.ndarray:
        """Return values (B,) as (side, bin), both from the first bin on."""
        half = len(values) // 2
        return np.stack([values[:half][::-1], values[half:]])


def measured_rows(survey: InterferometricSurvey, signals: tuple[np.ndarray, np.ndarray]) -> RowMeasurement:
    """Return the measurement of both sides from their signals (rows, samples) [µPa]."""
    per_bin, looks = survey.per_bin, max(1.0, survey.window / (survey.sides[0].sampling_rate * survey.pulse_length))
    sides, levels = [], []
    for rows in signals:
        sides.append(survey.rows.angles(rows, per_bin=per_bin, window=survey.window, looks=looks,
                                        relative_bandwidth=survey.relative_bandwidth))
        levels.append((np.abs(rows) ** 2).sum(0, dtype=float).reshape(survey.bins, per_bin).mean(1))

    def joined(port: np.ndarray, starboard: np.ndarray) -> np.ndarray:
        return np.concatenate([port[::-1], starboard])

    def both(name: str) -> np.ndarray:
        return joined(*(getattr(side, name) for side in sides))

    coherence = both("coherence")
    return RowMeasurement(
        valid=both("inside") & (coherence >= survey.least_coherence), travel_time=joined(survey.time, survey.time),
        sector=np.repeat(np.arange(2, dtype=np.int32), survey.bins), sine=both("sine"), coherence=coherence,
        sine_deviation=both("deviation"), phase=both("phase"), intensity=both("power"), level=joined(*levels))


def both_sides(survey: InterferometricSurvey) -> tuple[SideRows, SideRows]:
    """Return the rows of both sides; they share their tables of the scene."""
    port = SideRows(survey, 0)
    return port, SideRows(survey, 1, beside=port)


class SideRows(LineFrames):
    """Signals of one side's rows, ping by ping."""

    def __init__(self, survey: InterferometricSurvey, number: int, beside: SideRows | None = None):
        self._number, side, per_bin = number, survey.sides[number], survey.per_bin
        cell = side.wavelength / max(side.transmit.length, side.receive.length)
        line = LineArray.along(side.receive, up_along(side.receive), side.wavelength)
        super().__init__(side, PingEchoes(side, line, per_cell=side.per_cell, beams_from_origin=False,
                                          beside=None if beside is None else beside.echoes,
                                          lobe=(side.receive.along[0], cell, ACROSS * cell / _beam_width(survey))),
                         np.eye(len(line.place)), np.zeros(1))
        self._truth = FrameTruth(OneBeam(WIDEST, side.pulse.bandwidth * per_bin / side.sampling_rate),
                                 lead=side.lead, bins=survey.bins, named=side.world.named, per_bin=per_bin)

    def signals(self, ping: int, seed: int) -> np.ndarray:
        """Return the compressed signals (rows, samples) [µPa] of a ping, complex64."""
        return self._signals(ping, seed)[0]

    def frame(self, ping: int, seed: int) -> tuple[np.ndarray, EnergyRecord]:
        """Return the signals of a ping, and the truth of the bins, arrays (1, ..., bins)."""
        signals, laid = self._signals(ping, seed)
        return signals, self.truth(ping, laid, self._truth)

    def _signals(self, ping: int, seed: int) -> tuple[np.ndarray, LaidPing]:
        beams, laid = self.formed(ping, sonar_seed(seed, SIDES[self._number]) if self._number else seed)
        return beams[:, 0] * np.float32(amplitude_from_db(self.survey.source_level_db)), laid


WORDS = ("mean intensity over the window, noise included; corrected for source level, spreading and absorption along "
         "the bent path, patterns of transmitting face and rows, and the area that pulse and beam let sound at once on "
         "a level bed")


class Interferometer:
    """Instrument that measures the pings of an interferometric sidescan; see `soundings.line.Instrument`."""

    sonar, backscatter = "interferometric", WORDS

    def __init__(self, survey: InterferometricSurvey, seed: int):
        self._survey, self._seed = survey, seed
        self._sides = PerSurroundings(survey, both_sides)
        offset = survey.voyage.trajectory.offset
        self.installation = Installation(transmit_offset=offset, receive_offset=offset)
        self._faces = [AsideFace(transmit_centre=side.transmit.position.mean(0),
                                 receive_centre=side.receive.position.mean(0), axis=up_along(side.receive),
                                 normal=side.receive.normal[0]) for side in survey.sides]
        self._absorption = PerSurroundings(survey, lambda part: np.full(
            2, absorption_to_bed(part, part.waters.only.absorption)))

    def sides(self, ping: int) -> tuple[SideRows, SideRows]:
        """Return the rows of both sides at a ping."""
        return self._sides.at(ping)

    def absorption_db(self, ping: int) -> np.ndarray:
        """Return the absorption (2,) [dB/m] of a ping's sides, mean from the sonar down to the lowest bed."""
        return self._absorption.at(ping)

    def measure(self, ping: int) -> RowMeasurement:
        """Measure a ping."""
        port, starboard = (side.signals(ping, self._seed) for side in self.sides(ping))
        return measured_rows(self._survey, (port, starboard))

    def measured(self, ping: int, made: RowMeasurement, head_speed: float,
                 closing: np.ndarray | None = None) -> Measured:
        """Return times and angles that follow from the phases with a sound speed at the head [m/s]."""
        survey, travel_time = self._survey, made.travel_time
        beams, there = len(travel_time), survey.sides[0].sound_speed(ping)
        sine = made.sine * (head_speed / there)
        if closing is not None:
            sine = sine * (1 + np.nan_to_num(closing) / there)
        half, gate = beams // 2, survey.depth_gate
        seen = [face.seen(sine[side], travel_time[side], head_speed)
                for face, side in zip(self._faces, (slice(0, half), slice(half, None)))]
        depression = np.concatenate([face.depression for face in seen])
        use = made.valid & (depression > HIGHEST) & (depression < np.pi - HIGHEST)
        if gate is not None:
            below = 0.5 * head_speed * travel_time * np.sin(depression)
            use &= (below >= gate[0]) & (below <= gate[1])

        def column(name: str) -> np.ndarray:
            return np.where(use, np.concatenate([getattr(face, name) for face in seen]), np.nan)

        time = survey.track.time[ping]
        return Measured(ping_time=np.full(beams, time), transmit_time=np.full(beams, time),
                        travel_time=column("travel_time"), angle=column("angle"),
                        transmit_angle=column("transmit_angle"), head_sound_speed=np.full(beams, head_speed))

    def finding(self, ping: int, made: RowMeasurement, final: Located) -> Finding:
        """Return quality, footprints and strengths."""
        survey = self._survey.within(ping)
        speed, width = survey.sides[0].sound_speed(ping), _beam_width(survey)
        sigma_angle, sigma_time = self._deviations(made)
        head = final.source_depth
        height = np.abs(final.depth - head)
        with np.errstate(invalid="ignore", divide="ignore"):
            spread = np.hypot(final.across_track * sigma_angle,
                              0.5 * speed * sigma_time * height / np.maximum(final.path_length, 1e-6))
            quality = np.log10(height / spread)
            across = np.minimum(0.5 * speed * survey.window / survey.sides[0].sampling_rate
                                / np.maximum(np.cos(final.grazing), 1e-3), final.path_length)
        there = made.valid & final.found
        values: dict[str, np.ndarray | float] = {
            "detection": np.where(there, BY_PHASE, NOT_DETECTED), "quality": np.where(there, quality, np.nan),
            "footprint_across": across, "footprint_along": final.path_length * width,
            "backscatter_db": np.where(there, self._strength(survey, made, final, width), np.nan)}
        return Finding(variables=values, deviations=Deviations(time=sigma_time[None], angle=sigma_angle[None]))

    def _deviations(self, made: RowMeasurement) -> tuple[np.ndarray, np.ndarray]:
        """Return the standard deviations of angle [rad] and time [s], (B,) each."""
        survey = self._survey
        angle = made.sine_deviation / np.sqrt(np.maximum(1 - made.sine ** 2, 0.01))
        window = survey.window / survey.sides[0].sampling_rate / np.sqrt(12)
        return angle, np.full(len(angle), float(gravity_deviation(np.array(window), survey.pulse_length)))

    def _strength(self, survey: InterferometricSurvey, made: RowMeasurement, final: Located,
                  width: float) -> np.ndarray:
        """Return the strengths of the bed [dB] by the sonar equation, as the instrument knows its beams."""
        water, (side, starboard) = survey.waters.only, survey.sides
        bed = water.profile.at(np.nan_to_num(final.depth))
        loss = two_way_loss_db(final, water.absorption, bed, side.planned_speed)
        # the sine along a face's axis gives the place in its pattern, by the same numbers on both sides
        sine = made.sine[:, None]
        towards = sine * up_along(starboard.receive) + np.sqrt(1 - sine ** 2) * starboard.receive.normal[0]
        area = final.path_length * width * 0.5 * bed * survey.pulse_length / np.maximum(
            np.cos(final.grazing), 1e-3)
        return strength_db(made.intensity, source_level_db=side.source_level_db, loss_db=loss, area=area,
                           transmit_pattern_db=face_pattern_db(starboard.transmit, towards, side.wavelength),
                           receive_pattern_db=face_pattern_db(starboard.receive, towards, side.wavelength))


def _beam_width(survey: InterferometricSurvey) -> float:
    """Return the integral of the two-way power pattern over the angle along the track [rad]."""
    side = survey.sides[0]
    cell = side.wavelength / max(side.transmit.length, side.receive.length)
    sine = np.linspace(-1, 1, NODES) * min(8 * cell, 1.0)
    power = np.prod([np.sinc(array.length / side.wavelength * sine) for array in (side.transmit, side.receive)],
                    axis=0) ** 2
    return float(np.sum(power) * (sine[1] - sine[0]))
