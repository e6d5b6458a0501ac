"""Multibeam echo sounder: a swath of beams in sectors, whose picture is the water column.

    plan       one route, a survey of arrays for every sector                           `plan`
    beams      halves of the receiving line in the beam domain                          `beams`
    soundings  detection and reduction                                     `measuring`, `instrument`, `soundings.line`
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.imaging import fan
from mitsonar.imaging.energy_record import EnergyRecord, gathered, joined
from mitsonar.scene import objects
from mitsonar.scene.labels import classes_of

from .. import limits
from ..pressure.array_survey import ArraySurvey
from ..pressure.signals import ping_attributes, ping_coordinates
from ..sensor import RunSettings
from ..soundings.line import Instrument
from ..soundings.survey import SwathSurvey
from ..survey import PerSurroundings
from .beams import sector_beams
from .instrument import MultibeamInstrument
from .measuring import BeamMeasurement
from .plan import MultibeamSensor, plan


def plan_elements(scene: mi.Scene, sensor: MultibeamSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan a run that records the signals of the elements."""
    survey = plan(scene, sensor, settings, lead)
    if len(survey.sectors) > 1:
        raise ValueError(f"a ping of this multibeam has {len(survey.sectors)} transmissions, and signals of elements "
                         "are of one; give frequency_khz one number and swaths 1")
    return survey.sectors[0].survey


def picture(survey: SwathSurvey, sensor: MultibeamSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of the water column, with its truth; see `mitsonar.render`."""
    pings = range(survey.track.pings)
    limits.check_beams(survey.sectors[0].survey, survey.beams, pings=len(pings))
    image = _SwathPictures(survey, seed).of(pings, progress)
    return image.assign_attrs(unseen=objects.unseen(image))


def frame(survey: SwathSurvey, sensor: MultibeamSensor, seed: int) -> Callable[[int], xr.Dataset]:
    """Return the function that renders the picture of one ping; see `mitsonar.frames`."""
    pictures = _SwathPictures(survey, seed)

    def of(ping: int) -> xr.Dataset:
        image = pictures.of([ping], None)
        return image.assign_attrs(unseen=objects.unseen(image, warn=False))

    return of


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, beam, sample) as rows of one picture, ping after ping."""
    return level.reshape(-1, level.shape[-1])


def instrument(survey: SwathSurvey, seed: int, *, column: bool, snippets: int) -> Instrument[BeamMeasurement]:
    """Make the instrument that measures the pings; arguments as of `mitsonar.soundings`."""
    return MultibeamInstrument(survey, seed, column=column, snippets=snippets)


class _SwathPictures:
    """Pictures of pings."""

    def __init__(self, survey: SwathSurvey, seed: int):
        self._survey, self._seed = survey, seed
        self._sectors = PerSurroundings(survey, sector_beams)

    def of(self, pings: Sequence[int], progress: Callable[[float, float], None] | None) -> xr.Dataset:
        """Return the picture of pings."""
        survey, levels = self._survey, []

        def records() -> Iterator[EnergyRecord]:
            for level, truth in survey.each_part(self._frame, pings, progress):
                levels.append(level)
                yield truth

        record = gathered(records(), pings=len(pings), rows=survey.beams)
        first = survey.sectors[0].survey
        about = xr.Dataset(
            coords={**ping_coordinates(first, pings), "time": ("sample", first.time[first.lead:])},
            attrs={**ping_attributes(first, pings), "seed": self._seed, "source_level_db": first.source_level_db})
        image = fan.image(about, np.stack(levels), self._angle, self._direction,
                          depth_below=survey.depth_below[list(pings)], labels=survey.labels,
                          class_of=classes_of(survey.labels)[1], record=record)
        known = self._known
        if survey.world.moves and len(pings) == 1:
            ping = pings[0]
            known = objects.standing(known, survey.world.at(ping), survey.track.position[ping])
        return self._with_beams(image, pings).assign_attrs(known, sonar="multibeam", preset=survey.preset)

    def _frame(self, ping: int) -> tuple[np.ndarray, EnergyRecord]:
        """Return the levels (beam, sample) of a ping, and their truth."""
        frames = [sector.frame(ping, self._seed) for sector in self._sectors.at(ping)]
        return (np.concatenate([fan.levels(beams).astype(np.float32) for beams, _ in frames]),
                joined([truth for _, truth in frames]))

    def _with_beams(self, image: xr.Dataset, pings: Sequence[int]) -> xr.Dataset:
        """Add the direction, sector and frequency of every beam."""
        survey = self._survey
        sines = np.concatenate([run.sines[list(pings)] for run in survey.sectors], 1)
        sector = np.repeat(np.arange(len(survey.sectors)), [run.sines.shape[1] for run in survey.sectors])
        frequency = np.array([run.survey.frequency for run in survey.sectors])[sector]
        return image.assign_coords(
            beam_angle=(("ping", "beam"), np.arcsin(sines), {"units": "rad", "long_name": "from the array's normal"}),
            sector=("beam", sector, {"units": "1", "long_name": "number of the transmission"}),
            beam_frequency=("beam", frequency, {"units": "Hz", "long_name": "of the transmission"}))

    @property
    def _angle(self) -> np.ndarray:
        return np.concatenate([run.sector.beams for run in self._survey.sectors])

    @property
    def _direction(self) -> np.ndarray:
        """Return the directions (B, 3) of the beams in a level body, body frame."""
        return np.stack([np.zeros_like(self._angle), np.sin(self._angle), np.cos(self._angle)], -1)

    @cached_property
    def _known(self) -> dict[str, object]:
        return objects.known(*classes_of(self._survey.labels), self._survey.world.still,
                             self._survey.planned.track.position)
