"""Statistics of the speckle of a fan of complex beams."""
import numpy as np
from scipy.ndimage import map_coordinates
from scipy.signal import resample

FINER = 4                          # times the sampling rate, of pictures that are interpolated


def second_moment(frames: list[np.ndarray], mean: np.ndarray) -> float:
    """Return <I²>/<I>² of frames (B, S), about a known mean intensity (B, S): 2 (1 + 1/N) of N scatterers a cell."""
    intensity = np.array([np.abs(frame) ** 2 / mean for frame in frames])
    return float((intensity ** 2).mean() / intensity.mean() ** 2)


def correlation(frames: list[np.ndarray], mean: np.ndarray, lags: tuple[int, ...], axis: int) -> list[float]:
    """Return how far intensities are alike some beams (axis 0) or samples (1) on, as the root of their correlation.

    Of Gaussian pressures it is the absolute value of the pressures' own correlation.
    """
    change = np.array([np.abs(frame) ** 2 / mean for frame in frames])
    change = np.moveaxis(change - change.mean(), axis + 1, 0)
    return [float(np.sqrt(max((change[lag:] * change[:-lag]).mean() / (change ** 2).mean(), 0))) for lag in lags]


def correlation_of_line(place: np.ndarray, weight: np.ndarray, gap: float) -> float:
    """|Σ w² e^(i2π x gap)| / Σ w² of a line (N,) [wavelengths]: beams `gap` apart in sine over a bed alike all over."""
    return float(np.abs(np.sum(weight ** 2 * np.exp(2j * np.pi * place * gap))) / np.sum(weight ** 2))


def correlation_of_pulse(compressed: np.ndarray, lags: np.ndarray) -> np.ndarray:
    """Correlation of a compressed pulse with itself, whole samples later, as absolute values."""
    own = np.abs(np.correlate(compressed, compressed, "full"))
    return own[len(own) // 2 + np.asarray(lags)] / own.max()


def coherence(first: np.ndarray, second: np.ndarray, *, moved: np.ndarray, distance: np.ndarray, sines: np.ndarray,
              altitude: float, wavenumber: float) -> float:
    """Return the coherence of two frames of a level bed, the second of them of a sonar that has moved.

    The second is read where the ground of the first lies in it, and turned by how much nearer that is:

        γ = |<z_1 z_2* e^(i2k (R_2 - R_1))>| / √(<|z_1|²> <|z_2|²>)

    Parameters
    ----------
    first, second : complex (B, S)
    moved : (2,) [m]
        Ahead and to starboard.
    distance, sines : (S,) [m], (B,) [-]
        Slant range and sine of the beams, in equal steps each.
    altitude : float [m]
    wavenumber : float [1/m]
        Of the carrier.
    """
    starboard = sines[:, None] * distance
    ahead = np.sqrt(np.maximum(distance ** 2 - altitude ** 2 - starboard ** 2, 0))
    x, y = ahead - moved[0], starboard - moved[1]
    there = np.sqrt(x ** 2 + y ** 2 + altitude ** 2)
    row = (y / there - sines[0]) / (sines[1] - sines[0])
    column = (there - distance[0]) / (distance[1] - distance[0])
    inside = (row >= 0) & (row <= len(sines) - 1) & (column >= 8) & (column <= len(distance) - 9) & (ahead > 0)
    inside &= (np.arange(len(distance)) >= 8) & (np.arange(len(distance)) < len(distance) - 8)
    fine = resample(second, FINER * second.shape[1], axis=1)
    at = np.array([row[inside], FINER * column[inside]])
    read = map_coordinates(fine.real, at, order=3) + 1j * map_coordinates(fine.imag, at, order=3)
    here = first[inside]
    cross = np.mean(here * np.conj(read) * np.exp(-2j * wavenumber * (there - distance)[inside]))
    return float(np.abs(cross) / np.sqrt(np.mean(np.abs(here) ** 2) * np.mean(np.abs(read) ** 2)))
