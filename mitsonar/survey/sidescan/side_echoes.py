"""Echoes of a sidescan that no first hit brings: of more bounces than one, and of the water itself.

    p² = 10^(SL/10) B_t B_r e²

B_t and B_r are the intensity patterns of the faces, towards where sound leaves and where it comes back from, and e² is
the rest of the echo: see `echoes.multipath` and `echoes.volume`.
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi

from mitsonar.device.chance import Salt, seeded
from mitsonar.echoes.bounces.ghosts import Ghosts
from mitsonar.echoes.bounces.multipath import Bounces
from mitsonar.echoes.bounces.volume import WaterEchoes
from mitsonar.echoes.sums.energy_sums import EchoSums
from mitsonar.scene.tracing.hits import Hits

from ..energy.energy_bins import EnergyBins
from ..energy.sound_paths import SoundPaths
from ..motion.places import Place
from .face_beams import FaceBeams
from .side_launch import SideLaunch, SideRays
from .sidescan_survey import SidescanSurvey

__all__ = ["SideMultipath", "SideWater"]

FEWER_POINTS = 4                   # of the water than rays: there is no shape to resolve


class SideMultipath:
    """Echoes of more than one bounce, from rays of their own; those of point targets from the rays of a pass.

    Sound leaves for one end of such a path and comes back from the other. Either end is seen by one face, whose beam is
    wider than the two-way beam that the rays of a pass are drawn for. Of those rays the few between would bring most.

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
        self._launch, self._tracer = launch, sound.tracer
        self._beams, self._bins, self._seed, self._paths = beams, bins, seed, survey.paths
        self._bounces = Bounces(sound.connector, sound.free_rays, frequency=survey.sonar.frequency, paths=survey.paths)

    def add(self, place: Place, rays: SideRays, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of several bounces to the sums; `rays` and `hits` are those of a pass."""
        key = seeded(place.key(rays.row), self._seed, Salt.BOUNCES)
        if self._bounces.targets:
            # small things near a bed want rays that are dense on it, as those of a pass are
            followed = self._bounces.follow(hits, rays.solid_angle, place.sources, place.origin(rays.ping),
                                            place.source(rays.ping), rays.strata, key, surfaces=False)
            self._add(place, rays, followed, sums)
        own = self._launch.one_way(place, rays, self._seed)
        origin, source = place.origin(own.ping), place.source(own.ping)
        met = self._tracer.trace(place.sources, origin, source, own.direction)
        seen = self._seen(place, own)
        dr.eval(met, seen)
        key = seeded(place.key(own.row), self._seed, Salt.BOUNCES)
        self._add(place, own, self._bounces.follow(met, own.solid_angle, place.sources, origin, source, own.strata, key,
                                                   seen, targets=False), sums)

    def _add(self, place: Place, rays: SideRays, followed: Iterator[Ghosts], sums: EchoSums) -> None:
        """Add ghosts of rays as the faces send and receive them."""
        for ghosts in followed:
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

    def _seen(self, place: Place, rays: SideRays) -> mi.Float:
        """The mean intensity of both faces towards rays."""
        body = place.body(rays.ping, rays.direction)
        return 0.5 * (self._beams.one_way(body, self._beams.transmit) + self._beams.one_way(body, self._beams.receive))


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
