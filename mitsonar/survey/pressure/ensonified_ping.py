"""One ping of an array: its sources of rays, and the echoes of the scatterers that each of them ensonifies.

Scatterers have phases of their own, so their echoes are the same for every transmit element that a source represents.
Echoes of the water and of paths with more bounces are drawn at random, all from the array's centre, so that they too
are the same for all transmit elements.

A ping at exactly the same place and attitude as the ping before ensonifies the same scatterers, so it reuses their
echoes. A moving platform reuses nothing: it moves by many wavelengths between pings, and the visibility of cells, which
would still hold, is only a quarter of the work.
"""
from collections.abc import Iterator

import numpy as np

from mitsonar.device.chance import ping_key
from mitsonar.device.progress import Share, nobody
from mitsonar.echoes.bounces.fan_rays import FanRays
from mitsonar.echoes.ensonification import Ensonification
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.signal.doppler import glide_of
from mitsonar.signal.impulses import MARGIN, BandLimited

from ..energy.phased_echoes import band_of
from .array_survey import ArraySurvey
from .ping_source import PingSource

WATER = 0.18                       # points of the water per scatterer in a resolution cell of the ground
BAND = 0.75                        # c / 2B of two thirds of the sampling rate
KEPT_ECHOES = 1 << 22              # largest number that is kept for the next transmit element; more are computed again
BY_CHANCE = -1                     # number of the source of random echoes


def ensonification_of(survey: ArraySurvey, scatterers: Scatterers | None = None) -> Ensonification:
    """Return the ensonification of the scatterers, or of given ones, of a survey within one ping's surroundings."""
    end, (geometry, water) = float(survey.time[-1]), survey.surroundings
    moved, turned = (rate * end for rate in survey.planned_rates)
    return Ensonification(
        scatterers or Scatterers(geometry, survey.cell_size, survey.pass_number, survey.world.seed), water,
        frequency=survey.frequency,
        window=(survey.start, end), margin=survey.radius + survey.receive.radius + moved,
        method=survey.ensonification, rays=survey.rays,
        beams=ElementBeams(survey.transmit, survey.receive, survey.wavelength, turned), max_depth=survey.max_depth,
        thin_below=survey.thin_below, band=band_of(survey.pulse),
        resolution=BAND * survey.planned_speed / survey.sampling_rate, spread=arrival_spread(survey, water.slowest),
        fan=_fan(survey) if water.scatters else None)


def _fan(survey: ArraySurvey) -> FanRays | None:
    """Return the directions of points of the water, about one in each of the array's cells of range and sine.

    None for a single element.
    """
    receive, start, end = survey.receive, survey.start, float(survey.time[-1])
    place = receive.position - receive.position.mean(0)
    axis = np.linalg.svd(place, full_matrices=False)[2][0]
    length = float(np.ptp(place @ axis)) / survey.wavelength
    if not length:
        return None
    cells = (end - start) * survey.pulse.bandwidth * 2 * (length + 0.5)
    return FanRays(axis, receive.normal.mean(0), number=WATER * survey.per_cell * cells, least=survey.rays,
                   window=(0.5 * survey.planned_speed * start, 0.5 * survey.planned_speed * end))


def arrival_spread(survey: ArraySurvey, slowest: float) -> float:
    """Return the largest time [s] between an echo at an element and one at a source at rest; inf if objects move.

    Elements lie off the source, receivers move until the echo arrives, and transmit elements have delays. Doppler
    shifts a sweep in time, too. The last term is the width of the sums' kernel.
    """
    # slowest [m/s]
    if survey.world.moves:
        return np.inf
    transmit, receive, pulse, (speed, turn) = survey.transmit, survey.receive, survey.pulse, survey.planned_rates
    apart = transmit.radius + receive.radius + 2 * np.linalg.norm(survey.sources.position, axis=1).max()
    delay = np.abs(transmit.delay).max()
    if survey.steering is not None:
        delay += 2 * transmit.radius / slowest             # at most, whatever the direction
    glide = glide_of(pulse)
    sent = pulse.duration + (abs(glide.frequency / glide.rate) if glide is not None and glide.rate else 0.0)
    moved = 2 * (speed + turn * survey.radius) * (survey.time[-1] + sent)
    return float((apart + moved) / slowest + delay + (MARGIN + BandLimited.taps) / survey.sampling_rate)


class EnsonifiedPing:
    """Echoes of a ping, kept for the next transmit element unless they are too many."""

    def __init__(self, survey: ArraySurvey, ensonification: Ensonification, ping: int, seed: int,
                 before: "EnsonifiedPing | None" = None):
        self.survey, self.ensonification, self.ping, self.seed = survey, ensonification, int(ping), int(seed)
        self._rotation = survey.track.rotation()[ping]
        self._sources: dict[int, PingSource] = {}
        self._kept: dict[int, list[Echoes]] = {}
        if before is not None and self._stands_as(before):
            self._kept = {number: blocks for number, blocks in before._kept.items() if number != BY_CHANCE}

    def _stands_as(self, other: "EnsonifiedPing") -> bool:
        """Return True if pose and water are those of another ping, and scatterers are found without random rays."""
        track = self.survey.track
        return (self.survey.ensonification == "scatterers" and not self.survey.world.moves
                and self.ensonification.tracer is other.ensonification.tracer
                and np.array_equal(self._rotation, other._rotation)
                and np.array_equal(track.position[self.ping], track.position[other.ping]))

    def shares(self, element: int) -> list[tuple[int, float]]:
        """Return the numbers of the sources that represent a transmit element, each with its share."""
        share = self.survey.sources.share[:, element]
        return [*((int(number), float(share[number])) for number in np.flatnonzero(share)), (BY_CHANCE, 1.0)]

    def source(self, number: int) -> PingSource:
        """Return a source by its number."""
        if number not in self._sources:
            position = np.zeros(3) if number == BY_CHANCE else self.survey.sources.position[number]
            self._sources[number] = PingSource(
                position=position, centre=self.survey.track.position[self.ping], rotation=self._rotation,
                travel=self.survey.travel(self.ping, position), water=self.ensonification.water)
        return self._sources[number]

    def echoes(self, number: int, progress: Share = nobody) -> Iterator[Echoes]:
        """Yield the echoes from a source in blocks."""
        if number in self._kept:
            yield from self._kept[number]
            return
        if self.survey.world.moves:
            self.survey.world.at(self.ping)
        room = KEPT_ECHOES - sum(block.count for blocks in self._kept.values() for block in blocks)
        kept = []
        for block in self._made(number, progress):
            room -= block.count
            kept = kept + [block] if kept is not None and room >= 0 else None
            yield block
        if kept is not None:
            self._kept[number] = kept

    def _made(self, number: int, progress: Share) -> Iterator[Echoes]:
        """Return an iterator over newly computed echoes from a source."""
        source = self.source(number)
        key = ping_key(self.seed, self.ping, max(number, 0))
        below = float(self.survey.depth_below[self.ping])
        if number == BY_CHANCE:
            return self.ensonification.random_echoes(source.origin, source.rotation, below, key)
        return self.ensonification.scatterer_echoes(source.origin, source.rotation, below, key, progress=progress)
