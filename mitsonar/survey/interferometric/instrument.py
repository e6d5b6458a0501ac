"""An interferometric sidescan as the instrument of a line of soundings: a sounding a bin, both sides in one swath.

The instrument reads a phase with its own sound speed c_h, as a sine that is c_h / c of the true one. What a face sees
it refers to the sonar's centre (`hydrography.faces_aside`). A sounding's depth h errs by the angle's and the time's
deviations: σ_h² = (y σ_θ)² + (c σ_t cos θ / 2)², y its distance across the track; its quality is log10 h / σ_h.

The signals of a side's rows in the beam domain, and the truth of its bins from the same echoes.

Rows are apertures of one element each of the line that they make: a beam of one element, steered nowhere, is what the
element hears. Waves are plane over the rows; the pulse comes to them one after the other.

What an interferometric sidescan measures of a ping: level, angle and coherence for every bin of either side.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.device.chance import ping_key, sonar_seed
from mitsonar.hydrography.detection.bottom_backscatter import mean_absorption, strength_db, transmission_loss_db
from mitsonar.hydrography.detection.faces_aside import AsideFace
from mitsonar.hydrography.detection.quality import gravity_deviation
from mitsonar.hydrography.record import BY_PHASE, NOT_DETECTED
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.hydrography.reduction.uncertainty import Deviations
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.signal.beam_grid import NoiseDensity
from mitsonar.units import amplitude_from_db, db_from_power

from ..beam_domain.blur import OneBeam
from ..beam_domain.frames import LaidPing, lay, line_beams
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.truth import FrameTruth
from ..soundings.line import Finding
from .plan import SIDES, InterferometricSurvey, up_along


@dataclass(frozen=True, kw_only=True, eq=False)
class RowMeasurement:
    """Hold the measurement of a ping, arrays (B,): port's bins from the last to the first, then starboard's."""

    valid: np.ndarray  # coherent enough, and within the sector
    sector: np.ndarray  # 0 of port, 1 of starboard
    time: np.ndarray  # [s]: of the bins' middles, after the transmission
    sine: np.ndarray  # along the rows' axis, by the true sound speed at the head
    sine_deviation: np.ndarray
    coherence: np.ndarray
    phase: np.ndarray  # [rad]
    power: np.ndarray  # [µPa²]: mean of the rows over the window
    level: np.ndarray  # [µPa²]: mean over the bin of the sum of the rows' powers

    def by_side(self, values: np.ndarray) -> np.ndarray:
        """Return values (B,) as (side, bin), both from the first bin on."""
        half = len(values) // 2
        return np.stack([values[:half][::-1], values[half:]])


def measured_rows(survey: InterferometricSurvey, signals: tuple[np.ndarray, np.ndarray]) -> RowMeasurement:
    """Compare the rows of both sides, signals (rows, samples) [µPa] each."""
    per_bin = survey.per_bin
    found, levels = [], []
    for rows in signals:
        found.append(survey.rows.angles(rows, per_bin=per_bin, window=survey.window, looks=_looks(survey),
                                        relative_bandwidth=survey.relative_bandwidth))
        levels.append((np.abs(rows) ** 2).sum(0, dtype=float).reshape(survey.bins, per_bin).mean(1))

    def both(name: str) -> np.ndarray:
        return _joined(*(getattr(one, name) for one in found))

    coherence = both("coherence")
    return RowMeasurement(
        valid=both("inside") & (coherence >= survey.least_coherence), time=_joined(survey.time, survey.time),
        sector=np.repeat(np.arange(2, dtype=np.int32), survey.bins), sine=both("sine"), coherence=coherence,
        sine_deviation=both("deviation"), phase=both("phase"), power=both("power"), level=_joined(*levels))


def _looks(survey: InterferometricSurvey) -> float:
    """Return independent samples in a window, 1 or more."""
    return max(1.0, survey.window / (survey.sides[0].sampling_rate * survey.pulse_length))


def _joined(port: np.ndarray, starboard: np.ndarray) -> np.ndarray:
    return np.concatenate([port[::-1], starboard])


WIDEST = 1.05                      # sine: rows that move see echoes from beyond 1


def both_sides(survey: InterferometricSurvey) -> tuple[SideRows, SideRows]:
    """Make the signals of either side; both share their tables of the scene."""
    port = SideRows(survey, 0)
    return port, SideRows(survey, 1, beside=port)


class SideRows:
    """Make the signals of one side."""

    def __init__(self, survey: InterferometricSurvey, number: int, beside: SideRows | None = None):
        self._whole, self._number = survey, number
        self.survey = side = survey.sides[number]
        self.line = line = LineArray.along(side.receive, up_along(side.receive), side.wavelength)
        longest = max(side.transmit.length, side.receive.length)
        self._echoes = PingEchoes(side, line, per_cell=side.per_cell, beams_from_origin=False,
                                  beside=None if beside is None else beside._echoes,
                                  lobe=(side.receive.along[0], side.wavelength / longest))
        self._beams = line_beams(side, line.place, np.eye(len(line.place)), np.zeros(1))
        self._noise = NoiseDensity.of(side.noise, side.source_level_db)
        per_bin = survey.per_bin
        self._truth = FrameTruth(OneBeam(WIDEST, side.pulse.bandwidth * per_bin / side.sampling_rate),
                                 lead=side.lead, bins=survey.bins, named=side.geometry.named, per_bin=per_bin,
                                 of_objects=True)

    def signals(self, ping: int, seed: int) -> np.ndarray:
        """Return the compressed signals (rows, samples) [µPa] of a ping, complex64."""
        return self._heard(ping, seed)[0]

    def frame(self, ping: int, seed: int) -> tuple[np.ndarray, EnergyRecord]:
        """Return the signals of a ping, and the truth of the bins, arrays (1, ..., bins)."""
        signals, laid = self._heard(ping, seed)
        return signals, laid.truth(self._echoes, ping, self._truth)

    def _heard(self, ping: int, seed: int) -> tuple[np.ndarray, LaidPing]:
        own = seed if not self._number else sonar_seed(seed, SIDES[self._number])
        grid = self._beams.grid()
        laid = lay(self._echoes, grid, ping, own)
        rows = self._beams.form_each(grid, doppler=self._echoes.doppler(ping), noise=self._noise,
                                     key=ping_key(own, ping))[:, 0]
        return rows * np.float32(amplitude_from_db(self.survey.source_level_db)), laid


WORDS = ("mean intensity over the window, noise included; corrected for source level, spreading and absorption along "
         "the bent path, patterns of transmitting face and rows, and the area that pulse and beam let sound at once on "
         "a level bed")
FAINTEST = 1e-3                    # pressure of a face's pattern that is corrected for at most
NODES = 2001                       # of the beam along the track
HIGHEST = np.deg2rad(1.0)          # depression of a sounding at least, by the body


class Interferometer:
    """Measure the pings of an interferometric sidescan; see `soundings.Instrument`."""

    sonar, backscatter = "interferometric", WORDS

    def __init__(self, survey: InterferometricSurvey, seed: int):
        self._survey, self._seed = survey, seed
        self.sides = both_sides(survey)
        offset = survey.voyage.trajectory.offset
        self.installation = Installation(transmit_offset=offset, receive_offset=offset)
        self._faces = [AsideFace(transmit_centre=side.transmit.position.mean(0),
                                 receive_centre=side.receive.position.mean(0), axis=up_along(side.receive),
                                 normal=side.receive.normal[0]) for side in survey.sides]
        top = -float(survey.track.position[:, 2].mean())
        bottom = max(survey.geometry.depth_range[1], top + 1)
        self.absorption_db = np.full(2, float(mean_absorption(survey.absorption, top, bottom)))
        self._width = _beam_width(survey)

    def measure(self, ping: int) -> RowMeasurement:
        """Measure a ping."""
        port, starboard = (side.signals(ping, self._seed) for side in self.sides)
        return measured_rows(self._survey, (port, starboard))

    def measured(self, ping: int, made: RowMeasurement, head_speed: float,
                 closing: np.ndarray | None = None) -> Measured:
        """Return times and angles as a sound speed at the head [m/s] makes them of the phases."""
        survey, beams = self._survey, len(made.time)
        there = survey.sides[0].sound_speed(ping)
        sine = made.sine * (head_speed / there)
        if closing is not None:
            sine = sine * (1 + np.nan_to_num(closing) / there)
        half = beams // 2
        seen = [face.seen(sine[some], made.time[some], head_speed)
                for face, some in zip(self._faces, (slice(0, half), slice(half, None)))]
        depression = np.concatenate([one.depression for one in seen])
        use = made.valid & (depression > HIGHEST) & (depression < np.pi - HIGHEST) & self._within_gate(
            depression, made.time, head_speed)

        def column(name: str) -> np.ndarray:
            return np.where(use, np.concatenate([getattr(one, name) for one in seen]), np.nan)

        time = survey.track.time[ping]
        return Measured(ping_time=np.full(beams, time), transmit_time=np.full(beams, time),
                        travel_time=column("travel_time"), angle=column("angle"),
                        transmit_angle=column("transmit_angle"), head_sound_speed=np.full(beams, head_speed))

    def finding(self, ping: int, made: RowMeasurement, final: Located) -> Finding:
        """Return quality, footprints and strengths."""
        survey = self._survey
        speed = survey.sides[0].sound_speed(ping)
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
            "footprint_across": across, "footprint_along": final.path_length * self._width,
            "backscatter_db": np.where(there, self._strength(made, final), np.nan)}
        return Finding(variables=values, deviations=Deviations(time=sigma_time[None], angle=sigma_angle[None]))

    def _deviations(self, made: RowMeasurement) -> tuple[np.ndarray, np.ndarray]:
        """Return standard deviations of angle [rad] and time [s]: (B,) each."""
        survey = self._survey
        angle = made.sine_deviation / np.sqrt(np.maximum(1 - made.sine ** 2, 0.01))
        window = survey.window / survey.sides[0].sampling_rate / np.sqrt(12)
        return angle, np.full(len(angle), float(gravity_deviation(np.array(window), survey.pulse_length)))

    def _within_gate(self, depression: np.ndarray, time: np.ndarray, speed: float) -> np.ndarray:
        gate = self._survey.depth_gate
        if gate is None:
            return np.ones(len(time), bool)
        below = 0.5 * speed * time * np.sin(depression)
        return (below >= gate[0]) & (below <= gate[1])

    def _strength(self, made: RowMeasurement, final: Located) -> np.ndarray:
        """Return strengths of the bed [dB] by the sonar equation, as the instrument knows its beams."""
        survey = self._survey
        side = survey.sides[0]
        head, bed = side.sound_speed(0), survey.profile.at(np.nan_to_num(final.depth))
        loss = 2 * (transmission_loss_db(final, survey.absorption) - db_from_power(bed / head))
        # the sine of a side's own face tells where in its pattern an echo lies, by the same numbers on either side
        starboard = survey.sides[1]
        sine = made.sine[:, None]
        towards = sine * up_along(starboard.receive) + np.sqrt(1 - sine ** 2) * starboard.receive.normal[0]
        pattern = [2 * db_from_power(np.maximum(np.abs(array.element_pressure(
            towards, side.wavelength, array.normal[0], array.along[0])), FAINTEST))
            for array in (starboard.transmit, starboard.receive)]
        area = final.path_length * self._width * 0.5 * bed * survey.pulse_length / np.maximum(
            np.cos(final.grazing), 1e-3)
        return strength_db(made.power, source_level_db=side.source_level_db, loss_db=loss, area=area,
                           transmit_pattern_db=pattern[0], receive_pattern_db=pattern[1])


def _beam_width(survey: InterferometricSurvey) -> float:
    """∫ of the two-way power pattern over the angle along the track [rad]."""
    side = survey.sides[0]
    cell = side.wavelength / max(side.transmit.length, side.receive.length)
    sine = np.linspace(-1, 1, NODES) * min(8 * cell, 1.0)
    power = np.prod([np.sinc(array.length / side.wavelength * sine) for array in (side.transmit, side.receive)],
                    axis=0) ** 2
    return float(np.sum(power) * (sine[1] - sine[0]))
