"""Levels as 8-bit pictures, with a gain that makes an even seabed look even.

    grey = 255 (level + gain - low) / (high - low), cut off at 0 and 255

The window low to high is chosen from bins that show the bed: by the mean level if known, else from the first return on,
and in a focused image outside shadows. The levels of a focused image are strengths, to which no gain is added.
"""
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.imaging.focused import bin_dims, is_focused
from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.imaging.recorder import Detector
from mitsonar.imaging.recording import as_recorded, settings_of, shown as shown_picture
from mitsonar.plots.images.gain import display_window
from mitsonar.units import HARDLY_DB, power_from_db

from .frames import CartesianFrame, LabelFrame

UNIT = "dB re 1 µPa"               # of a level without units
WHITE, GREY_BITS = 255, 8          # of a picture; counts of at most so many bits are grey values as they are
SILENCE_DB = -1000.0               # [dB]: replaces absent echoes in means of powers
HALF = 0.5                         # share of the pings
MOST_LOOKED_AT = 8                 # Cartesian frames used to choose the window


@dataclass(frozen=True, kw_only=True)
class Greys:
    """Levels of a record, ready for drawing."""

    level: np.ndarray  # [dB]: with gain, over the dimensions of the record's bins
    window: tuple[float, float]  # [dB]: black and white
    words: str  # formula of the level with gain
    unit: str = UNIT  # of the level
    detector: Detector | None = None  # of pictures of counts, whose full scale is white; else grey follows the level

    def draw(self, frame: LabelFrame) -> np.ndarray:
        """Return a picture of the record: uint8 (height, width), 0 also without an echo."""
        return self.shaded(frame.levels(self.level))

    def shaded(self, level: np.ndarray) -> np.ndarray:
        """Return the grey values of levels with gain [dB], uint8."""
        if self.detector is None:
            return _scaled(level, self.window)
        power = np.where(level > HARDLY_DB, power_from_db(level - self.window[1]), 0)
        return np.rint(WHITE * np.minimum(self.detector.detected(power), 1)).astype(np.uint8)


def grey(dataset: xr.Dataset, *, tvg: Tvg = "seabed",
         window: tuple[float, float] | None = None) -> tuple[np.ndarray, tuple[float, float], str]:
    """Return the grey values of all bins of a dataset, the window [dB], and the formula of the level."""
    shades = greys(dataset, [], tvg=tvg, window=window)
    return shades.shaded(shades.level), shades.window, shades.words


def greys(dataset: xr.Dataset, frames: Sequence[LabelFrame], *, tvg: Tvg = "seabed",
          window: tuple[float, float] | None = None) -> Greys:
    """Return the levels of a dataset for drawing, with one window [dB] for all pictures."""
    if tvg == "counts" and window is None and (settings := settings_of(dataset))["bits"] <= GREY_BITS:
        detector = Detector(law=settings["law"], range_db=settings["range_db"])
        full = float(settings["full_scale_db"])
        level = as_recorded(dataset)["level"].values.astype(float)
        return Greys(level=np.where(level > HARDLY_DB, level, SILENCE_DB), window=(full - 20 * np.log10(WHITE), full),
                     words="count", unit="1", detector=detector)
    dataset, tvg = shown_picture(dataset, tvg)
    level = dataset["level"].isel(bank=0, missing_dims="ignore").values.astype(float)
    gain, words = _gain(dataset, tvg)
    shown = np.where(level > HARDLY_DB, level + gain.reshape(len(gain), *[1] * (level.ndim - 2), -1), SILENCE_DB)
    if window is None:
        bed = _bed(dataset, shown)
        looked_at = [frame for frame in frames if isinstance(frame, CartesianFrame)]
        looked_at = looked_at[::-(-len(looked_at) // MOST_LOOKED_AT) or 1]
        if looked_at:
            window = display_window(np.concatenate([frame.levels(shown)[frame.lay(bed)] for frame in looked_at]))
        else:
            window = display_window(shown[bed])
    low, high = window
    if not low < high:
        raise ValueError(f"black is {low:g} dB and white {high:g} dB; white must be above black.")
    return Greys(level=shown, window=(float(low), float(high)), words=f"level{words}",
                 unit=str(dataset["level"].attrs.get("units") or UNIT))


def write_png(image: np.ndarray, path: FilePath | BytesIO) -> None:
    """Write a picture (H, W) of uint8 or uint16 as PNG."""
    from PIL import Image

    # run lengths suit both: speckle has no other repetition, masks have little else
    Image.fromarray(np.ascontiguousarray(image)).save(path, format="PNG", compress_type=zlib.Z_RLE)


def _scaled(level, window):
    low, high = window
    scaled = np.where(level > HARDLY_DB, 255 * (level - low) / (high - low), 0)           # NaN becomes 0
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)


def _gain(dataset, tvg):
    """Return the gain and its formula; 0 for focused images, whose levels are strengths."""
    if not is_focused(dataset):
        return display_gain(dataset, tvg)
    if tvg not in (None, "seabed"):
        raise ValueError(f"the gain {tvg!r} applies to echoes, but the levels of a focused image are strengths; leave "
                         "the gain out.")
    return np.zeros((1, 1)), ""


def _bed(dataset, shown):
    """Return a mask of the bins that determine black and white."""
    echoes = shown > HARDLY_DB
    bed = echoes
    if is_focused(dataset):
        if "shadow" in dataset:
            bed = echoes & ~(dataset["shadow"].transpose(*bin_dims(dataset)).values > HALF)
        return bed if bed.any() else echoes
    if "mean_level" in dataset:
        bed = echoes & (dataset["mean_level"].values > HARDLY_DB)
    if "seabed_depth" in dataset and not {"side", "mean_level"} <= {*dataset.dims, *dataset.data_vars}:
        # before the bed's first return, beams and rows receive noise and side lobes
        seen = np.isfinite(dataset["seabed_depth"].transpose(*dataset["level"].dims).values)
        bed = bed & np.logical_or.accumulate(seen, -1)
    return bed if bed.any() else echoes
