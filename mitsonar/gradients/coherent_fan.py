"""The linear way from signals of elements to the beams of a fan, and its transpose.

    p = B M D⁻¹ s,    s' = D⁻ᴴ Mᴴ Bᴴ p'

D -> the receivers' delays, which the beams undo; M -> the matched filter; B -> delay and sum at every range. Arrays are
those of the start: what is changed in elements later is an error that the beams do not know of.
"""
from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from ..imaging import fan
from ..signal.beamforming.transposed import delay_and_sum_transposed
from ..signal.matched_filter import matched_filter_transposed
from ..survey.array_survey import ArraySurvey
from .element_reception import delayed_transposed

__all__ = ["CoherentFan"]


class CoherentFan:
    """The beams of a ping as a function of the signals of its elements.

    Parameters
    ----------
    survey : ArraySurvey
        Its record leads by a pulse.
    direction : (B, 3)
        Of the beams, body frame.
    speed : float [m/s]
        That beams are formed with.

    Attributes
    ----------
    shape : (int, int)
        Beams and samples.
    """

    def __init__(self, survey: ArraySurvey, direction: np.ndarray, speed: float):
        self._survey, self._direction = survey, direction
        self.shape = len(direction), survey.samples - survey.lead
        receive = survey.receive
        places = {f"rx_{axis}": ("rx", column) for axis, column in zip("xyz", receive.position.T)}
        self._frame = xr.DataArray(
            np.zeros((1, 1, receive.elements, self.shape[1]), np.complex64), dims=("ping", "tx", "rx", "sample"),
            coords={"time": ("sample", survey.time[survey.lead:]), "rx_weight": ("rx", receive.weight),
                    "rx_delay": ("rx", receive.delay), **places},
            attrs={"frequency": survey.frequency, "sampling_rate": survey.sampling_rate, "sound_speed": speed})

    def beams(self, signals: np.ndarray) -> np.ndarray:
        """Give beams complex64 (B, S) [µPa] of signals (rx, S) [µPa]."""
        frame: Any = self._frame.copy(data=signals[None, None].astype(np.complex64))
        return fan.formed(frame, self._survey.pulse, self._direction)[0]

    def transposed(self, weights: np.ndarray) -> np.ndarray:
        """Give weights of signals (rx, S) of those of beams (B, S): the conjugate transpose."""
        survey, delay = self._survey, self._survey.receive.delay
        summed = delay_and_sum_transposed(self._frame, self._direction, weights[None])[0, 0]
        found = matched_filter_transposed(summed, survey.pulse, survey.sampling_rate)
        return delayed_transposed(found, -delay, survey.sampling_rate, survey.frequency) if delay.any() else found
