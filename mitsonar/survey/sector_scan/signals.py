"""Signals of a rotating head, ping by ping: every echo with the beam of its transmission and of its own reception.

    y_p(t) = Σ_j a_j b_t(n_j) b_r(n'_jp) e^{-i2πf τ_jp} δ(t - τ_jp)  ─→  pulse, receiver, matched filter, noise

a_j -> echoes around the head (`beam_domain.ping_echoes`); n_j -> direction of departure; n'_jp and τ_jp -> direction
and time of reception, after the head has moved and turned.

A platform that stands still has the same echoes at every ping: they are made once, and pings take those in their beam.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import compressed
from mitsonar.device.chance import Salt, ping_key, salted
from mitsonar.device.rotations import rotation_matrix
from mitsonar.imaging.sector_scan import mean_power
from mitsonar.sonar.motion.rotating_head import HeadTrajectory
from mitsonar.sonar.motion.stepping import SteppedPing
from mitsonar.sonar.motion.trajectory import Voyage
from mitsonar.units import power_from_db

from ..beam_domain.elements import ElementFrames
from ..beam_domain.ground import FREE
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.placed_echoes import PlacedEchoes
from ..pressure.array_survey import ArraySurvey
from ..survey import PerSurroundings

STILL = 1e-9                       # [m], [-]: nothing moves
FAINTEST = 1e-6                    # two-way intensity of the beam below which a scatterer is left out


class StepSignals:
    """Compressed signals of a survey's pings."""

    def __init__(self, survey: ArraySurvey):
        receive = survey.receive
        frame = _frames(survey.planned)
        self._fixed = not survey.world.moves and all(
            float(np.ptp(part, axis=0).max()) < STILL for part in (survey.planned.track.position, frame))
        self._survey = survey
        self._kept: dict[tuple[int, bool], list[PlacedEchoes]] = {}
        self._kept_at: SteppedPing | None = None
        line = LineArray.of_element(receive)
        axes = _Axes(survey, frame[:, :, 2])
        self._echoes = PerSurroundings(survey, lambda part: PingEchoes(
            part, line, per_cell=part.per_cell, negligible=FAINTEST,
            turning=(axes, part.wavelength / receive.length)))
        self._frames = PerSurroundings(survey, ElementFrames)

    def power(self, bins: int, seed: int | None, progress: Callable[[float, float], None] | None = None) -> np.ndarray:
        """Return the mean power of all pings over bins, (P, bins) [µPa²].

        A `seed` draws scatterers, other random echoes and noise. With None there are only coherent echoes.
        """
        total, rows = self._survey.track.pings, []
        for ping in range(total):
            rows.append(self.of(ping, bins, seed))
            if progress is not None:               # echoes of large smooth surfaces take minutes a ping
                progress(ping + 1, total)
        return np.stack(rows)

    def of(self, ping: int, bins: int, seed: int | None) -> np.ndarray:
        """Return the mean power of one ping over bins, (bins,) [µPa²]; `seed` as of `power`."""
        echoes = self._echoes.at(ping)
        received = [echoes.received(ping, placed) for placed in self._received(ping, seed)]
        key = None if seed is None else salted(ping_key(seed, ping), Salt.BEAM_NOISE)
        signal = self._frames.at(ping).signals(ping, received, echoes.doppler_classes(ping), key)
        return mean_power(signal[0], bins) * power_from_db(self._survey.source_level_db)

    def _stands(self) -> bool:
        """Return True if the platform stands still, so that its echoes are kept; forget those of another place."""
        latest = self._survey.passage.latest
        if latest is None or latest.row is not None and self._fixed:
            stands = self._fixed
        else:
            stands = not (self._survey.velocity[-1].any() or latest.turn_rate)
        known = self._kept_at
        if latest is not None and (known is None or not all(np.array_equal(getattr(latest.track, name), getattr(
                known.track, name)) for name in ("position", "roll", "pitch", "heading"))):
            self._kept.clear()
            self._kept_at = latest
        return stands

    def _received(self, ping: int, seed: int | None) -> Iterator[PlacedEchoes]:
        """Yield the echoes that the head receives of a ping."""
        if not self._stands():
            yield from self._around(ping, seed is not None)
        else:
            which = self._survey.surroundings_of(ping), seed is None
            around = self._kept.get(which)
            if around is None:
                for other in [key for key in self._kept if key[0] != which[0]]:
                    del self._kept[other]              # of another water
                around = self._kept[which] = [*self._around(ping, seed is not None, everywhere=True)]
                dr.eval([vars(some) for some in around])
            useful = self._echoes.at(ping).useful(ping, FAINTEST)
            for some in around:
                wanted = useful(some.sent, some.out_distance)
                if some.towards is not some.sent:  # sent by a side lobe, an echo may come back by the main lobe
                    wanted |= useful(some.towards, some.back_distance)
                yield from _those(some, wanted)
        if seed is not None:
            yield from self._echoes.at(ping).by_chance(ping, seed)

    def _around(self, ping: int, by_chance: bool, everywhere: bool = False) -> Iterator[PlacedEchoes]:
        """Yield echoes around the place of a ping: of scatterers, in its beam or everywhere, and coherent echoes."""
        if by_chance:
            scatterers = self._echoes.at(ping).scatterers(ping, everywhere)
            if scatterers is not None:
                dr.eval(vars(scatterers))
                yield from _those(scatterers, (scatterers.energy > 0) & (scatterers.state == FREE))
            yield from self._echoes.at(ping).mirrored(ping, everywhere)
        for _, echoes in self._echoes.at(ping).targets(ping):
            yield echoes


def _frames(voyage: Voyage) -> np.ndarray:
    """Return the frames (P, 3, 3) in which a head turns; columns: bearing 0, aside, and the axis it turns about."""
    trajectory = voyage.trajectory
    if not isinstance(trajectory, HeadTrajectory):
        raise ValueError("a sector scan needs the voyage of a rotating head; make the survey by the sensor's own plan")
    attitude = trajectory.platform.pose(voyage.track.time)[1]
    return rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ trajectory.head.mounted


class _Axes:
    """Axes (3,) that a head turns about, by the number of a ping."""

    def __init__(self, survey: ArraySurvey, planned: np.ndarray):
        self._survey, self._planned = survey, planned

    def __getitem__(self, ping: int) -> np.ndarray:
        if self._survey.passage.latest is None:
            return self._planned[ping]
        return _frames(self._survey.voyage.single)[0, :, 2]


def _those(placed: PlacedEchoes, wanted: mi.Bool) -> Iterator[PlacedEchoes]:
    """Yield the wanted echoes, evaluated, if there are any."""
    index = compressed(wanted)
    if dr.width(index):
        some = placed.chosen(index)
        dr.eval(vars(some))
        yield some
