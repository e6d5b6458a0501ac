"""A multibeam echo sounder as the instrument of a line of soundings: beams, detection, strengths, water column."""
from __future__ import annotations

import numpy as np

from ...hydrography.reduction import Installation, Located, Measured
from ...imaging.fan import levels
from .measuring import Measurement, SwathBeams
from .soundings import Finding
from .strength import WORDS, Strengths
from .survey import SwathSurvey

__all__ = ["Multibeam"]


class Multibeam:
    """See `soundings.Instrument`.

    Parameters
    ----------
    survey : SwathSurvey
    seed : int
    column : bool
        Whether the water column is kept.
    snippets : int
        Samples about each sounding that are kept.
    """

    sonar, backscatter = "multibeam", WORDS

    def __init__(self, survey: SwathSurvey, seed: int, *, column: bool = False, snippets: int = 0):
        self._survey, self._column, self._snippets = survey, column, snippets
        self._beams = SwathBeams(survey, seed)
        self._strengths = Strengths(survey, self._beams.sectors)
        self.installation, self.absorption_db = _installation(survey), self._strengths.absorption_db

    def measure(self, ping: int) -> Measurement:
        """Measure a ping."""
        return self._beams.measure(ping)

    def measured(self, ping: int, made: Measurement, head_speed: float,
                 closing: np.ndarray | None = None) -> Measured:
        """Give times and angles; beams have been steered with the head's own sound speed, whatever that is."""
        said = self._survey.sectors[0].survey.sound_speed(ping) + self._survey.head_speed_error
        angle = made.angle
        if closing is not None:
            angle = np.arcsin(np.clip(np.sin(angle) * (1 + closing / said), -1, 1))
        beams = len(made.sent)
        return Measured(ping_time=np.full(beams, self._survey.track.time[ping]), transmit_time=made.sent,
                        travel_time=made.travel_time, angle=angle, transmit_angle=made.transmit_angle,
                        head_sound_speed=np.full(beams, said))

    def finding(self, ping: int, made: Measurement, final: Located) -> Finding:
        """Give detection, strengths and, where they are kept, snippets and water column."""
        values: dict[str, np.ndarray | float] = {"detection": made.method, "quality": made.quality,
                                                 **self._strengths.of(ping, made, final, self._snippets)}
        if self._snippets:
            values["snippet_rate"] = self._survey.sectors[0].survey.sampling_rate
        if self._column:
            values.update(self._of_the_column(ping, made))
        return Finding(variables=values)

    def _of_the_column(self, ping: int, made: Measurement) -> dict[str, np.ndarray]:
        """Levels of all beams."""
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
    """Where the arrays are on the platform."""
    offset = survey.voyage.trajectory.offset
    first = survey.sectors[0].survey
    return Installation(
        transmit_offset=offset + first.transmit.position.mean(0),
        receive_offset=offset + first.receive.position.mean(0),
        transmit_mounting=survey.mounting, receive_mounting=survey.mounting)
