"""Record pictures as an instrument writes them, and return to levels.

`PingRecorder` runs the chain of `recorder` over pictures of any kind of sonar, ping by ping: its variable ``recorded``
holds the counts. What is drawn at random belongs to a ping's number and the seed, so that one picture of many pings and
many pictures of one ping have the same counts.

    L = 10 log u² + A - G(R) - (gain of the row's sector),   u² = D⁻¹(C / (2^B - 1))

is the way back (`recorded_levels`), up to noise, stripes, low pass and steps. Symbols are those of `recorder`.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.chance import Salt, ping_key
from mitsonar.signal.gates import highest
from mitsonar.units import NOTHING_DB, db_from_power

from .gain import Tvg
from .recorder import Converter, Detector, Electronics, Recorder, TimeVariedGain, formed_rows, gains, interpolated

LOG2_10 = np.float32(np.log2(10))


class PingRecorder:
    """Recorder at work over the pings of a run, in their order."""

    def __init__(self, recorder: Recorder, seed: int, *, absorption_db: float = 0.0):
        """Start a run in water of an absorption [dB/m], which the gain makes up for unless it has one of its own."""
        gain = recorder.gain
        if gain.absorption_db is None:
            gain = replace(gain, absorption_db=absorption_db if gain.spreading else 0.0)
        self._recorder, self._seed = replace(recorder, gain=gain), seed
        self._detected: np.ndarray | None = None           # of the ping before, for the low pass along the track
        self._counts: np.ndarray | None = None             # of the ping before, for repeated ones

    def added(self, image: xr.Dataset) -> xr.Dataset:
        """Return a picture with the variable ``recorded`` over the dimensions of ``level``, and how to return.

        What a peak detector works on is ``peak_level``, where a picture has samples finer than its bins.
        """
        recorder = self._recorder
        dims = tuple(str(dim) for dim in image["level"].dims)
        level = (image["peak_level"].values if "peak_level" in image else
                 highest(image["level"].values, recorder.detector.peak))
        image = image.drop_vars("peak_level", errors="ignore")
        counts = self._run(level.reshape(len(level), -1, level.shape[-1]), image)
        about = {"units": "1", "long_name": "counts that the instrument writes"}
        back = {**asdict(recorder.converter), **asdict(recorder.gain), "law": recorder.detector.law,
                "range_db": recorder.detector.range_db}
        back = {name: (list(value) if isinstance(value, tuple) else None if value == np.inf else value)
                for name, value in back.items()}
        return image.assign(recorded=(dims, counts.reshape(level.shape), about)).assign_attrs(recorder=back)

    def _run(self, level: np.ndarray, image: xr.Dataset) -> np.ndarray:
        """Return the counts of levels (P, B, S)."""
        recorder = self._recorder
        converter, electronics = recorder.converter, recorder.electronics
        rows, samples = level.shape[1:]
        slant_range, time = (image[name].values.astype(float) for name in ("range", "time"))
        instrument = np.random.default_rng([recorder.serial, Salt.RECORDER])
        of_rows = gains(recorder.gain.of_rows(rows) + electronics.row_gain_db * instrument.standard_normal(rows))
        of_samples = gains(recorder.gain.over(slant_range) - converter.full_scale_db
                           + electronics.stripe_db * instrument.standard_normal(samples))
        formed = formed_rows(rows, recorder.interpolation)
        uneven = electronics.row_noise(rows, samples, instrument)
        uneven = None if uneven is None else uneven[formed]
        factor = of_rows[formed, None] * of_samples                                                     # (F, S)
        line = electronics.transmission(time).astype(np.float32)
        numbers, starts = np.atleast_1d(image["ping"].values), np.atleast_1d(image["ping_time"].values)
        counts = np.empty(level.shape, converter.dtype)
        for number, start, levels, into in zip(numbers, starts, level, counts, strict=True):
            random = np.random.default_rng([ping_key(self._seed, int(number)), Salt.RECORDER])
            fault, gain_db = random.random(), recorder.faults.gain_db * random.standard_normal()
            amplitude = np.exp2(levels[formed] * (LOG2_10 / 20)) * factor
            into[:] = self._ping(amplitude, formed, line, electronics.interfering(start + time), fault, gain_db, random,
                                uneven)
        return counts

    def _ping(self, amplitude: np.ndarray, formed: np.ndarray, line: np.ndarray, interference: np.ndarray,
              fault: float, gain_db: float, random: np.random.Generator, uneven: np.ndarray | None) -> np.ndarray:
        """Return the counts (B, S) of the amplitudes (F, S) of a ping's formed rows (F,).

        They are 1 at full scale, `fault` is uniform in [0, 1), and `uneven` (F, S) is a share of the rows' noise.
        """
        recorder = self._recorder
        faults = recorder.faults
        bright = faults.lost + faults.repeated <= fault < faults.lost + faults.repeated + faults.bright
        if gain_db or bright:
            amplitude *= gains([gain_db + faults.bright_db * bright])[0]
        power = _with_noise(recorder.electronics, np.nan_to_num(amplitude, copy=False), interference, random, uneven)
        detected = recorder.detector.smoothed(recorder.detector.detected(power + line))
        if (share := np.float32(recorder.detector.along_track)) and self._detected is not None:
            detected = (1 - share) * detected + share * self._detected
        self._detected = detected
        counts = recorder.converter.counts(interpolated(detected, formed), random)
        if fault < faults.lost:
            counts = np.zeros_like(counts)
        elif fault < faults.lost + faults.repeated and self._counts is not None:
            counts = self._counts
        self._counts = counts
        return counts


def recorded_levels(image: xr.Dataset) -> xr.DataArray:
    """Return the levels of a picture's counts, without the recorder's gain.

    Parameters
    ----------
    image : xarray.Dataset
        Picture with ``recorded``, of a sonar with a recorder.

    Returns
    -------
    xarray.DataArray
        Levels [dB re 1 µPa] over the dimensions of ``recorded``. Noise, stripes, crosstalk and the low pass stay in
        them, and those of a peak detector lie 2 to 3 dB above the mean echo of a bin. Counts of 0 have the level
        `units.NOTHING_DB`; where a count is the highest, the true level may be higher.

    Raises
    ------
    ValueError
        If the picture has no ``recorded``, because its sonar has no recorder.

    Examples
    --------
    ``mitsonar.imaging.recorded_levels(mitsonar.read("wreck.exr"))``
    """
    settings = settings_of(image)
    counts = image["recorded"]
    gain = _gain(settings).over(image["range"].values.astype(float))
    of_rows = _gain(settings).of_rows(counts.shape[1] if counts.ndim == 3 else 1)
    power = _power(counts.values, settings)
    level = db_from_power(power) + settings["full_scale_db"] - gain - (
        of_rows[:, None] if counts.ndim == 3 else of_rows)
    level = np.where(power > 0, level, NOTHING_DB).astype(np.float32)
    return xr.DataArray(level, dims=counts.dims, coords=counts.coords,
                        attrs={"units": "dB re 1 µPa", "long_name": "echo level of the counts"})


def as_recorded(image: xr.Dataset) -> xr.Dataset:
    """Return a picture whose ``level`` [dB] is that of its counts, with the instrument's own gain left in.

    Drawn without any other gain, it looks as the instrument's display does. The levels without noise are left out.

    Raises
    ------
    ValueError
        If the picture has no ``recorded``.
    """
    settings = settings_of(image)
    counts = image["recorded"]
    with np.errstate(divide="ignore"):
        level = np.maximum(db_from_power(_power(counts.values, settings)) + settings["full_scale_db"], NOTHING_DB)
    about = {"units": "dB re 1 µPa", "long_name": "recorded level, with the instrument's gain"}
    return image.drop_vars("mean_level", errors="ignore").assign(level=(counts.dims, level.astype(np.float32), about))


def shown(image: xr.Dataset, tvg: Tvg) -> tuple[xr.Dataset, Tvg]:
    """Return the picture to draw and the gain to draw it with: for the gain ``counts``, its counts as they are.

    Raises
    ------
    ValueError
        If counts are asked for and the picture has none.
    """
    return (as_recorded(image), None) if tvg == "counts" else (image, tvg)


def settings_of(image: xr.Dataset) -> Mapping[str, Any]:
    """Return the converter, gain and law of a picture's recorder; `ValueError` if the picture has no ``recorded``."""
    settings = image.attrs.get("recorder")
    if "recorded" not in image or not isinstance(settings, Mapping):
        raise ValueError("the picture holds no recorded counts, because its sonar has no recorder; give the sensor a "
                         "recorder, such as <string name=\"recorder\" value=\"sidescan_16bit\"/>, or take the levels.")
    return settings


def _power(counts: np.ndarray, settings: Mapping[str, Any]) -> np.ndarray:
    """Return the powers u² of counts, float64."""
    converter = Converter(bits=settings["bits"], full_scale_db=settings["full_scale_db"])
    detector = Detector(law=settings["law"], range_db=settings["range_db"])
    return detector.power(counts / converter.highest)


def _gain(settings: Mapping[str, Any]) -> TimeVariedGain:
    end = settings["end"]
    return TimeVariedGain(
        spreading=settings["spreading"], absorption_db=settings["absorption_db"], start=settings["start"],
        end=np.inf if end is None else end, step_db=settings["step_db"], sectors_db=tuple(settings["sectors_db"]))


def _with_noise(electronics: Electronics, amplitude: np.ndarray, interference: np.ndarray,
                random: np.random.Generator, uneven: np.ndarray | None) -> np.ndarray:
    """Return the powers (B, S) of amplitudes with the noise of rows, crosstalk, and what all rows have in common."""
    common = np.sqrt(0.5 * (electronics.common_noise + interference)).astype(np.float32)                # (S,)
    own = np.full(amplitude.shape[1], electronics.noise, np.float32)
    if uneven is not None:
        own = own * uneven
    if electronics.crosstalk:
        own = own + np.float32(electronics.crosstalk) * np.mean(amplitude ** 2, 0)
    real, imaginary = amplitude, None
    for noise, rows in ((common, 1), (np.sqrt(np.float32(0.5) * own), len(amplitude))):
        if noise.any():
            drawn = random.standard_normal((2, rows, amplitude.shape[1]), np.float32)
            drawn *= noise
            real, imaginary = real + drawn[0], drawn[1] if imaginary is None else imaginary + drawn[1]
    return real * real if imaginary is None else real * real + imaginary * imaginary
