"""Echoes of a sidescan that no first hit brings: of more bounces than one, and of the water itself.

    p² = 10^(SL/10) B_t B_r e²

B_t and B_r are the intensity patterns of the faces, towards where sound leaves and where it comes back from, and e² is
the rest of the echo: see `echoes.multipath` and `echoes.volume`.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..device.chance import Salt, seeded
from ..echoes.energy_sums import EchoSums
from ..echoes.multipath import Bounces
from ..echoes.volume import WaterEchoes
from ..tracing.hits import Hits
from .energy_bins import EnergyBins
from .face_beams import FaceBeams
from .places import Place
from .side_launch import SideLaunch, SideRays
from .sidescan_survey import SidescanSurvey
from .sound_paths import SoundPaths

__all__ = ["SideMultipath", "SideWater"]

FEWER_POINTS = 4                   # of the water than rays: there is no shape to resolve


class SideMultipath:
    """Echoes of more than one bounce, which go on from what rays hit first.

    Parameters
    ----------
    survey : SidescanSurvey
    sound : SoundPaths
    beams : FaceBeams
    bins : EnergyBins
    seed : int
    """

    def __init__(self, survey: SidescanSurvey, sound: SoundPaths, beams: FaceBeams, bins: EnergyBins, seed: int):
        self._beams, self._bins, self._seed, self._paths = beams, bins, seed, survey.paths
        self._bounces = Bounces(sound.connector, sound.free_rays, frequency=survey.sonar.frequency, paths=survey.paths)

    def add(self, place: Place, rays: SideRays, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of a pass of rays to the sums."""
        origin, source = place.origin(rays.ping), place.source(rays.ping)
        key = seeded(place.key(rays.row), self._seed, Salt.BOUNCES)
        for ghosts in self._bounces.follow(hits, rays.solid_angle, place.sources, origin, source, rays.strata, key):
            elapsed = ghosts.out.travel_time + ghosts.between + ghosts.back.travel_time
            received = place.receive(rays.ping, ghosts.back.sent_towards, ghosts.back.offset, elapsed)
            bin, inside = self._bins.of(received.delay, ghosts.active)
            pattern = mi.Float(1)
            for towards, face in ((ghosts.out.sent_towards, self._beams.transmit),
                                  (received.towards, self._beams.receive)):
                body = place.body(rays.ping, towards)
                inside &= body.y * rays.side > 0
                pattern *= self._beams.one_way(body, face)
            sums.add(row=rays.row, label=ghosts.label, bin=bin, active=inside, in_beam=mi.Bool(False), counted=False,
                     units=self._bins.units(ghosts.energy * pattern, ghosts.loss_db, bin, inside), depth=ghosts.depth,
                     path=self._paths.numbers(ghosts.code))


class SideWater:
    """Echoes of the water, from points along rays of their own.

    Parameters
    ----------
    survey : SidescanSurvey
    sound : SoundPaths
    beams : FaceBeams
    bins : EnergyBins
    launch : SideLaunch
    seed : int
    """

    def __init__(self, survey: SidescanSurvey, sound: SoundPaths, beams: FaceBeams, bins: EnergyBins,
                 launch: SideLaunch, seed: int):
        self._beams, self._bins, self._launch, self._seed = beams, bins, launch, seed
        self._echoes = WaterEchoes(sound.connector, survey.window)
        self._label = dr.opaque(mi.UInt32, max(survey.labels))
        self._path = dr.opaque(mi.UInt32, survey.paths.number("v"))

    def add(self, place: Place, rays: SideRays, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of points, a fourth as many as a pass has rays."""
        phi, u = rays.strata.shape
        rays, chance = self._launch.across_beam(place, (max(4, phi // (4 * FEWER_POINTS) * 4), u), self._seed)
        origin = place.origin(rays.ping)
        drawn = self._echoes.draw(place.sources, origin, place.source(rays.ping), rays.direction, rays.solid_angle,
                                  rays.strata, chance)
        sent = place.body(rays.ping, drawn.way.launch_direction)
        received = place.receive(rays.ping, drawn.way.launch_direction, drawn.point - origin,
                                 2 * drawn.way.travel_time)
        back = sent if place.still else place.body(rays.ping, received.towards)
        along, across = self._beams.two_way(sent.x, self._beams.across(sent), back.x, self._beams.across(back))
        bin, inside = self._bins.of(received.delay, drawn.active & (back.y * rays.side > 0))
        sums.add(row=rays.row, label=self._label, bin=bin, active=inside, in_beam=mi.Bool(False), counted=False,
                 units=self._bins.units(drawn.energy * along * across, drawn.loss_db, bin, inside),
                 depth=mi.Float(-drawn.point.z), path=self._path)
