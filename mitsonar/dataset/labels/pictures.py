"""Levels as pictures of 8 bits: a gain over range that makes an even seabed look even, black and white in dB.

    grey = 255 (level + gain - low) / (high - low), cut off at 0 and 255

Black and white are found where there is a bed to be shown: where its mean level says so, else from its first return on;
in a focused image where something is seen. Its levels are strengths, to which no gain is added.
"""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.imaging.focused import bin_dims, is_focused
from mitsonar.imaging.gain import Tvg, display_gain
from mitsonar.plots.images.gain import display_window
from mitsonar.units import HARDLY_DB

from .frames import CartesianFrame, LabelFrame

UNIT = "dB re 1 µPa"               # of a level that does not say
SILENCE_DB = -1000.0               # stands for it in means of powers
HALF = 0.5                         # share of the pings
MOST_LOOKED_AT = 8                 # Cartesian frames in which black and white are looked for


@dataclass(frozen=True, kw_only=True)
class Greys:
    """The levels of a record, ready to be drawn."""

    level: np.ndarray  # with the gain, over the dimensions of the record's bins [dB]
    window: tuple[float, float]  # [dB]: black and white
    words: str  # what was added to the level, for people
    unit: str = UNIT  # of the level

    def draw(self, frame: LabelFrame) -> np.ndarray:
        """Draw one picture of the record: uint8 (height, width), 0 also where no echo arrives."""
        return _scaled(frame.levels(self.level), self.window)


def grey(dataset: xr.Dataset, *, tvg: Tvg = "seabed",
         window: tuple[float, float] | None = None) -> tuple[np.ndarray, tuple[float, float], str]:
    """Turn the levels of a dataset to grey, bin by bin."""
    # window [dB] -> window [dB]
    found = greys(dataset, [], tvg=tvg, window=window)
    return _scaled(found.level, found.window), found.window, found.words


def greys(dataset: xr.Dataset, frames: Sequence[LabelFrame], *, tvg: Tvg = "seabed",
          window: tuple[float, float] | None = None) -> Greys:
    """Prepare the pictures of a dataset, all with the same black and white."""
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


def write_png(image: np.ndarray, path: FilePath) -> None:
    """Write a picture (H, W) of uint8 or uint16 as PNG."""
    # image (H, W)
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(image)).save(path, format="PNG")


def _scaled(level, window):
    low, high = window
    scaled = np.where(level > HARDLY_DB, 255 * (level - low) / (high - low), 0)           # NaN is not above
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)


def _gain(dataset, tvg):
    """The gain over range and its words; nothing where levels are strengths already."""
    if not is_focused(dataset):
        return display_gain(dataset, tvg)
    if tvg not in (None, "seabed"):
        raise ValueError(f"the gain {tvg!r} is of echoes, and levels of a focused image are strengths of what lies "
                         "there; leave the gain out.")
    return np.zeros((1, 1)), ""


def _bed(dataset, shown):
    """The bins in which black and white are looked for."""
    echoes = shown > HARDLY_DB
    bed = echoes
    if is_focused(dataset):
        if "shadow" in dataset:
            bed = echoes & ~(dataset["shadow"].transpose(*bin_dims(dataset)).values > HALF)
        return bed if bed.any() else echoes
    if "mean_level" in dataset:
        bed = echoes & (dataset["mean_level"].values > HARDLY_DB)
    if "seabed_depth" in dataset and not {"side", "mean_level"} <= {*dataset.dims, *dataset.data_vars}:
        # beams and rows hear noise and side lobes, not nothing, until the bed's first return
        seen = np.isfinite(dataset["seabed_depth"].transpose(*dataset["level"].dims).values)
        bed = bed & np.logical_or.accumulate(seen, -1)
    return bed if bed.any() else echoes
