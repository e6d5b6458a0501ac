"""Images of a fan of beams: all pings of a survey at once, or one after the other.

Images are made in the beam domain (`beam_domain.frames`) or from the signals of elements (`signals`); the attribute
``picture`` holds the method.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.imaging import fan
from mitsonar.imaging.energy_record import EnergyRecord, gathered
from mitsonar.scene import objects
from mitsonar.scene.labels import classes_of

from .. import limits
from ..energy import energy
from ..fan.beams import Beams
from ..pressure.array_survey import ArraySurvey
from ..pressure.pressure import PressureRecord
from ..pressure.signals import ping_attributes, ping_coordinates, received_signals
from ..survey import PerSurroundings, Survey
from .frames import Frames, why_not

Progress = Callable[[float, float], None]
Say = Callable[[str], None]


class FanPictures:
    """Images of a survey's pings."""
    # directions: angles (B,) [rad] and unit vectors (B, 3) of the beams

    def __init__(self, survey: ArraySurvey, directions: tuple[np.ndarray, np.ndarray], *, seed: int,
                 way: str | None = None):
        self._survey, self._directions, self._seed = survey, directions, seed
        self.way = way or ("elements" if why_not(survey, directions[1]) else "beams")
        limits.check_beams(survey, len(directions[0]), pings=1)
        # both ways refuse images that are too large here, before hours of computing
        self._beams = None if self.way == "beams" else Beams(survey, *directions)

    @cached_property
    def _frames(self) -> PerSurroundings[ArraySurvey, Frames]:
        """Return the frames in the beam domain, for each of the survey's surroundings."""
        direction = self._directions[1]
        return PerSurroundings(self._survey, lambda part: Frames(part, direction, per_cell=part.per_cell))

    def whole(self, progress: Progress | None = None, say: Say | None = None) -> xr.Dataset:
        """Return the image of all pings; arguments as of `mitsonar.render`."""
        survey, pings = self._survey, range(self._survey.track.pings)
        limits.check_beams(survey, len(self._directions[0]), pings=len(pings))
        if self._beams is None or survey.run_parts is not map:
            level, record = self._framed(pings, progress)
        else:
            level, record = self._of_elements(pings, progress, say), energy.record(survey, self._beams, self._seed)
        image = self._image(pings, level, record)
        return image.assign_attrs(unseen=objects.unseen(image))

    def of(self, ping: int) -> xr.Dataset:
        """Return the image of one ping; memory does not grow with the number of pings."""
        image = self._image([ping], *self._framed([ping], None))
        return image.assign_attrs(unseen=objects.unseen(image, warn=False))

    @cached_property
    def _block(self) -> PerSurroundings[Survey, energy.EnergyBlock] | None:
        """Return the source of the truth of single pings; None in the beam domain, which makes it of its own echoes."""
        return None if self._beams is None else energy.energy_blocks(self._survey, self._beams, self._seed)

    def _frame(self, ping: int) -> tuple[np.ndarray, EnergyRecord]:
        """Return the levels (beam, sample) of a ping, and their truth."""
        if self._block is not None:
            level = self._of_elements([ping], None, None)[0]
            return level, self._block.at(ping).echoes(np.array([ping]))
        beams, truth = self._frames.at(ping).frame(ping, self._seed)
        return fan.levels(beams).astype(np.float32), truth

    def _framed(self, pings: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, EnergyRecord]:
        """Return the levels (ping, beam, sample) of pings that are made one by one, and their truth."""
        level = []

        def records() -> Iterator[EnergyRecord]:
            for levels, truth in self._survey.each_part(self._frame, pings, progress):
                level.append(levels)
                yield truth

        record = gathered(records(), pings=len(pings), rows=len(self._directions[1]))
        return np.stack(level), record

    def _of_elements(self, pings: Sequence[int], progress: Progress | None, say: Say | None) -> np.ndarray:
        """Return the levels (ping, beam, sample) of beams formed from the elements' signals."""
        survey = self._survey
        signals = received_signals(PressureRecord(survey, seed=self._seed), pings, progress=progress, say=say)
        # the beams of a ping are steered with the sound speed at its place
        parts = (signals.isel(ping=[number]).assign_attrs(sound_speed=survey.sound_speed(ping))
                 for number, ping in enumerate(pings))
        return np.concatenate([fan.levels(fan.formed(part, survey.pulse, self._directions[1])) for part in parts])

    @cached_property
    def _known(self) -> dict[str, Any]:
        """Return the attributes of the scene, which all images share."""
        return objects.known(*classes_of(self._survey.labels), self._survey.world.still,
                             self._survey.planned.track.position)

    def _image(self, pings: Sequence[int], level: np.ndarray, record: EnergyRecord) -> xr.Dataset:
        """Return the image of pings from its levels and its truth."""
        survey = self._survey
        about = xr.Dataset(
            coords={**ping_coordinates(survey, pings), "time": ("sample", survey.time[survey.lead:])},
            attrs={**ping_attributes(survey, pings), "seed": self._seed, "source_level_db": survey.source_level_db})
        image = fan.image(about, level, *self._directions, depth_below=survey.depth_below[list(pings)],
                          labels=survey.labels, class_of=classes_of(survey.labels)[1], record=record)
        known = self._known
        if survey.world.moves and len(pings) == 1:
            ping = pings[0]
            known = objects.standing(known, survey.world.at(ping), survey.track.position[ping])
        return image.assign_attrs(picture=self.way, **known)
