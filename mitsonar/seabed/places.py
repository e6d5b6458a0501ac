"""Random places of marks and wander of crests on a bed, drawn from absolute coordinates.

A tile's seed and position determine what lies in it. The extent of a grid therefore does not change the marks, and a
longer bed shows more of them.

    wander(x, y) = rms sqrt(2 / N) sum over n of cos(k_n . (x, y) + phase_n)

k_n -> normal deviates over ``length`` [rad/m], phase_n uniform: a Gaussian field with the correlation
exp(-r^2 / (2 length^2)) for large N.
"""
from collections.abc import Iterator

import numpy as np

_WAVES = 64            # plane waves in a field of wander
_NO_NEGATIVE = 2**40   # seeds must not be negative; no bed reaches this offset


def tiles(seed: int, use: int, x: np.ndarray, y: np.ndarray, *, side: float,
          margin: float) -> Iterator[tuple[np.random.Generator, np.ndarray]]:
    """Yield the generator and the south-western corner (2,) [m] of the tiles within ``margin`` [m] of a grid.

    ``use`` separates the draws of one seed: 1 dislocations of ripples, 2 pock marks, 3 drag marks.
    """
    for row in range(int((y[0] - margin) // side), int((y[-1] + margin) // side) + 1):
        for column in range(int((x[0] - margin) // side), int((x[-1] + margin) // side) + 1):
            generator = np.random.default_rng([seed, use, row + _NO_NEGATIVE, column + _NO_NEGATIVE])
            yield generator, np.array([column * side, row * side])


def wander(seed: int, use: int, x: np.ndarray, y: np.ndarray, *, rms: float, length: float) -> np.ndarray:
    """Return a Gaussian displacement (Y, X) [m] over the grid; ``use``: 0 ripples, 4 sand ribbons."""
    # a sum of plane waves needs no grid: e^(i(kx x + ky y)) is an outer product
    generator = np.random.default_rng([seed, use])
    k_x, k_y = generator.standard_normal((2, _WAVES)) / length
    phase = generator.uniform(0, 2 * np.pi, _WAVES)
    rows = np.exp(1j * (y[:, None] * k_y + phase))
    columns = np.exp(1j * k_x[:, None] * x)
    return rms * np.sqrt(2 / _WAVES) * (rows @ columns).real


def around(middle: float, reach: float, axis: np.ndarray, step_length: float) -> slice:
    """Return the part of an even axis [m] within ``reach`` [m] of ``middle`` [m]."""
    low, high = np.ceil((middle - reach - axis[0]) / step_length), np.floor((middle + reach - axis[0]) / step_length)
    return slice(max(int(low), 0), max(min(int(high) + 1, axis.size), 0))
