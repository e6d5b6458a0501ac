"""Sea surface with waves: where its mesh stands at a ping, and how its water moves.

The mesh has the long waves of `water.sea_waves`. A vertex that rests at x stands at x + D(x, t + t1) as the sound of a
ping meets it, t1 = |x - P_0| <1/c> after the transmission at t from P_0; towards the edge of the waves D falls smoothly
to 0, or they would end in a cliff. Points of a facet go with its corners. What
scatters there moves with the water, whose velocity at a point is that of the corners of its cell, between which it is
linear.

A surface without wind is a mirror: flat, but lifted by the height η of the waves where sound meets it. By way of it, a
leg is longer by

    2 η sin θ,      θ -> grazing angle at the surface

so that the mean pressure of an echo falls by exp(-2 (k h sin θ)²) for each leg, h² -> variance of η (Eckart 1953, J.
Acoust. Soc. Am. 25, 566). That the mirror is tilted and curved is left out: it holds for waves much longer than the
first Fresnel zone.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.sea_waves import SeaWaves

from .protocols import is_sea_surface

TURN = 2 * np.pi
FADING = 16                        # squares over which the waves end before the level border
STEEP = 4.0                        # standard deviations of slope that no facet's stretch exceeds


@runtime_checkable
class WavySurface(Protocol):
    """Sea surface that may have waves."""

    waves: SeaWaves | None
    nodes: np.ndarray  # (K,) [m]: of x and of y, rising; evenly apart but for a border
    border: int  # nodes at either end that stay level
    rest: np.ndarray  # (K², 3) [m]: vertices of the level surface

    def id(self) -> str:
        """Return the name of the shape."""
        ...


def wavy_surface(shape: mi.Shape | None) -> WavySurface | None:
    """Return a sea surface that has waves; None for other shapes."""
    return shape if is_sea_surface(shape) and isinstance(shape, WavySurface) and shape.waves is not None else None


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaStand:
    """Surface as the sound of a ping meets it."""

    nodes: np.ndarray  # (K,) [m]
    border: int
    vertices: np.ndarray  # (K, K, 3) [m]: by y and x
    moved: np.ndarray  # (K, K, 3) [m]: D of them
    velocity: np.ndarray  # (K, K, 3) [m/s]

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Return points (N, 3) [m] of the level surface on the facets of the moved one."""
        corner, weight = self._facet(points)
        return np.einsum("nc,nci->ni", weight, corner)

    def turned(self, directions: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return vertical directions (N, 3) at points of the level surface as normals of the moved one, grown as it is.
        """
        corner, _ = self._facet(points)
        side = [np.diff(self.nodes)[self._cells(points[:, axis])[0]] for axis in (0, 1)]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        return normal * (directions[:, 2:] / (side[0] * side[1])[:, None])

    def fastest(self, points: np.ndarray) -> float:
        """Return the largest speed of any point [m/s]."""
        return float(np.linalg.norm(self.velocity, axis=-1).max())

    def _facet(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners (N, 3, 3) of the facets that level points lie on, counter-clockwise, and weights (N, 3).
        """
        (column, u), (row, v) = self._cells(points[:, 0]), self._cells(points[:, 1])
        far = (u + v > 1).astype(int)          # each cell is (here, east, north) and (across, north, east)
        corner = np.stack([self.vertices[row + far, column + far],
                           self.vertices[row + far, column + 1 - far],
                           self.vertices[row + 1 - far, column + far]], 1)
        u, v = np.where(far, 1 - u, u), np.where(far, 1 - v, v)
        return corner, np.stack([1 - u - v, u, v], 1)

    def _cells(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers of the cells along an axis that places (N,) lie in, and the shares of the way through."""
        at = np.clip(np.searchsorted(self.nodes, place, side="right") - 1, 0, len(self.nodes) - 2)
        return at, (place - self.nodes[at]) / (self.nodes[at + 1] - self.nodes[at])


class DeviceWaves:
    """Waves on the device, at the time of a transmission and after it."""

    def __init__(self, waves: SeaWaves):
        self._waves, self._lib = waves, arrays_of(mi.Float)
        self._table, self._count = mi.Float64(), dr.opaque(mi.UInt32, len(waves.amplitude))
        self.at(0.0)

    def at(self, time: float) -> None:
        """Take the time of the transmission [s]."""
        waves = self._waves
        table = np.zeros((len(waves.amplitude), 8))
        table[:, :2], table[:, 2] = waves.vector, waves.rate
        table[:, 3] = np.mod(waves.phase - waves.rate * time, TURN)
        table[:, 4], table[:, 5:7] = waves.amplitude, waves.vector / waves.wavenumber[:, None]
        self._table = upload(mi.Float64, table)

    def displaced(self, x: mi.Float64, y: mi.Float64, later: mi.Float64) -> tuple[mi.Vector3f, mi.Vector3f]:
        """Return displacements [m] and velocities [m/s] (R,) of water at rest at x, y [m], `later` [s]."""
        moved, velocity = _displaced(self._lib, self._table, self._count, x, y, later)
        return moved, velocity

    def height(self, x: mi.Float64, y: mi.Float64, later: mi.Float64) -> mi.Float:
        """Return heights (R,) [m] of the surface, to first order in its slope."""
        return self.displaced(x, y, later)[0].z


@dr.syntax
def _displaced(lib, table, count, x, y, later):
    """Return D and its rate."""
    number = dr.zeros(lib.UInt32, dr.width(x))
    moved, velocity = dr.zeros(mi.Vector3f, dr.width(x)), dr.zeros(mi.Vector3f, dr.width(x))
    while number < count:
        a = dr.gather(lib.Array4f64, table, 2 * number)
        b = dr.gather(lib.Array4f64, table, 2 * number + 1)
        turns = dr.fma(a[0], x, dr.fma(a[1], y, dr.fma(-a[2], later, a[3]))) * float(1 / TURN)      # ψ_j
        sine, cosine = dr.sincos(lib.Float(turns - dr.round(turns)) * float(TURN))
        amplitude, rate = lib.Float(b[0]), lib.Float(a[2])
        towards = mi.Vector3f(lib.Float(b[1]), lib.Float(b[2]), 0)
        up = mi.Vector3f(0, 0, 1)
        moved += amplitude * (cosine * up - sine * towards)
        velocity += amplitude * rate * (cosine * towards + sine * up)
        number += 1
    return moved, velocity


class Sea:
    """Waves of a scene's sea surface: a mesh that moves, or a mirror that is lifted."""

    def __init__(self, shape: WavySurface, label: int, *, mirrors: bool):
        if shape.waves is None:
            raise ValueError("this surface has no waves")
        self.waves, self.label, self._nodes = shape.waves, label, shape.nodes
        self._inner = (slice(shape.border, -shape.border),) * 2
        self.mirrors = mirrors
        self.device = DeviceWaves(shape.waves)
        self._rest = shape.rest.reshape(len(shape.nodes), len(shape.nodes), 3)
        inner = self._rest[self._inner].reshape(-1, 3)
        self._x, self._y = upload(mi.Float64, inner[:, 0]), upload(mi.Float64, inner[:, 1])
        nodes = shape.nodes[self._inner[0]]
        self._fading = FADING * float(nodes[1] - nodes[0])                     # [m]
        share = np.clip((nodes[-1] - abs(nodes)) / self._fading, 0, 1)
        share = share * share * (3 - 2 * share)
        self._strength = (share[:, None] * share)[..., None]                   # of D

    @property
    def half(self) -> float:
        """Return half of the side of the square that has waves [m]; inf of a mirror."""
        return np.inf if self.mirrors else float(-self._nodes[self._inner[0]][0])

    @property
    def stretch(self) -> float:
        """Return the length of a moved facet over that at rest, at most."""
        return 1 + STEEP * self.waves.slope_variance**0.5 + self.waves.crest / self._fading

    def stand(self, time: float, sonar: np.ndarray, profile: SoundSpeedProfile) -> SeaStand | None:
        """Return the mesh as sound meets it that leaves a sonar (3,) [m] at a time [s]; None of a mirror."""
        self.device.at(time)
        if self.mirrors:
            return None
        slowness = float(np.mean(1 / profile.at(np.linspace(0, max(-sonar[2], 0.0), 17))))
        # opaque, or every ping would compile a kernel of its own
        x0, y0, z0, per_metre = (dr.opaque(mi.Float64, float(value)) for value in (*sonar, slowness))
        x, y = self._x - x0, self._y - y0
        moved, velocity = self.device.displaced(self._x, self._y, dr.sqrt(x * x + y * y + z0 * z0) * per_metre)
        dr.eval(moved, velocity)
        ways, speeds = np.zeros_like(self._rest), np.zeros_like(self._rest)
        for table, values in ((ways, moved), (speeds, velocity)):
            inner = table[self._inner]
            inner[:] = values.numpy().T.reshape(inner.shape) * self._strength
        return SeaStand(nodes=self._nodes, border=self._inner[0].start, vertices=self._rest + ways, moved=ways,
                        velocity=speeds)

    def check(self, places: np.ndarray, first: int = 0) -> None:
        """Raise `ValueError` if a sonar leaves the waves, at places (P, 2) [m] of pings from `first` on."""
        away = abs(places).max(1)
        if away.max() > self.half:
            ping = int(np.argmax(away > self.half))
            x, y = places[ping]
            raise ValueError(f"the waves of the sea surface reach {self.half:.4g} m from the origin to each side, and "
                             f"the sonar is at x = {x:.4g}, y = {y:.4g} m at ping {first + ping}; give sea_surface a "
                             f"size of {2.2 * away.max():.0f} m or more")
