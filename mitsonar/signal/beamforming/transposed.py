"""Transpose of `delay_and_sum`: weights of beams mapped to weights of the elements' signals.

    y = A z,    z' = A^H w,    Re <w, A z> = Re <A^H w, z>

z -> element signals, y -> beams, w -> weights of beams.
"""
from __future__ import annotations

import drjit as dr
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.device.turns import one_at_a_time
from mitsonar.device.types import DrJitArray

from .alignment import ElementSignals, device_arrays
from .delay_and_sum import BLOCK, beam_foci
from .interpolation import MARGIN, RATE, corrected_transposed
from .recording import Shading, look_directions, read_recording, weights_of


@one_at_a_time
def delay_and_sum_transposed(signals: xr.DataArray, directions: ArrayLike, weights: np.ndarray, *,
                             window: Shading = None, interpolation: str = "band_limited",
                             like: DrJitArray | type | None = None) -> np.ndarray:
    """Return the transpose of `delay_and_sum`, conjugate, of weights of its beams."""
    recording, vectors = read_recording(signals), look_directions(directions)
    array = ElementSignals(device_arrays(like), recording, interpolation, weights_of(window, recording))
    lib, (pings, transmitters, elements, samples) = array.lib, recording.values.shape
    weights = np.asarray(weights)
    if weights.shape != (pings, len(vectors), samples):
        raise ValueError(f"weights have the shape {weights.shape}; give {(pings, len(vectors), samples)}, one for "
                         "every sample of the beams")
    found, together = np.empty(recording.values.shape, np.complex64), max(1, BLOCK // samples)
    stored = transmitters, elements, RATE * samples + 2 * MARGIN
    for ping in range(pings):
        array.load(ping, np.zeros(3))
        into = dr.zeros(lib.Float, 2 * int(np.prod(stored)))
        for begin in range(0, len(vectors), together):
            block = slice(begin, begin + together)
            for number, place in enumerate(recording.transmitters[ping]):
                array.spread(beam_foci(array, vectors[block], place), weights[ping, block].ravel(), number, into)
        spread = np.ascontiguousarray(into.numpy()).view(np.complex64).reshape(stored)
        found[ping] = corrected_transposed(array.kernel, spread) * (array.weights[:, None] / transmitters)
    return found
