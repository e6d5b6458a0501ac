"""Hold the data of any run of a sonar over a scene."""
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
    """Hold a scene, its water, and pings along a track."""

    geometry: Geometry
    profile: SoundSpeedProfile
    absorption: AbsorptionColumn  # at the sonar's frequency
    volume: VolumeScattering | None = None  # what the water itself sends back
    passage: Passage  # the pings and the track they lie on
    rays: int  # per ping
    max_depth: int = 1  # bounces that an echo may have made

    @property
    def voyage(self) -> Voyage:
        """Return the pings' track, and the trajectory it lies on."""
        return self.passage.voyage

    @property
    def depth_below(self) -> np.ndarray:
        """Return seabed below the sonar (P,) [m]."""
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
        """Return the paths that are told apart."""
        return Paths(self.max_depth, surface=self.geometry.surface_label > 0, volume=self.volume is not None)

    @property
    def labels(self) -> dict[int, str]:
        """Return number → what it stands for: the scene's shapes."""
        return self.geometry.labels
