"""Sonar film (`sonar_film`): the recorded time window of a ping, and its bins.

For an array, ``bins`` or ``sample_rate_khz`` set the sampling of the complex signals. The default rate is 1.5 times the
rate that the pulse needs for its bandwidth, 2 / duration and Doppler. The usual number of bins of a sidescan is too
small for a fan of beams: leave it out there. The least accepted rate is 0.9 times the bandwidth of the pulse, as in
instruments whose samples are as long as their range resolution. Below 1.25 times the bandwidth the receiver's filter
cuts off the ends of the band: at a rate equal to the bandwidth, the range resolution is a seventh coarser and the bed's
level 0.5 dB higher.

.. code-block:: xml

    <film type="sonar_film"><float name="range" value="75"/><integer name="bins" value="1000"/></film>
"""
import os
from typing import Any, NoReturn

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.turns import at_least_two_threads
from mitsonar.units import hertz_from_khz

from ..attributes import Attributes, Integer, Number

FARTHEST = 100_000               # [m]
MOST_BINS = 1_000_000

ATTRIBUTES = (
    Number("range", default=100.0, above=0, maximum=FARTHEST, unit="m",
           text="end of the slant range window, at the sonar's sound speed when the scene is loaded"),
    Number("range_min", default=0.0, minimum=0, unit="m", text="beginning of the window"),
    Integer("bins", default=800, minimum=1, maximum=MOST_BINS,
            text="number of time bins in the window; or write `sample_rate_khz`"),
    Number("sample_rate_khz", default=None, above=0, unit="kHz", text="sampling rate"),
)


class SonarFilm(mi.Film):
    """Recorded time window and its bins."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)         # Mitsuba's own of films have no meaning here and are refused
        self.range, self.range_min = attributes.range, attributes.range_min
        self._bins, self._bins_written = attributes.bins, bool(attributes.given("bins"))
        rate_khz = attributes.sample_rate_khz
        self._sample_rate = None if rate_khz is None else float(hertz_from_khz(rate_khz))
        if self._sample_rate is not None and self._bins_written:
            raise attributes.error("bins and sample_rate_khz are both given; give one of them.")
        if self.range_min >= self.range:
            raise attributes.error(f"range_min is {self.range_min} m, not below range {self.range} m; lower it.")
        props["width"], props["height"] = self._bins, 1
        super().__init__(props)
        self.image = None

    @property
    def written(self) -> tuple[str, float]:
        """Return the attribute that sets the sampling, and its value."""
        return ("bins", self._bins) if self._sample_rate is None else ("sample_rate_khz", self._sample_rate / 1000)

    def window(self, sound_speed: float) -> tuple[tuple[float, float], int]:
        """Return the two-way time window (start, end) [s] and number of bins, at the sonar's sound speed [m/s]."""
        start, end = 2 * self.range_min / sound_speed, 2 * self.range / sound_speed
        if self._sample_rate is None:
            return (start, end), self._bins
        bins = max(1, np.ceil((end - start) * self._sample_rate))
        if bins > MOST_BINS:
            raise ValueError(f"sonar_film: sample_rate_khz is {self._sample_rate / 1000:g}, which makes {bins:.3g} "
                             f"bins of the range; lower it, a film has at most {MOST_BINS}")
        return (start, start + bins / self._sample_rate), int(bins)

    def sampling(self, sound_speed: float, usual_rate: float, *, written: bool = True) -> tuple[float, float, int]:
        """Return the start of the record [s], the sampling rate [Hz] and the number of samples."""
        # sound_speed [m/s]; usual_rate [Hz]
        (start, end), bins = self.window(sound_speed)
        rate = usual_rate
        if written and (self._sample_rate or self._bins_written):
            rate = self._sample_rate or bins / (end - start)
        samples = int(np.ceil((end - start) * rate - 1e-6))
        if samples > MOST_BINS:
            raise ValueError(f"sonar_film: {rate / 1000:g} kHz over {end - start:.3g} s makes {samples} samples; a "
                             f"film has at most {MOST_BINS}: lower sample_rate_khz or the range")
        return start, rate, max(samples, 1)

    # ---- what Mitsuba asks of a film; the picture itself is put here by `sonar_path`
    def base_channels_count(self) -> int:
        return 1

    def prepare(self, aovs: list[str]) -> int:
        self.image = None
        return 1

    def clear(self) -> None:
        self.image = None

    def put(self, image: mi.TensorXf) -> None:
        """Keep the rendered levels, a tensor (pings, columns, 1)."""
        self.image = image

    def create_block(self, *_: Any, **__: Any) -> NoReturn:
        raise ValueError("a sonar_film records sound; render it with the integrator sonar_path")

    def develop(self, raw: bool = False) -> mi.TensorXf:
        if self.image is None:
            raise ValueError("sonar_film holds no image yet; render the scene first")
        return self.image

    def bitmap(self, raw: bool = False) -> mi.Bitmap:
        return mi.Bitmap(self.develop(raw), mi.Bitmap.PixelFormat.Y)

    def write(self, path: str | os.PathLike) -> None:
        with at_least_two_threads():
            self.bitmap().write(str(path))

    def schedule_storage(self) -> None:
        if self.image is not None:
            dr.schedule(self.image)

    def to_string(self) -> str:
        return f"SonarFilm[{self.range_min}..{self.range} m]"


mi.register_film("sonar_film", SonarFilm)
