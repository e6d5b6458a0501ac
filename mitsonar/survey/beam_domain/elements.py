"""Signals of a single element, and of parts around its centre, from echoes in the beam domain.

An echo has the pattern of the whole element or of its parts, and at each part the delay of a plane wave: an element is
in its own far field at any distance.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.linalg import block_diag

from mitsonar.signal.beam_grid import ElementReceivers
from mitsonar.units import power_from_db

from ..pressure.array_survey import ArraySurvey
from .ping_echoes import GridEchoes


class ElementFrames:
    """Signals of a survey's only receiving element and, of a survey of its parts, of these, ping by ping."""

    def __init__(self, survey: ArraySurvey, parts: ArraySurvey | None = None):
        surveys = [survey] if parts is None else [survey, parts]
        place = np.concatenate([some.receive.position - some.receive.position.mean(0) for some in surveys])
        self._track, power = survey.track, power_from_db(survey.source_level_db)
        self._receivers = ElementReceivers(
            mi.Float, place=place, pulse=survey.pulse, samples=survey.samples, sampling_rate=survey.sampling_rate,
            lead=survey.lead, start=survey.start, sound_speed=survey.planned_speed,
            absorption_db=survey.waters.only.mean_absorption_db)
        noises = [some.noise.covariance / power for some in surveys if some.noise is not None]
        self._noise = block_diag(*noises) if noises else None

    def signals(self, ping: int, received: Sequence[GridEchoes], doppler: np.ndarray, key: int | None) -> np.ndarray:
        """Return the compressed signals (1 + parts, samples) for a source level of 0 dB; without a key, without noise.
        """
        # doppler (K,), as of `PingEchoes.doppler_classes`
        sums = self._receivers.sums(len(doppler))
        if received:
            column, sheet, real, imaginary = _joined(
                [(some.column, some.sheet, some.real, some.imaginary) for some in received])
            self._receivers.add(sums, range(1), column=column, sheet=sheet, real=real, imaginary=imaginary)
            parts = [some.parts for some in received if some.parts is not None]
            if parts:
                real, imaginary, *towards = _joined([(some.real, some.imaginary, *some.towards) for some in parts])
                self._receivers.add(sums, range(1, len(self._receivers.place)), column=column, sheet=sheet, real=real,
                                    imaginary=imaginary, towards=towards, rotation=self._track.rotation()[ping])
        return self._receivers.formed(sums, doppler, noise=None if key is None else self._noise, key=key or 0)


def _joined(records: list[tuple[Any, ...]]) -> list[Any]:
    """Return columns of records one after the other, numbers repeated."""
    counts = [max(dr.width(column) for column in record) for record in records]
    joined = [dr.empty(type(column), sum(counts)) for column in records[0]]
    for record, count, end in zip(records, counts, np.cumsum(counts)):
        # `drjit.concat` would compile a kernel for every number of echoes
        index = dr.arange(mi.UInt32, count) + dr.opaque(mi.UInt32, int(end) - count)
        for into, column in zip(joined, record):
            dr.scatter(into, column, index)
    return joined
