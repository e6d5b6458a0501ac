"""Bottom backscattering strength of a swath's soundings, with what the instrument knows of its beams.

    corrected    source level, spreading and absorption along the bent path, patterns of both faces, area
    not          losses of volume, noise near the bed beyond the detection's own estimate, side lobes
"""
from __future__ import annotations

from dataclasses import fields

import numpy as np

from ...hydrography.bottom_backscatter import ensonified_area, strength_db
from ...hydrography.losses import mean_absorption, transmission_loss_db
from ...hydrography.reduction import Located
from ...hydrography.snippets import snippets
from ...sonar.array import Array
from ...sonar.sectors import pattern_integral
from ...sonar.track import mounting_matrix
from ...units import db_from_power
from .beams import SectorBeams
from .measuring import Measurement
from .survey import SwathSurvey

__all__ = ["WORDS", "Strengths"]

WORDS = ("mean intensity over the footprint, less noise; corrected for source level, spreading and absorption along "
         "the bent path, patterns of transmitting and receiving faces, and the area that pulse and beams let sound at "
         "once on a bed that slopes across the track as the neighbouring beams find it")
FAINTEST = 1e-3                    # pressure of a face's pattern that is corrected for at most


class Strengths:
    """Make strengths out of intensities.

    Parameters
    ----------
    survey : SwathSurvey
    sectors : list of SectorBeams

    Attributes
    ----------
    absorption_db : (S,) [dB/m]
        Of the sectors, mean from the sonar down to the lowest bed.
    """

    def __init__(self, survey: SwathSurvey, sectors: list[SectorBeams]):
        self._survey, self._sectors = survey, sectors
        top = -float(survey.track.position[:, 2].mean())
        bottom = max(survey.geometry.depth_range[1], top + 1)
        self.absorption_db = np.array([float(mean_absorption(run.survey.absorption, top, bottom))
                                       for run in survey.sectors])

    def of(self, ping: int, made: Measurement, final: Located, samples: int) -> dict[str, np.ndarray]:
        """Give strengths, and snippets of so many samples, 0 for none, by the record's names."""
        rows = [self._of_a_sector(number, ping, made, final, samples) for number in range(len(self._sectors))]
        return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}

    def _of_a_sector(self, number: int, ping: int, made: Measurement, final: Located,
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
        """Pressures of the faces' patterns towards soundings so far away, 1 on their axes: sent, and heard.

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
