"""Track the bed roughly through a fan of beams.

Each beam is cut into cells of equal steps of log(t cos θ), in which a level bed is a straight line at any depth. A cell
scores between 0 and 1, by three factors:

- its level under the strongest echoes of the beams around;
- its level under the strongest echo of all beams at that time, which rejects the side lobes of the first return;
- the coherence of both halves over some beams, C = 2 Re<a b*> / <|a|² + |b|²>, which is high for echoes from the
  beams' axes and low for side lobes. Near normal incidence, where a whole footprint echoes at once, C is no evidence,
  so a low C only halves the score.

Scores end at 1, so that a strong fish gains nothing over the bed behind it. The track is the sequence of cells with
the greatest sum of scores less the cost of steps between neighbours (Viterbi 1967, IEEE Trans. Inf. Theory 13, 260).
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, special

CELL = 0.01                # step of log(t cos θ)
ROWS = 180                 # beams that the track is sought in; more beams are averaged in groups
FULL_COHERENCE = 0.4       # of C, at which the score ends: a bed through a beam's main lobe has 0.7
WITHOUT_PHASE = 0.5        # least factor of the score by C
SMOOTHED = 5               # beams over which C and the detected scores are averaged
BELOW_NEIGHBOURS = 20.0    # dB under the strongest echo of the beams around, where the score is 0
AROUND, USUAL = 0.5, 30    # share of the beams around, and percentile of their strongest echoes
BELOW_RING = (30.0, 18.0)  # dB under the strongest echo at that time: score 0, and full score
GENTLE, STEEP = 1.0, 6.0   # slopes of log range over angle, tan of the incidence: at no cost, at a small cost
STEEP_COST, JUMP_COST = 0.3, 2.0
ENOUGH = 1 << 17           # blocks whose quietest tenth tells the noise within 1 %
CACHED = 4                 # beams whose products stay in a core's cache
SURE = 6.0                 # echo less the noise, in standard deviations of the noise
LEAST_SCORE = 0.1


@dataclass(frozen=True, kw_only=True)
class BottomEchoes:
    """Sums over short blocks of samples."""

    power: np.ndarray  # (B, N) [µPa²], mean over a block of (|a|² + |b|²)/2
    common: np.ndarray  # (B, N) [µPa²], mean over a block of Re(a b*)
    start: float  # [s], begin of the first block
    step: float  # [s], length of a block
    echoes: float  # independent ones in a block


@dataclass(frozen=True, kw_only=True)
class BottomTrack:
    """Rough track of the bed."""

    time: np.ndarray  # (B,) [s]
    seen: np.ndarray  # (B,), True where there is an echo


def reduced(halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, pulse_length: float) -> BottomEchoes:
    """Sum powers and products of both halves over blocks of about a pulse's length."""
    step = float(time[1] - time[0])
    size = int(np.clip(round(pulse_length / step), 1, max(1, len(time) // 200)))
    blocks = len(time) // size
    a, b = (in_rows(half)[:, :blocks * size].view(np.float32) for half in halves)
    power, common = (np.empty((len(a), blocks), np.float32) for _ in range(2))
    product, other = (np.empty((CACHED, a.shape[1]), np.float32) for _ in range(2))
    for first in range(0, len(a), CACHED):
        port, starboard = a[first:first + CACHED], b[first:first + CACHED]
        rows = len(port)
        np.multiply(port, port, out=product[:rows])
        product[:rows] += np.multiply(starboard, starboard, out=other[:rows])
        _add_blocks(product[:rows], size, power[first:first + rows])
        _add_blocks(np.multiply(port, starboard, out=product[:rows]), size, common[first:first + rows])
    power /= 2 * size
    common /= size
    return BottomEchoes(power=power, common=common, start=float(time[0]) - step / 2, step=size * step,
                        echoes=_independent(size, step / pulse_length))


def _add_blocks(product: np.ndarray, size: int, sums: np.ndarray) -> None:
    """Write the sums (b, N) over blocks of real and imaginary parts (b, 2 N size) by turns."""
    pairs = product.view(np.complex64).reshape(*sums.shape, size)
    total = pairs[..., 0] + pairs[..., 1] if size > 1 else pairs[..., 0]
    for number in range(2, size):
        total += pairs[..., number]
    np.add(total.real, total.imag, out=sums)


def in_rows(half: np.ndarray) -> np.ndarray:
    """Return beams as complex64, without a copy where the samples of each beam already lie side by side."""
    half = np.asarray(half, np.complex64)
    return half if half.strides[-1] == half.itemsize else np.ascontiguousarray(half)


def _independent(size: int, spacing: float) -> float:
    """Return the number of independent samples in ``size`` samples of filtered noise, ``spacing`` pulse lengths apart.
    """
    lags = np.subtract.outer(np.arange(size), np.arange(size)) * spacing
    return size ** 2 / float(np.exp(-np.pi * lags ** 2).sum())


def noise_level(echoes: BottomEchoes) -> float:
    """Estimate the noise [µPa²] in the whole beam from the quietest tenth of all blocks, or of every n-th of many."""
    every = max(1, echoes.power.size // ENOUGH)
    whole = (echoes.power.ravel()[::every] + echoes.common.ravel()[::every]) / 2
    tenth = len(whole) // 10
    quiet = np.partition(whole, tenth)[tenth]
    return float(quiet / (special.gammaincinv(echoes.echoes, 0.1) / echoes.echoes))


def track(echoes: BottomEchoes, sines: np.ndarray, widths: np.ndarray, noise: float,
          gate: tuple[float, float]) -> BottomTrack:
    """Track the bed through the beams."""
    # sines (B,); widths (B,) [rad]; noise [µPa²]; gate [s]
    together = -(-len(sines) // ROWS)
    first = np.arange(0, len(sines), together)
    count = np.diff(np.append(first, len(sines)))
    power, common = (_summed_rows(values, together) / count[:, None] for values in (echoes.power, echoes.common))
    angle = np.arcsin(np.clip(np.add.reduceat(sines, first) / count, -0.9999, 0.9999))
    width = np.maximum.reduceat(widths, first)
    score, cells = _scores(echoes, power, common, angle, width, noise, gate)
    chosen = _best_path(score, angle)
    rows = np.arange(len(first))
    guess = np.exp(cells[chosen]) / np.cos(angle)
    seen = ndimage.uniform_filter1d(score[rows, chosen], SMOOTHED, mode="nearest") > LEAST_SCORE
    group = np.repeat(rows, count)
    own = np.cos(np.arcsin(np.clip(sines, -0.9999, 0.9999)))
    return BottomTrack(time=np.clip(guess[group] * np.cos(angle)[group] / own, *gate), seen=seen[group])


def _scores(echoes: BottomEchoes, power: np.ndarray, common: np.ndarray, angle: np.ndarray, width: np.ndarray,
            noise: float,
            gate: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the scores (G, Z), and log(t cos θ) of the cells (Z,)."""
    cosine, blocks = np.cos(angle), power.shape[1]
    low = max(gate[0], gate[1] / 200, echoes.start + echoes.step)
    last = echoes.start + blocks * echoes.step
    cells = np.arange(np.log(low * cosine.min()), np.log(last * cosine.max()) + CELL, CELL)
    time = np.exp(cells) / cosine[:, None]
    half = np.maximum(np.maximum(0.75 * CELL, 0.6 * np.tan(np.abs(angle)) * width)[:, None] * time, echoes.step)
    begin = np.clip(((time - half - echoes.start) / echoes.step).astype(np.int32), 0, blocks - 1)
    end = np.clip(((time + half - echoes.start) / echoes.step).astype(np.int32) + 1, begin + 1, blocks)
    level, shared = (_means(values, begin, end) for values in (power, common))
    whole = (level + shared) / 2
    recorded = (time >= low) & (time <= last)
    tiny = max(float(level.max(initial=0.0)), 1e-300) * 1e-15
    scatter = SURE / np.sqrt(np.maximum((end - begin) * echoes.echoes, 1))
    sure = recorded & (whole > noise * (1 + scatter)) & (whole > tiny)
    whole_db = 10 * np.log10(np.maximum(whole, tiny))
    ring = ((power + common).max(axis=0) / 2)[None, :]
    ring = _means(ring, begin.reshape(1, -1), end.reshape(1, -1)).reshape(begin.shape)
    ring_db = 10 * np.log10(np.maximum(ring, tiny))
    through_lobe = np.clip((whole_db - ring_db + BELOW_RING[0]) / (BELOW_RING[0] - BELOW_RING[1]), 0, 1)
    # Echoes past the gate count here, so that the skirt of a bed beyond it is not taken for a bed.
    own = np.where(sure & (through_lobe > 0.5), whole_db, 10 * np.log10(tiny)).max(axis=1)
    around = ndimage.percentile_filter(own, USUAL, size=2 * int(AROUND * len(own) / 2) + 1, mode="nearest")
    coherence = ndimage.uniform_filter1d(shared, SMOOTHED, axis=0, mode="nearest")
    coherence /= np.maximum(ndimage.uniform_filter1d(level, SMOOTHED, axis=0, mode="nearest"), tiny)
    score = np.clip(coherence / FULL_COHERENCE, WITHOUT_PHASE, 1)
    score *= np.clip((whole_db - around[:, None]) / BELOW_NEIGHBOURS + 1, 0, 1)
    score *= through_lobe
    return np.where(sure & (time <= gate[1]), score, 0.0), cells


def _summed_rows(values: np.ndarray, together: int) -> np.ndarray:
    """Return the sums of so many rows after each other (G, N); the last may be of fewer."""
    # the first row is added last, as `np.add.reduceat` does
    total, rest = values[::together].copy(), values[1::together].copy() if together > 1 else values[:0]
    for number in range(2, together):
        more = values[number::together]
        rest[:len(more)] += more
    total[:len(rest)] += rest
    return total


def _means(values: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Average rows (G, N) between begin and end (G, Z)."""
    total = np.zeros((len(values), values.shape[1] + 1))
    np.cumsum(values, axis=1, out=total[:, 1:])
    return (np.take_along_axis(total, end, 1) - np.take_along_axis(total, begin, 1)) / (end - begin)


def _best_path(score: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the cell (G,) of each beam on the path with the greatest sum of scores."""
    sums = score.astype(np.float32)
    step = np.abs(np.diff(angle))
    gentle, steep = (np.ceil(step * slope / CELL).astype(int) for slope in (GENTLE, STEEP))
    for row in range(1, len(sums)):
        before = sums[row - 1]
        best = np.maximum(ndimage.maximum_filter1d(before, 2 * gentle[row - 1] + 1),
                          ndimage.maximum_filter1d(before, 2 * steep[row - 1] + 1) - STEEP_COST)
        sums[row] += np.maximum(best, before.max() - JUMP_COST)
    chosen = np.empty(len(sums), np.int64)
    chosen[-1] = np.argmax(sums[-1])
    away = np.arange(sums.shape[1])
    for row in range(len(sums) - 1, 0, -1):
        moved = np.abs(away - chosen[row])
        cost = np.where(moved <= gentle[row - 1], 1e-3 * moved, np.where(moved <= steep[row - 1], STEEP_COST,
                                                                        JUMP_COST))
        chosen[row - 1] = np.argmax(sums[row - 1] - cost)
    return chosen
