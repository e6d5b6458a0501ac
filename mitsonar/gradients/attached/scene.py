"""Read the present geometry, water and track of a scene, with gradients where its arrays carry them.

Arrays that carry gradients are those of the plugins: vertices of meshes, ``sound_speed``, ``absorption_scale`` and
``absorption_offset`` of the water, ``position_offset`` and ``attitude_offset`` of the sonar; materials hold their own.
Losses of a water whose absorption carries a gradient are

    A = s (A_0 + A[δ]),    dA = A ds / s + s A[dδ]

A -> two-way loss [dB], s -> ``absorption_scale``, δ -> ``absorption_offset`` [dB/m] at the profile's nodes. Loss is
linear in absorption: A[δ] is that of a water that absorbs δ (`water.column`), at constant speed

    dA / dδ_i = 2 L <hat_i>              L the way one way, <> the mean over depth between its ends

The effect of sound speed on absorption along a given way is left out: 1e-3 of the loss for a change of 1 m/s over a
whole way.
"""
from __future__ import annotations

from dataclasses import replace
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.scene.tracing.water import DeviceWater, Way
from mitsonar.sonar.motion.track import Track
from mitsonar.survey import placement
from mitsonar.survey.survey import Survey
from mitsonar.water.absorption_table import Absorption
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.waters import Waters

from ..records.energy_field import EnergyField, Scenery
from ..records.pictures import Picture
from .geometry import AttachedGeometry
from .layers import attached_layers
from .ray_shift import tangent
from .track import AttachedTrack, Offsets


class AttachedWater:
    """Compute losses with gradients by the scale (1,) [-] and the offset (K,) [dB/m] of absorption."""

    def __init__(self, water: DeviceWater, scale: mi.Float64, offset: mi.Float64):
        self._water, self._grows, self._more = water, None, None
        table = water.direct.absorption
        if dr.grad_enabled(scale):
            self._grows = 1 + mi.Float(tangent(scale)) / dr.maximum(mi.Float(dr.detach(scale)), 1e-30)
        if dr.grad_enabled(offset) and table is not None:
            self._more = _more(table, water.profile, offset * dr.detach(scale))

    def loss_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way) -> mi.Float:
        """Return the two-way absorption [dB], Float (R,); see `DeviceWater.loss_db`."""
        loss = self._water.loss_db(start, end, way)
        if self._grows is not None:
            loss = loss * self._grows
        if self._more is not None:
            z0, z1 = (mi.Float(-dr.detach(point).z) for point in (start, end))
            arc, parameter = dr.detach(way.arc_length), mi.Float(dr.detach(way.ray_parameter))
            loss = loss + tangent(self._more.two_way_db(z0, z1, arc, parameter))
        return loss


def _more(table: Absorption, profile: SoundSpeedProfile, offset: mi.Float64) -> Absorption:
    """Return the table attached to an addition to absorption at the profile's nodes."""
    nodes = profile.depth
    inside = nodes[(nodes > table.depth[0]) & (nodes < table.depth[-1])]
    fine = np.unique(np.concatenate([table.depth, inside]))
    lower = np.clip(np.searchsorted(nodes, fine, side="right") - 1, 0, max(len(nodes) - 2, 0))
    upper = np.minimum(lower + 1, len(nodes) - 1)
    apart = np.where(upper > lower, nodes[upper] - nodes[lower], 1.0)
    share = upload(mi.Float64, np.clip((fine - nodes[lower]) / apart, 0, 1))
    low, high = (dr.gather(mi.Float64, offset, upload(mi.UInt32, node.astype(np.uint32))) for node in (lower, upper))
    alpha = dr.lerp(low, high, share)
    reference = float(table.c2.numpy()[0])
    e = upload(mi.Float64, profile.at(fine) ** 2 / reference - 1)
    ahead = dr.minimum(dr.arange(mi.UInt32, len(fine)) + 1, len(fine) - 1)
    step = upload(mi.Float64, np.append(np.diff(fine), 0.0))
    rows = upload(mi.UInt32, np.searchsorted(fine, table.depth).astype(np.uint32))
    attached = dr.zeros(mi.Float, 4 * len(table.depth))
    for column, values in ((0, alpha), (1, alpha * e)):
        area = 0.5 * step * (values + dr.gather(mi.Float64, values, ahead))
        integral = dr.prefix_reduce(dr.ReduceOp.Add, area, exclusive=True)
        _put(attached, column, mi.Float(dr.gather(mi.Float64, integral, rows)))
    _put(attached, 3, mi.Float(dr.gather(mi.Float64, alpha, rows)))
    return table.with_table(cast(mi.Float, dr.replace_grad(dr.detach(table.table), attached)))


def _put(table: mi.Float, column: int, values: mi.Float) -> None:
    dr.scatter(table, values, 4 * dr.arange(mi.UInt32, dr.width(values)) + column)


class AttachedScene:
    """Read the scene of a sonar's record."""

    def __init__(self, picture: Picture, survey: Survey):
        survey.refuse_field("gradients")
        self._sensor, self._survey, self._frequency = picture.sensor, survey, picture.rows.frequency
        self._start = self._offsets()
        self._checked = survey.track.position, survey.world.only.vertices.numpy()

    def _offsets(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the present offsets of position and attitude, (rows, 3)."""
        position, attitude = (dr.detach(offset).numpy().reshape(-1, 3) for offset in (
            self._sensor.position_offset, self._sensor.attitude_offset))
        return position, attitude

    def _track(self) -> Track:
        """Return the present track."""
        position, attitude = (now - start for now, start in zip(self._offsets(), self._start))
        if not np.any(position) and not np.any(attitude):
            return self._survey.track
        return self._survey.track.moved(position, attitude)

    def scenery(self, field: EnergyField) -> Scenery:
        """Return the present scene, without gradients."""
        water, voyage = self._sensor.water, self._survey.voyage
        with dr.suspend_grad():
            column = replace(self._survey.waters.only, profile=water.profile,
                             absorption=water.absorption_column(self._frequency))
            survey = replace(
                self._survey, world=self._survey.world.smoothed(), waters=Waters.constant(column),
                passage=replace(self._survey.passage, voyage=replace(voyage, track=self._track())))
            self._check(survey)
            scenery = field.at(survey)
            if np.any(survey.track.rotation() != self._survey.track.rotation()):
                scenery = replace(scenery, track=self._turned(scenery, survey.track, scenery.layers, attached=False))
        return scenery

    def _check(self, survey: Survey) -> None:
        """Refuse a sonar that a fit has moved out of the water; the start has been checked."""
        geometry = survey.world.only
        places = survey.track.position, geometry.vertices.numpy()
        if not all(np.array_equal(now, before) for now, before in zip(places, self._checked)):
            placement.check(geometry, survey.track)
            self._checked = places

    def attached(self, scenery: Scenery) -> Scenery:
        """Return the same scenery with gradients of its own: those of a product are used up by it."""
        water = self._sensor.water
        layers = scenery.water.direct.layers
        moving = [self._sensor.position_offset, self._sensor.attitude_offset]
        if dr.grad_enabled(water.speeds):
            layers = attached_layers(layers, water.speeds)
            moving.append(water.speeds)
        track = scenery.track
        if any(dr.grad_enabled(value) for value in moving):
            track = self._turned(scenery, scenery.survey.track, layers, attached=True)
        losses = AttachedWater(scenery.water, water.absorption_scale, water.absorption_offset)
        return replace(scenery, facets=AttachedGeometry(scenery.tracer.geometry), layers=layers, track=track,
                       speeds=water.speeds, losses=losses)

    def _turned(self, scenery: Scenery, track: Track, layers: LayerTable, *, attached: bool) -> AttachedTrack:
        sensor = self._sensor
        position, attitude = (value if attached and dr.grad_enabled(value) else None for value in (
            sensor.position_offset, sensor.attitude_offset))
        offsets = Offsets(position=position, attitude=attitude, rows=sensor.rows)
        return AttachedTrack(self._survey.track, track, offsets, layers)
