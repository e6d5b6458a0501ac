"""A line of soundings made by hand, as numbers and as a record."""
from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from sounded_line import Line, recorded, rocking, sounded, swath


@pytest.fixture(scope="session")
def line() -> Line:
    """Twenty pings of 100 soundings over 400 m of a rough bed at 80 to 110 m, sent while the vessel rocks."""
    rng = np.random.default_rng(3)
    motion = rocking(np.arange(-1, 12, 0.01))
    sent = np.repeat(np.linspace(0, 9.5, 20)[:, None], 100, 1)
    across, along = np.broadcast_to(np.linspace(-200, 200, 100), sent.shape), rng.uniform(-15, 15, sent.shape)
    return sounded(swath(motion, sent, across, along, rng.uniform(80, 110, sent.shape)), sent, motion)


@pytest.fixture(scope="session")
def soundings(line: Line) -> xr.Dataset:
    """The same as a record, with one sector; places are right."""
    return recorded(line)
