"""Raw echoes of a synthetic aperture made of nothing but numbers: whole, and ping by ping."""
from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from mitsonar.synthetic_aperture.record import check_raw

PULSE = {"kind": "lfm", "frequency": 1e5, "bandwidth": 2e4, "duration": 1e-3}


def raw_record(pings: int = 5, receivers: int = 4, samples: int = 50, seed: int = 0) -> xr.Dataset:
    """Return noise as raw echoes of a straight track, with two targets."""
    rng = np.random.default_rng(seed)
    shape = (pings, receivers, samples)
    signal = (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)
    signal[0, 0, :2] = complex(-0.0, np.inf), complex(np.nan, 1)
    moments = np.linspace(0, 1, 11)
    still = 0 * moments
    record = xr.Dataset({
        "signal": (("ping", "rx", "sample"), signal, {"units": "µPa"}),
        "time": ("sample", 0.01 + np.arange(samples) / 4e4, {"units": "s"}),
        "ping_time": ("ping", np.arange(pings) / 10), "transmitter": ("ping", np.zeros(pings, np.int32)),
        "tx_position": (("tx", "axis"), np.zeros((1, 3))),
        "rx_position": (("rx", "axis"), rng.normal(size=(receivers, 3))),
        "rx_bank": ("rx", np.zeros(receivers, np.int32)), "motion_time": ("motion", moments),
        "motion_x": ("motion", still), "motion_y": ("motion", moments), "motion_depth": ("motion", 5 + still),
        "motion_roll": ("motion", still), "motion_pitch": ("motion", still), "motion_heading": ("motion", still),
        "cast_depth": ("node", [0.0, 30.0]), "cast_sound_speed": ("node", [1500.0, 1490.0]),
        "target_x": ("target", [20.0, 30.0]), "target_y": ("target", [0.0, 1.0]),
        "target_depth": ("target", [15.0, 15.0]), "target_strength_db": ("target", [0.0, -10.0]),
        "target_name": ("target", ["near", "fär"])}, coords={"ping": np.arange(pings)},
        attrs={"sonar": "synthetic_aperture", "frequency": 1e5, "sampling_rate": 4e4, "pulse": PULSE,
               "source_level_db": 200.0, "absorption_db": 0.03, "look": [0.0, 0.8, 0.6], "tx_length": 0.1,
               "rx_length": 0.05, "bed_depth": 15.0, "seed": seed, "altered": None, "parameters": {"a": "1"}})
    check_raw(record)
    return record


def one_by_one(record: xr.Dataset, end: int | None = None) -> Callable[[int], Iterator[xr.Dataset]]:
    """Return the pings of a record from a number on, as a maker of raw echoes does; some end before the last."""
    def pings_from(start: int) -> Iterator[xr.Dataset]:
        for number in range(start, record.sizes["ping"] if end is None else end):
            yield record.isel(ping=slice(number, number + 1))
    return pings_from
