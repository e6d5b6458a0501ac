"""A source of rays at one ping: its place, its motion, and the water around it.

A leg by way of the flat surface is unfolded: the platform becomes its image above the surface, in water mirrored there.
`View` is either the platform or its image, so that the code that follows serves both.
"""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.device.types import Float, Float64, Triple
from mitsonar.echoes.record import Echoes, EchoLeg
from mitsonar.echoes.scatterers.element_beams import pressure
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.propagation.device_rays.two_point import SourceState
from mitsonar.propagation.returns.return_paths import ReturnPaths, return_paths
from mitsonar.propagation.returns.travel import REST, Travel
from mitsonar.scene.tracing.water import DeviceWater, Medium
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.motion.trajectory import PingTravel
from mitsonar.water.profile import SoundSpeedProfile

Method: TypeAlias = Literal["vector", "paper"]
UPSIDE_DOWN = np.diag([1.0, 1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Platform and water as a leg needs them: as they are, or mirrored at the surface."""

    medium: Medium  # the water, or the water unfolded about the surface
    state: SourceState  # at the depth of the source
    depth: float  # [m], of the source
    position: np.ndarray  # (3,) [m], of the source, body frame
    rotation: np.ndarray  # (3, 3), body to scene
    travel: Travel  # of the source since the ping, of opaque Float64
    tilt: float  # [rad], largest change of roll and pitch while echoes arrive
    climb: float  # [m/s], largest vertical speed while echoes arrive

    @property
    def layers(self) -> LayerTable:
        """Return the layers of the water."""
        return self.medium.layers

    @property
    def profile(self) -> SoundSpeedProfile:
        """Return the sound speed profile of the water."""
        return self.medium.profile

    @classmethod
    def of(cls, travel: PingTravel, medium: Medium, depth: float, position: np.ndarray, rotation: np.ndarray,
           mirror: np.ndarray = np.ones(3)) -> View:
        """Return the view of a source that travels during a ping; `mirror` (3,): diagonal of the mirror matrix."""
        # a rotation vector is axial: its image has the other sign, except along the mirror's normal
        axial = mirror * np.prod(mirror)
        d, r = travel.displacement[0] * mirror, travel.turn[0] * axial
        on_device = Travel.within(d, r, travel.duration, lambda number: dr.opaque(mi.Float64, float(number)))
        return cls(medium=medium, state=medium.at(depth), depth=depth, position=position, rotation=rotation,
                   travel=on_device, tilt=float(np.linalg.norm(travel.reach(travel.turn)[:2])),
                   climb=float(travel.reach(travel.displacement, 1)[2]))

    def offsets(self, array: Array) -> np.ndarray:
        """Return the places of elements relative to the source at the transmission: (E, 3) [m], scene coordinates."""
        return (array.position - self.position) @ self.rotation.T

    def pattern(self, array: Array, element: int, direction: Triple, wavelength: float) -> Float:
        """Return the pressure pattern of an element towards unit vectors, at the attitude of the transmission."""
        return pressure(array, [mi.Float(part) for part in direction], wavelength,
                        self.rotation @ array.normal[element], self.rotation @ array.along[element])

    def carried(self, leg: EchoLeg, method: Method, travel: Travel, elapsed: Float64,
                later: float = 0.0) -> ReturnPaths:
        """Return the paths of echoes along a leg back to the moving source; arguments as of `return_paths`."""
        only_source = arrays_of(mi.Float).UInt32(0)
        return return_paths(self.layers, self.state, only_source, leg.offset, leg.travel_time, leg.ray_parameter,
                            leg.spreading_area, -leg.launch_direction.z, travel=travel, method=method,
                            elapsed=elapsed, slope=leg.slope, later=dr.opaque(mi.Float64, later) if later else None)


class PingSource:
    """A source of rays at one ping."""
    # position (3,) [m], body frame; centre, origin (3,) [m], scene; rotation (3, 3); speed [m/s], of sound

    def __init__(self, *, position: np.ndarray, centre: np.ndarray, rotation: np.ndarray, travel: PingTravel,
                 water: DeviceWater):
        self.position, self.rotation, self.travel, self._water = position, rotation, travel, water
        self.origin = centre + rotation @ position
        self.depth = -float(self.origin[2])
        self.speed = float(water.profile.at(self.depth))

    @cached_property
    def direct(self) -> View:
        """Return the platform and the water as they are."""
        return View.of(self.travel, self._water.direct, self.depth, self.position, self.rotation)

    @cached_property
    def mirrored(self) -> View:
        """Return the image of platform and water above the surface."""
        return View.of(self.travel, self._water.folded, -self.depth, self.position, UPSIDE_DOWN @ self.rotation,
                       mirror=np.diag(UPSIDE_DOWN))

    def view(self, leg: EchoLeg) -> View:
        """Return the view for a leg."""
        return self.mirrored if leg.folded else self.direct

    def way_back(self, echoes: Echoes, method: Method = "vector", met: Float64 | None = None,
                 later: float = 0.0) -> ReturnPaths:
        """Return the paths back to the source at its place then; echoes leave at `met` [s], else `Echoes.arrival`.

        With `later` [s], see `return_paths`.
        """
        view = self.view(echoes.back)
        return view.carried(echoes.back, method, view.travel, echoes.arrival if met is None else met, later)

    def way_out(self, echoes: Echoes) -> ReturnPaths:
        """Return the ways out, reversed: from the first scatterer to the array at the transmission."""
        return self.view(echoes.out).carried(echoes.out, "vector", REST, echoes.out.travel_time)


def opaque(kind: type, vector: Iterable[float]) -> list:
    """Return the components of a vector as opaque numbers, which may change without a new kernel."""
    return [dr.opaque(kind, float(component)) for component in vector]


def opaque64(vector: Iterable[float]) -> tuple[Float64, ...]:
    """Return the components of a vector as opaque Float64."""
    return tuple(opaque(mi.Float64, vector))
