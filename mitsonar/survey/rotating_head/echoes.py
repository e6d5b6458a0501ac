"""Echoes around a rotating head: of scatterers thinned to its resolution, and of all that has a phase of its own.

    ground     scatterers with their legs and energies, and what hides them             `ground`
    others     point targets, smooth surfaces, a flat surface overhead                  `echoes.ensonification`

They are those of one place, whatever way the head looks: what its beam makes of them at every ping is `signals`.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import compressed
from ...echoes.ensonification import Ensonification
from ...echoes.record import Echoes
from ...echoes.thinned_scatterers import Density
from ...sonar.sidescan import Sidescan
from ..array_survey import ArraySurvey
from ..ground import FREE, Ground

__all__ = ["HeadEchoes", "StepEchoes"]



@dataclass(frozen=True, kw_only=True, eq=False)
class HeadEchoes:
    """Echoes of one place, as a head there hears them that stands still and looks everywhere alike.

    Attributes
    ----------
    sent, towards : Vector3f (R,)
        Unit, scene: where sound leaves for, and where its echo comes from.
    distance : Float (R,) [m]
        To where the echo comes from.
    delay : Float64 (R,) [s]
    real, imaginary : Float (R,)
        Complex amplitude for a source level of 0 dB, without the carrier's phase.
    """

    sent: mi.Vector3f
    towards: mi.Vector3f
    distance: mi.Float
    delay: mi.Float64
    real: mi.Float
    imaginary: mi.Float

    @property
    def count(self) -> int:
        """How many."""
        return dr.width(self.delay)


class StepEchoes:
    """Make the echoes around the places of a survey.

    Parameters
    ----------
    survey : ArraySurvey
        Of one transmit and one receive element at the head.
    face : Sidescan
        Of the head.
    per_cell : float [-]
        Scatterers a resolution cell.
    """

    def __init__(self, survey: ArraySurvey, face: Sidescan, *, per_cell: float):
        self._ground, self._per_cell = Ground(survey), float(per_cell)
        self._cell = 0.5 * face.sound_speed / survey.pulse.bandwidth, face.wavelength / face.longest

    @property
    def ensonification(self) -> Ensonification:
        """Makes what else there is."""
        return self._ground.ensonification

    def of_scatterers(self, origin: np.ndarray, axis: np.ndarray,
                      useful: Callable[[mi.Vector3f, mi.Float], mi.Bool]) -> HeadEchoes | None:
        """Give the echoes of the scatterers around a place; None where there is none.

        Parameters
        ----------
        origin : (3,) [m]
        axis : (3,)
            That the head turns about, scene coordinates.
        useful : callable(direction, distance) -> Bool
            Whether a scene direction is looked into at a distance [m].
        """
        lit = self._ground.lit(self._density(origin, axis), useful)
        if lit is None:
            return None
        root, (a, b), heard = dr.sqrt(lit.energy), lit.scatterers.amplitude, (lit.energy > 0) & (lit.state == FREE)
        towards, distance, delay = lit.legs.launch_direction, lit.legs.distance, 2 * lit.legs.travel_time
        real, imaginary = root * a, root * b
        dr.eval(heard, towards, distance, delay, real, imaginary)
        index = compressed(heard)
        if not dr.width(index):
            return None
        towards = dr.gather(mi.Vector3f, towards, index)
        return _evaluated(HeadEchoes(
            sent=towards, towards=towards, distance=dr.gather(mi.Float, distance, index),
            delay=dr.gather(mi.Float64, delay, index), real=dr.gather(mi.Float, real, index),
            imaginary=dr.gather(mi.Float, imaginary, index)))

    def mirrored(self, origin: np.ndarray, axis: np.ndarray,
                 useful: Callable[[mi.Vector3f, mi.Float], mi.Bool]) -> Iterator[HeadEchoes]:
        """Yield the echoes of the scatterers by way of a flat surface that mirrors; arguments as of `of_scatterers`."""
        for cells in self._ground.mirrored(self._density(origin, axis), useful):
            for echoes in self.ensonification.mirrored_echoes(origin, cells):
                yield _still(echoes)

    def _density(self, origin: np.ndarray, axis: np.ndarray) -> Density:
        """How densely a place needs scatterers."""
        return Density(origin=origin, axis=axis, per_cell=self._per_cell, range_cell=self._cell[0],
                       sine_cell=self._cell[1], nearest=self._ground.nearest, farthest=self._ground.farthest,
                       around=True)

    def coherent(self, origin: np.ndarray) -> Iterator[HeadEchoes]:
        """Yield the echoes that owe no phase to chance."""
        for _, echoes in self.ensonification.coherent_echoes(origin):
            yield _still(echoes)

    def by_chance(self, origin: np.ndarray, rotation: np.ndarray, depth_below: float,
                  key: int) -> Iterator[HeadEchoes]:
        """Yield the echoes of more bounces and of the water, drawn for one ping; `key` is that ping's."""
        for echoes in self.ensonification.random_echoes(origin, rotation, depth_below, key):
            yield _still(echoes)


def _still(echoes: Echoes) -> HeadEchoes:
    out, back = echoes.out, echoes.back
    count = echoes.count
    whole = dr.zeros(mi.Float, count)
    return _evaluated(HeadEchoes(
        sent=mi.Vector3f(out.sent_towards) + whole, towards=mi.Vector3f(back.sent_towards) + whole,
        distance=mi.Float(dr.norm(back.offset)) + whole, delay=echoes.arrival + back.travel_time + mi.Float64(whole),
        real=echoes.amplitude[0] + whole, imaginary=echoes.amplitude[1] + whole))


def _evaluated(echoes: HeadEchoes) -> HeadEchoes:
    dr.eval(*vars(echoes).values())
    return echoes
