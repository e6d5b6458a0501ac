"""Data of any run of a sonar over a scene."""
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsonar.echoes.paths import Paths
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Voyage
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.volume import VolumeScattering

from .voyage import Passage


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Scene, its water, and pings along a track."""

    geometry: Geometry
    profile: SoundSpeedProfile
    absorption: AbsorptionColumn  # at the sonar's frequency
    volume: VolumeScattering | None = None  # scattering of the water itself
    passage: Passage  # pings and their track
    rays: int  # per ping
    max_depth: int = 1  # largest number of bounces of an echo

    @property
    def voyage(self) -> Voyage:
        """Return the pings' track, and the trajectory it lies on."""
        return self.passage.voyage

    @property
    def depth_below(self) -> np.ndarray:
        """Return the depth of the seabed below the sonar (P,) [m]."""
        return self.passage.depth_below

    @property
    def track(self) -> Track:
        """Return the pings' track."""
        return self.voyage.track

    @cached_property
    def water(self) -> DeviceWater:
        """Return the water on the device, made once for all pings."""
        deepest = max(self.geometry.depth_range[1], -float(self.track.position[:, 2].min()))
        return DeviceWater(self.profile, self.absorption, self.volume, deepest=deepest)

    @cached_property
    def paths(self) -> Paths:
        """Return the paths with sums of their own."""
        return Paths(self.max_depth, surface=self.geometry.surface_label > 0, volume=self.volume is not None)

    @property
    def labels(self) -> dict[int, str]:
        """Return the names of labels by number: the scene's shapes."""
        return self.geometry.labels
