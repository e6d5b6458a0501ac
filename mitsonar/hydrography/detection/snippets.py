"""Compute snippets: the bed's backscattering strength, sample by sample about each detection.

The equations of `bottom_backscatter` hold with range, loss and area at each sample's own time. A snippet lasts as long
as the echo of the beam's footprint, so that snippets of neighbouring beams meet on the bed.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bottom_backscatter import ensonified_area, strength_db

__all__ = ["Snippets", "snippets"]


@dataclass(frozen=True, kw_only=True)
class Snippets:
    """Snippets of B beams, N samples each.

    Attributes
    ----------
    start : float (B,) [s]
        Time of the first sample after the transmission, NaN where nothing was detected.
    strength_db : float (B, N) [dB re 1]
        Backscattering strength, NaN past the footprint and the record's ends, and where nothing was detected.
    """

    start: np.ndarray
    strength_db: np.ndarray


def snippets(halves: tuple[np.ndarray, np.ndarray], *, time: np.ndarray, detected: np.ndarray, begin: np.ndarray,
             end: np.ndarray, samples: int, incidence: np.ndarray, slant_range: np.ndarray, loss_db: np.ndarray,
             pulse_length: float | np.ndarray, transmit_width: float | np.ndarray, receive_width: float | np.ndarray,
             sound_speed: float | np.ndarray, source_level_db: float | np.ndarray, absorption_db: float,
             transmit_pattern_db: float | np.ndarray = 0.0, receive_pattern_db: float | np.ndarray = 0.0) -> Snippets:
    """Return the snippets of a ping.

    Parameters
    ----------
    halves : complex (B, T), complex (B, T) [µPa]
        Compressed beams of the port and of the starboard half.
    time : float (T,) [s]
        Times of the samples after the transmission.
    detected : float (B,) [s]
        Times of `Detections`, NaN where nothing was detected.
    begin, end : int (B,)
        Samples of the footprint, from `Detections`.
    samples : int
        Number of samples of every snippet. Of a longer footprint, the middle samples are taken.
    incidence : float (B,) [rad]
        Incidence on the bed across the track.
    slant_range : float (B,) [m]
        Range of the detections. The range of a sample is proportional to its time.
    loss_db : float (B,) [dB]
        Two-way transmission loss of the detections.
    pulse_length, transmit_width, receive_width, sound_speed
        Arguments of `ensonified_area`.
    source_level_db : float or (B,) [dB re 1 µPa @ 1 m]
    absorption_db : float [dB/m]
        Absorption between the range of the detection and that of a sample.
    transmit_pattern_db, receive_pattern_db : float or (B,) [dB]
        Patterns of both arrays towards the detections.

    Returns
    -------
    Snippets
    """
    found = np.isfinite(detected)
    at = np.where(found, detected, time[0])
    step = time[1] - time[0]
    length = np.minimum(end - begin, samples)
    first = np.clip(np.rint((at - time[0]) / step).astype(np.int64) - length // 2, 0, len(time) - 1)
    place = first[:, None] + np.arange(samples)
    inside = found[:, None] & (np.arange(samples) < length[:, None]) & (place < len(time))
    place = np.minimum(place, len(time) - 1)
    rows = np.arange(len(at))[:, None]
    whole = (halves[0][rows, place].astype(complex) + halves[1][rows, place]) / 2
    nearer = np.maximum(time[place], step) / np.maximum(at, step)[:, None]
    distance = np.asarray(slant_range)[:, None] * nearer
    loss = np.asarray(loss_db)[:, None] + 40 * np.log10(nearer) + 2 * absorption_db * (
        distance - np.asarray(slant_range)[:, None])
    area = ensonified_area(distance, np.asarray(incidence)[:, None], pulse_length=_column(pulse_length),
                           transmit_width=_column(transmit_width), receive_width=_column(receive_width),
                           sound_speed=_column(sound_speed), away=time[place] - at[:, None])
    strength = strength_db(np.abs(whole) ** 2, source_level_db=_column(source_level_db), loss_db=loss, area=area,
                           transmit_pattern_db=_column(transmit_pattern_db),
                           receive_pattern_db=_column(receive_pattern_db))
    return Snippets(start=np.where(found, time[first], np.nan),
                    strength_db=np.where(inside, strength, np.nan).astype(np.float32))


def _column(values: float | np.ndarray) -> np.ndarray:
    return np.reshape(np.asarray(values, float), (-1, 1))
