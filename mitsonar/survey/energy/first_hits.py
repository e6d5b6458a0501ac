"""Echoes that the rows of an energy record receive from the first hits of rays.

The computation has no loop on the device, so gradients pass through it where hits carry them (`gradients`).
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi

from mitsonar.echoes.sonar_equation import echo_energy, speed_ratio
from mitsonar.scene.materials import scattering_strength
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.water import Way

from ..motion.places import Place
from ..motion.underway import PingReception
from .rows import Rays, RowResponse, Rows


@dataclass(frozen=True, kw_only=True)
class HitEchoes:
    """Echoes of rays."""

    units: mi.Float64  # (R,): energy, in units of the bins
    delay: mi.Float64  # (R,) [s]: from transmission to reception
    response: RowResponse
    bin: mi.UInt32  # (R,)
    active: mi.Bool  # (R,): True for echoes that count


class Losses(Protocol):
    """Absorption along ways, as `DeviceWater` computes it."""

    def loss_db(self, start: dr.ArrayBase, end: dr.ArrayBase, way: Way) -> mi.Float:
        """Return two-way absorption [dB], Float (R,), along ways between points, Array3f64 (R,) [m]."""
        ...


class FirstHits:
    """Echoes of first hits; `binning` replaces `EnergyBins.of` of the rows."""

    def __init__(self, rows: Rows, water: Losses,
                 binning: Callable[[mi.Float64, mi.Bool], tuple[mi.UInt32, mi.Bool]] | None = None, *,
                 smooth_patches: bool = False):
        self._rows, self._water, self._smooth_patches = rows, water, smooth_patches
        self._binning = rows.bins.of if binning is None else binning

    def echoes(self, place: Place, rays: Rays, hits: Hits) -> HitEchoes:
        """Return the echoes of hits, as the rows receive them."""
        bins, reception = self._rows.bins, received(place, rays, hits)
        response = self._rows.response(place, rays, reception.towards)
        bin, inside = self._binning(reception.delay, hits.valid & response.active)
        strength, sin_grazing = scattering_strength(hits, inside, self._rows.frequency,
                                                     smooth_patches=self._smooth_patches)
        _, speed = place.medium(rays.ping)
        units, loss = bins.worth(bin, inside, self._water.loss_db(place.origin(rays.ping), hits.point, hits))
        energy = echo_energy(solid_angle=rays.solid_angle, pattern=response.pattern, strength=strength,
                             sin_grazing=sin_grazing, spreading_area=hits.spreading_area,
                             speed_ratio=speed_ratio(hits.sound_speed, speed), loss=loss)
        return HitEchoes(units=mi.Float64(energy) * mi.Float64(units), delay=reception.delay, response=response,
                         bin=bin, active=inside & dr.isfinite(energy))


def received(place: Place, rays: Rays, hits: Hits) -> PingReception:
    """Return the times and directions in which the echoes of hits come back."""
    return place.receive(rays.ping, rays.direction, hits.point - place.origin(rays.ping), 2 * hits.travel_time)
