"""A scene as a field sees it now: geometry, water and track, with gradients where its arrays carry them.

Arrays that carry gradients are those of the plugins: vertices of meshes, ``sound_speed``, ``absorption_scale`` and
``absorption_offset`` of the water, ``position_offset`` and ``attitude_offset`` of the sonar; materials hold their own.
"""
from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from ..scene.geometry import Geometry
from ..sonar.track import Track
from ..survey import placement
from ..survey.survey import Survey
from .attached_geometry import AttachedGeometry
from .attached_layers import attached_layers
from .attached_track import AttachedTrack, Offsets
from .attached_water import AttachedWater
from .energy_field import EnergyField, Scenery
from .pictures import Picture

__all__ = ["AttachedScene"]


class AttachedScene:
    """What a sonar's record is made of, whenever it is asked for.

    Parameters
    ----------
    picture : Picture
    survey : Survey
        At the start; sonar, bins and the track that rays are drawn for are its own.
    """

    def __init__(self, picture: Picture, survey: Survey):
        self._sensor, self._survey, self._frequency = picture.sensor, survey, picture.rows.frequency
        self._start = self._offsets()
        self._checked = survey.track.position, survey.geometry.vertices.numpy()

    def _offsets(self) -> tuple[np.ndarray, np.ndarray]:
        """Offsets of position and attitude as they are now, (rows, 3)."""
        position, attitude = (dr.detach(offset).numpy().reshape(-1, 3) for offset in (
            self._sensor.position_offset, self._sensor.attitude_offset))
        return position, attitude

    def _track(self) -> Track:
        """The track as it is now."""
        position, attitude = (now - start for now, start in zip(self._offsets(), self._start))
        if not np.any(position) and not np.any(attitude):
            return self._survey.track
        return self._survey.track.moved(position, attitude)

    def scenery(self, field: EnergyField) -> Scenery:
        """Give the scene as it is now, without gradients."""
        water, voyage = self._sensor.water, self._survey.voyage
        with dr.suspend_grad():
            survey = replace(
                self._survey, geometry=Geometry(self._survey.geometry.scene, smooth_beds=True), profile=water.profile,
                absorption=water.absorption_column(self._frequency),
                passage=replace(self._survey.passage, voyage=replace(voyage, track=self._track())))
            self._check(survey)
            scenery = field.at(survey)
            if np.any(survey.track.rotation() != self._survey.track.rotation()):
                scenery = scenery.again(track=self._turned(scenery, survey.track, scenery.layers, attached=False))
        return scenery

    def _check(self, survey: Survey) -> None:
        """Refuse a sonar that a fit has moved out of the water; at the start `survey` has been checked."""
        places = survey.track.position, survey.geometry.vertices.numpy()
        if not all(np.array_equal(now, before) for now, before in zip(places, self._checked)):
            placement.check(survey.geometry, survey.track)
            self._checked = places

    def attached(self, scenery: Scenery) -> Scenery:
        """Give the same scenery with gradients of its own: those of a product are used up by it."""
        water: Any = self._sensor.water
        layers = scenery.water.direct.layers
        moving = [self._sensor.position_offset, self._sensor.attitude_offset]
        if dr.grad_enabled(water.speeds):
            layers = attached_layers(layers, water.speeds)
            moving.append(water.speeds)
        track = scenery.track
        if any(dr.grad_enabled(value) for value in moving):
            track = self._turned(scenery, scenery.survey.track, layers, attached=True)
        losses = AttachedWater(scenery.water, water.absorption_scale, water.absorption_offset)
        return scenery.again(facets=AttachedGeometry(scenery.survey.geometry), layers=layers, track=track,
                             speeds=water.speeds, losses=losses)

    def _turned(self, scenery: Scenery, track: Track, layers: Any, *, attached: bool) -> AttachedTrack:
        sensor = self._sensor
        position, attitude = (value if attached and dr.grad_enabled(value) else None for value in (
            sensor.position_offset, sensor.attitude_offset))
        offsets = Offsets(position=position, attitude=attitude, rows=sensor.rows)
        return AttachedTrack(self._survey.track, track, offsets, layers)
