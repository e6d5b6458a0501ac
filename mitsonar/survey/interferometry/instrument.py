"""An interferometric sidescan as the instrument of a line of soundings: a sounding a bin, both sides in one swath.

The instrument reads a phase with its own sound speed c_h, as a sine that is c_h / c of the true one. What a face sees
it refers to the sonar's centre (`hydrography.faces_aside`). A sounding's depth h errs by the angle's and the time's
deviations: σ_h² = (y σ_θ)² + (c σ_t cos θ / 2)², y its distance across the track; its quality is log10 h / σ_h.
"""
from __future__ import annotations

import numpy as np

from ...hydrography.bottom_backscatter import strength_db
from ...hydrography.faces_aside import AsideFace
from ...hydrography.losses import mean_absorption, transmission_loss_db
from ...hydrography.quality import gravity_deviation
from ...hydrography.record import BY_PHASE, NOT_DETECTED
from ...hydrography.reduction import Installation, Located, Measured
from ...hydrography.uncertainty import Deviations
from ...units import db_from_power
from ..swath.soundings import Finding
from .measuring import Measurement, measured_rows
from .plan import up_along
from .sides import both_sides
from .survey import InterferometricSurvey

__all__ = ["Interferometer"]

WORDS = ("mean intensity over the window, noise included; corrected for source level, spreading and absorption along "
         "the bent path, patterns of transmitting face and rows, and the area that pulse and beam let sound at once on "
         "a level bed")
FAINTEST = 1e-3                    # pressure of a face's pattern that is corrected for at most
NODES = 2001                       # of the beam along the track
HIGHEST = np.deg2rad(1.0)          # depression of a sounding at least, by the body


class Interferometer:
    """See `swath.soundings.Instrument`.

    Parameters
    ----------
    survey : InterferometricSurvey
    seed : int
    """

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

    def measure(self, ping: int) -> Measurement:
        """Measure a ping."""
        port, starboard = (side.signals(ping, self._seed) for side in self.sides)
        return measured_rows(self._survey, (port, starboard))

    def measured(self, ping: int, made: Measurement, head_speed: float,
                 closing: np.ndarray | None = None) -> Measured:
        """Give times and angles as a sound speed at the head [m/s] makes them of the phases."""
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

    def finding(self, ping: int, made: Measurement, final: Located) -> Finding:
        """Give quality, footprints and strengths."""
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

    def _deviations(self, made: Measurement) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of angle [rad] and time [s]: (B,) each."""
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

    def _strength(self, made: Measurement, final: Located) -> np.ndarray:
        """Strengths of the bed [dB] by the sonar equation, as the instrument knows its beams."""
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
