"""Pictures of recorded sidescans: 20 log10 of the samples as ``level``, with the coordinates that plots need."""
import numpy as np
import xarray as xr

from ..records.records import SonarImage

METRES_PER_DEGREE = 111_195.0
MOST_BITS = 60                     # of a weight
NOTHING = 0.5                      # of a step: what a sample of 0 stands for


def as_image(record: xr.Dataset) -> SonarImage:
    """Return a recorded sidescan as an image, to be drawn without a gain since its recorder has applied one.

    Parameters
    ----------
    record : xarray.Dataset
        As `sidescan_lines.read` returns it. Pings whose range differs from the others are moved to the common ranges.

    Returns
    -------
    xarray.Dataset
        ``level`` (ping, side, range) [dB re 1 step of the recorder], NaN where a ping has no sample.
    """
    samples, middle = record.sizes["sample"], record["range"].values
    weight = record["weight"].values[..., None]
    amplitude = np.maximum(record["amplitude"].values.astype(np.float32), NOTHING) * np.exp2(
        np.clip(-weight, -MOST_BITS, MOST_BITS)).astype(np.float32)
    level = 20 * np.log10(amplitude)
    count, end = record["samples"].values, record["slant_range"].values
    travel = record["sample_start"].values + count * record["sample_interval"].values
    begin = end * record["sample_start"].values / np.where(travel > 0, travel, np.inf)
    common = np.median(end[np.isfinite(end)]) if np.isfinite(end).any() else np.nan
    # a range that is not known is taken to be the common one
    for ping, side in zip(*np.nonzero((count != samples) | (np.abs(end - common) > 0.01 * common)), strict=True):
        number, step = int(count[ping, side]), (end[ping, side] - begin[ping, side]) / max(count[ping, side], 1)
        at = np.floor((middle - begin[ping, side]) / step) if step > 0 else np.full(samples, -1.0)
        inside = (at >= 0) & (at < number)
        level[ping, side] = np.where(inside, level[ping, side, np.where(inside, at, 0).astype(int)], np.nan)
    return SonarImage.of(xr.Dataset(
        {"level": (("ping", "side", "range"), level, {"units": "dB re 1 step", "long_name": "samples as recorded"})},
        coords={"ping": record["ping"].values, "side": record["side"].values, "range": middle,
                "ping_time": ("ping", record["ping_time"].values), **_places(record),
                "altitude": ("ping", record["altitude"].values)},
        attrs={"sonar": "sidescan", "frequency": record.attrs.get("frequency"), "source": record.attrs.get("source")}))


def _places(record):
    """Return x and y [m] of the pings from the first, if all are known."""
    names = ("longitude", "latitude") if "longitude" in record else ("x", "y")
    x, y = (record[name].values - record[name].values[:1] for name in names)
    if names[0] == "longitude":
        x = (x + 180) % 360 - 180
        x, y = METRES_PER_DEGREE * np.cos(np.deg2rad(record["latitude"].values[0])) * x, METRES_PER_DEGREE * y
    return {"x": ("ping", x), "y": ("ping", y)} if np.isfinite(x).all() and np.isfinite(y).all() else {}
