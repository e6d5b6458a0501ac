"""The water on the device: everything that rays and echoes need from it.

    layers        sound speed by depth, in layers that rays are exact in         `device_rays.layer_table`
    absorption    two-way loss along bent rays                                   `water.absorption_table`
    field         sound speed that changes across                                `water.fields`
    volume        backscatter of the water itself                                `water.volume_table`

A flat surface mirrors. Above it, imagine the same water upside down: a reflected ray runs on there as if the surface
did not exist. The water is unfolded about the surface. Legs by way of the mirror are called folded; they start at the
image of their true start, in the folded medium.

All kernels take the water from a `DeviceWater`. Pings with the same column share one (`survey.Survey.surroundings`).
"""
from __future__ import annotations

from functools import cached_property
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.propagation.device_rays.layer_table import LayerTable, layer_table
from mitsonar.propagation.device_rays.two_point import SourceState, source_state
from mitsonar.propagation.returns.frozen_ray import FrozenLeg, FrozenRay, frozen_ray
from mitsonar.water.absorption_table import Absorption
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.fields import SoundSpeedField
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.volume import VolumeScattering
from mitsonar.water.volume_table import VolumeTable, volume_table


class Way(Protocol):
    """Quantities of a way through the water that set its absorption, such as `Hits` and `Connection` have."""

    @property
    def arc_length(self) -> mi.Float:
        """Arc length (R,) [m]."""
        ...

    @property
    def ray_parameter(self) -> mi.Float64:
        """Ray parameter (R,) [s/m]."""
        ...


class Medium:
    """Layers and absorption of water, as it is or unfolded, between the depths `top` and `deepest` [m]."""

    def __init__(self, profile: SoundSpeedProfile, absorption: AbsorptionColumn | None, *, deepest: float,
                 top: float = 0.0):
        self.profile, self._column, self._deepest, self._top = profile, absorption, deepest, top

    @cached_property
    def layers(self) -> LayerTable:
        """Layers of the sound speed."""
        return layer_table(self.profile, mi.Float)

    @cached_property
    def absorption(self) -> Absorption | None:
        """Absorption table, or None without absorption."""
        if self._column is None:
            return None
        return Absorption(self._column, self.profile, self._deepest, mi.Float, top=self._top)

    def loss_db(self, z0: mi.Float, z1: mi.Float, arc_length: mi.Float, ray_parameter: mi.Float) -> mi.Float:
        """Return the two-way absorption [dB] along rays between depths z0 and z1 [m], (R,)."""
        if self.absorption is None:
            return dr.zeros(mi.Float, dr.width(arc_length))
        return self.absorption.two_way_db(z0, z1, arc_length, ray_parameter)

    def at(self, depth: np.ndarray | float) -> SourceState:
        """Return the state of rays at source depths (D,) [m]."""
        return source_state(self.layers, np.atleast_1d(np.asarray(depth, float)))


class DeviceWater:
    """Sound speed, absorption and scattering of the water, down to `deepest` [m]."""

    def __init__(self, profile: SoundSpeedProfile, absorption: AbsorptionColumn | None = None,
                 volume: VolumeScattering | None = None, *, deepest: float = 0.0,
                 field: SoundSpeedField | None = None, level: float = 0.0):
        self.profile, self._top = profile, min(0.0, -level)             # level [m]: of the surface above z = 0
        self.field = None if field is None else field.on_device(mi.Float64)
        self._absorption, self._volume, self._deepest = absorption, volume, max(float(deepest), 1.0)

    @cached_property
    def direct(self) -> Medium:
        """Water as it is."""
        return Medium(self.profile, self._absorption, deepest=self._deepest, top=self._top)

    @cached_property
    def folded(self) -> Medium:
        """Water unfolded about the surface."""
        absorption = None if self._absorption is None else self._absorption.mirrored()
        return Medium(self.profile.mirrored(), absorption, deepest=self._deepest, top=-self._deepest)

    def medium(self, folded: bool = False) -> Medium:
        """Return the water for straight legs or for folded ones."""
        return self.folded if folded else self.direct

    def layers(self, folded: bool = False) -> LayerTable:
        """Return the sound speed by depth, of the water or of the water unfolded."""
        return self.medium(folded).layers

    def loss_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way, folded: bool = False) -> mi.Float:
        """Return the two-way absorption [dB] (R,) along ways between points (R,) [m]."""
        z0 = start.z if folded else -start.z
        return self.medium(folded).loss_db(mi.Float(z0), mi.Float(-end.z), way.arc_length, mi.Float(way.ray_parameter))

    def one_way_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way, folded: bool = False) -> mi.Float:
        """Return the one-way absorption [dB] (R,) along ways between points; arguments as in `loss_db`."""
        return 0.5 * self.loss_db(start, end, way, folded)

    def through_field(self, origin: dr.ArrayBase, heading: mi.Vector2f, horizontal_range: mi.Float64, depth: mi.Float64,
                      arc_length: mi.Float, ray_parameter: mi.Float64, launch_sine: mi.Float) -> FrozenRay:
        """Return what the field adds to eigenrays from `origin` (R,) [m] to a depth; `launch_sine` is positive down."""
        if self.field is None:
            raise ValueError("this water has no field")
        wide = mi.Float64
        leg = FrozenLeg((wide(origin.x), wide(origin.y), -wide(origin.z)), (wide(heading.x), wide(heading.y)),
                  wide(horizontal_range), wide(depth), wide(arc_length), ray_parameter, wide(launch_sine))
        return frozen_ray(leg, self.field, self.direct.layers.speed)

    @property
    def slowest(self) -> float:
        """Lowest sound speed [m/s]."""
        return float(np.min(self.profile.sound_speed))

    @property
    def fastest(self) -> float:
        """Highest sound speed [m/s]."""
        return float(np.max(self.profile.sound_speed))

    @property
    def scatters(self) -> bool:
        """True if the water itself scatters sound back."""
        return self._volume is not None

    @cached_property
    def volume(self) -> VolumeTable:
        """Volume scattering strength by depth."""
        if self._volume is None:
            raise ValueError("this water sends nothing back; it was made without volume scattering")
        return volume_table(self._volume, mi.Float)
