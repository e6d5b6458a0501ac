"""The water on the device: everything that rays and echoes ask of it, made in one place.

    layers        sound speed by depth, in layers that rays are exact in         `propagation.layer_table`
    absorption    two-way loss along bent rays                                   `water.absorption_table`
    volume        what the water itself sends back                               `water.volume_table`

A flat surface mirrors. Above it lies the same water upside down, and a ray that is reflected runs on there as if the
surface were not there: the water is unfolded about the surface. Legs by way of the mirror are called folded; they start
at the image of where they really do, in the medium that is called folded.

A profile of its own for every ping would be put in here. All kernels take what they know of the water from a
`DeviceWater`, and a survey makes its own in one place (`survey.Survey.water`): that would become one `DeviceWater` for
each stretch of pings with the same profile.
"""
from __future__ import annotations

from functools import cached_property
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.propagation.device_rays.layer_table import LayerTable, layer_table
from mitsonar.propagation.device_rays.two_point import SourceState, source_state
from mitsonar.water.absorption_table import Absorption
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.volume import VolumeScattering
from mitsonar.water.volume_table import VolumeTable, volume_table


class Way(Protocol):
    """What of a way through the water decides its absorption: `Hits` and `Connection` have it."""

    @property
    def arc_length(self) -> mi.Float:
        """Float (R,) [m]."""
        ...

    @property
    def ray_parameter(self) -> mi.Float64:
        """Float64 (R,) [s/m]."""
        ...


class Medium:
    """Layers and absorption of water, as it is or unfolded."""
    # deepest [m]; top [m]

    def __init__(self, profile: SoundSpeedProfile, absorption: AbsorptionColumn | None, *, deepest: float,
                 top: float = 0.0):
        self.profile, self._column, self._deepest, self._top = profile, absorption, deepest, top

    @cached_property
    def layers(self) -> LayerTable:
        """Of the sound speed."""
        return layer_table(self.profile, mi.Float)

    @cached_property
    def absorption(self) -> Absorption | None:
        """Of sound; None where nothing is lost."""
        if self._column is None:
            return None
        return Absorption(self._column, self.profile, self._deepest, mi.Float, top=self._top)

    def loss_db(self, z0: mi.Float, z1: mi.Float, arc_length: mi.Float, ray_parameter: mi.Float) -> mi.Float:
        """Two-way absorption [dB] along rays between depths z0 and z1 [m], Float (R,)."""
        if self.absorption is None:
            return dr.zeros(mi.Float, dr.width(arc_length))
        return self.absorption.two_way_db(z0, z1, arc_length, ray_parameter)

    def at(self, depth: np.ndarray | float) -> SourceState:
        """What rays need to know of the depths (D,) [m] that they start from."""
        return source_state(self.layers, np.atleast_1d(np.asarray(depth, float)))


class DeviceWater:
    """All that the water does."""
    # deepest [m]

    def __init__(self, profile: SoundSpeedProfile, absorption: AbsorptionColumn | None = None,
                 volume: VolumeScattering | None = None, *, deepest: float = 0.0):
        self.profile = profile
        self._absorption, self._volume, self._deepest = absorption, volume, max(float(deepest), 1.0)

    @cached_property
    def direct(self) -> Medium:
        """The water as it is."""
        return Medium(self.profile, self._absorption, deepest=self._deepest)

    @cached_property
    def folded(self) -> Medium:
        """The water unfolded about the surface."""
        absorption = None if self._absorption is None else self._absorption.mirrored()
        return Medium(self.profile.mirrored(), absorption, deepest=self._deepest, top=-self._deepest)

    def medium(self, folded: bool = False) -> Medium:
        """The water that legs run through, straight ones or folded ones."""
        return self.folded if folded else self.direct

    def layers(self, folded: bool = False) -> LayerTable:
        """Sound speed by depth, of the water or of the water unfolded."""
        return self.medium(folded).layers

    def loss_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way, folded: bool = False) -> mi.Float:
        """Two-way absorption [dB], Float (R,), along ways between points, Array3f64 (R,) [m]."""
        # start, end (R,) [m]
        z0 = start.z if folded else -start.z
        return self.medium(folded).loss_db(mi.Float(z0), mi.Float(-end.z), way.arc_length, mi.Float(way.ray_parameter))

    def one_way_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way, folded: bool = False) -> mi.Float:
        """One-way absorption [dB], Float (R,), along ways between points; arguments as of `loss_db`."""
        return 0.5 * self.loss_db(start, end, way, folded)

    @property
    def slowest(self) -> float:
        """Sound speed [m/s]."""
        return float(np.min(self.profile.sound_speed))

    @property
    def fastest(self) -> float:
        """Sound speed [m/s]."""
        return float(np.max(self.profile.sound_speed))

    @property
    def scatters(self) -> bool:
        """Return whether the water itself sends something back."""
        return self._volume is not None

    @cached_property
    def volume(self) -> VolumeTable:
        """Strength of that by depth."""
        if self._volume is None:
            raise ValueError("this water sends nothing back; it was made without volume scattering")
        return volume_table(self._volume, mi.Float)
