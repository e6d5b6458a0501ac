"""Sonar film (`sonar_film`): the window of time a ping is recorded in, and its bins.

- ``range`` [m, 100], ``range_min`` [m, 0]: slant range window, at the sonar's own sound speed.
- ``bins`` [800] or ``sample_rate_khz``: number of equal time bins, or how many a millisecond. The signals of an array
  are complex samples; without either they come at 1.5 times what the pulse needs,
  its bandwidth and 2 / duration, and the Doppler shift.

.. code-block:: xml

    <film type="sonar_film"><float name="range" value="75"/><integer name="bins" value="1000"/></film>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.plugins.attributes import Attributes
from mitsonar.units import hertz_from_khz

FARTHEST = 100_000               # [m]
MOST_BINS = 1_000_000


class SonarFilm(mi.Film):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        self.range = attributes.number("range", 100.0, above=0, maximum=FARTHEST, unit="m")
        self.range_min = attributes.number("range_min", 0.0, minimum=0, unit="m")
        sample_rate_khz = attributes.number("sample_rate_khz", None, above=0, unit="kHz")
        if sample_rate_khz is not None and attributes.given("bins"):
            raise attributes.error("bins and sample_rate_khz are both given; give one of them.")
        self._bins = attributes.integer("bins", 800, minimum=1, maximum=MOST_BINS)
        self._bins_written = bool(attributes.given("bins"))
        self._sample_rate = None if sample_rate_khz is None else float(hertz_from_khz(sample_rate_khz))
        if self.range_min >= self.range:
            raise attributes.error(f"range_min is {self.range_min} m, not below range {self.range} m; lower it.")
        # Mitsuba's own film attributes have no meaning here and are refused with the rest
        attributes.finish()
        props["width"], props["height"] = self._bins, 1
        super().__init__(props)
        self.image = None

    def window(self, sound_speed):
        """Two-way time window (start, end) [s] and number of bins, at the sonar's sound speed [m/s].

        Raises
        ------
        ValueError
            If the sample rate makes more bins than a film may have.
        """
        start, end = 2 * self.range_min / sound_speed, 2 * self.range / sound_speed
        if self._sample_rate is None:
            return (start, end), self._bins
        bins = max(1, np.ceil((end - start) * self._sample_rate))
        if bins > MOST_BINS:
            raise ValueError(f"sonar_film: sample_rate_khz is {self._sample_rate / 1000:g}, which makes {bins:.3g} "
                             f"bins of the range; lower it, a film has at most {MOST_BINS}")
        return (start, start + bins / self._sample_rate), int(bins)

    def sampling(self, sound_speed, usual_rate, *, written=True):
        """Start of the record [s], sampling rate [Hz] and number of samples, at the sonar's sound speed [m/s].

        Parameters
        ----------
        sound_speed : float [m/s]
        usual_rate : float [Hz]
            Taken where the scene writes neither bins nor a rate, or these are not to count.
        written : bool
            Whether what the scene writes counts.

        Raises
        ------
        ValueError
            If that makes more samples than a film may have.
        """
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
    def base_channels_count(self):
        return 1

    def prepare(self, aovs):
        self.image = None
        return 1

    def clear(self):
        self.image = None

    def put(self, image):
        """Keep the rendered levels, a tensor (pings, columns, 1)."""
        self.image = image

    def create_block(self, *_, **__):
        raise ValueError("a sonar_film records sound; render it with the integrator sonar_path")

    def develop(self, raw=False):
        if self.image is None:
            raise ValueError("sonar_film holds no image yet; render the scene first")
        return self.image

    def bitmap(self, raw=False):
        return mi.Bitmap(self.develop(raw), mi.Bitmap.PixelFormat.Y)

    def write(self, path):
        self.bitmap().write(str(path))

    def schedule_storage(self):
        if self.image is not None:
            dr.schedule(self.image)

    def to_string(self):
        return f"SonarFilm[{self.range_min}..{self.range} m]"


mi.register_film("sonar_film", SonarFilm)
