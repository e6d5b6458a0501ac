"""Raw echoes of a rough bed by brute force: random scatterers, exact delays, nothing that stands still.

Every scatterer's echo is a phase over all frequencies; the sum over scatterers of exp(-i2π(f₀ + f)τ) at frequencies in
even steps is a product of two matrices, one of coarse steps and one of fine ones. So thousands of points cost little.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from mitsonar.device.rotations import rotation_matrix
from mitsonar.sonar.pulses.pulses import lfm
from mitsonar.synthetic_aperture.record import RAW_VARIABLES

SOUND_SPEED, FREQUENCY, BANDWIDTH, DURATION = 1500.0, 300e3, 30e3, 1e-3
RATE, FINE = 90e3, 32
STEP = 0.005                       # [s] of the trajectory's record


def straight(speed: float, heading: float, depth: float, **wobble: Callable[[np.ndarray], np.ndarray]
             ) -> Callable[[np.ndarray], np.ndarray]:
    """A track (..., 6) of x, y, depth, roll, pitch, heading in time, disturbed by surge, sway, heave, yaw."""
    def pose(time: np.ndarray) -> np.ndarray:
        none = np.zeros_like(np.asarray(time, float))
        surge, sway, heave, yaw = (wobble.get(name, np.zeros_like)(none + time)
                                   for name in ("surge", "sway", "heave", "yaw"))
        along = speed * time + surge
        return np.stack([along * np.sin(heading) + sway * np.cos(heading),
                         along * np.cos(heading) - sway * np.sin(heading), depth + heave, none, none,
                         heading + yaw], -1)
    return pose


def bed_strip(pose: Callable[[np.ndarray], np.ndarray], ping_time: np.ndarray, *, rx: np.ndarray, element: float,
              ranges: tuple[float, float], scatterers: np.ndarray, strength: np.ndarray, noise: float = 0.0,
              bank: np.ndarray | None = None, bed_depth: float = 15.0, seed: int = 0) -> xr.Dataset:
    """Make raw echoes of one transmitter at the body's origin.

    Parameters
    ----------
    pose : callable(time) -> (..., 6)
    ping_time : (ping,) [s]
    rx : (rx, 3) [m]
        Body frame, looking to starboard.
    element : float [m]
        Length of all elements along the track.
    ranges : (float, float) [m]
    scatterers : (N, 3) [m]
        z up.
    strength : complex (N,)
    noise : float
        Of the power of the whole record's echoes.
    """
    pulse = lfm(FREQUENCY, BANDWIDTH, DURATION)
    first = 2 * ranges[0] / SOUND_SPEED
    count = int(np.ceil((2 * (ranges[1] - ranges[0]) / SOUND_SPEED + 2 * DURATION) * RATE / FINE)) * FINE * 2
    kept = int(np.ceil((2 * (ranges[1] - ranges[0]) / SOUND_SPEED + DURATION) * RATE))
    sent = pulse.spectrum(RATE, count)
    signal = np.empty((len(ping_time), len(rx), kept), np.complex64)
    for number, time in enumerate(ping_time + 0.5 * DURATION):       # to first order a moving sonar's pulse
        leg, out = _leg(pose, time, np.zeros(3), scatterers)
        pattern = _pattern(pose(time), leg, element)
        for j, lever in enumerate(rx):
            back, home, delay, sine = _return(pose, time, lever, scatterers, out)
            weight = strength * pattern * np.sinc(element * FREQUENCY / SOUND_SPEED * sine) / (out * home)
            spectrum = _sums(weight * np.exp(-2j * np.pi * FREQUENCY * delay), delay - first, count)
            signal[number, j] = np.fft.ifft(spectrum * sent)[:kept]
    if noise:
        power = noise * np.mean(np.abs(signal) ** 2)
        drawn = np.random.default_rng(seed).normal(size=(*signal.shape, 2)).view(complex)[..., 0]
        signal = (signal + np.sqrt(0.5 * power) * drawn).astype(np.complex64)
    return _record(pose, ping_time, first + np.arange(kept) / RATE, signal, rx, element, bank, bed_depth, pulse.numbers)


def rough_bed(count: int, along: tuple[float, float], across: tuple[float, float], heading: float, depth: float,
              seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random points (N, 3) of a level bed to starboard of a track through the origin, and phases (N,)."""
    rng = np.random.default_rng(seed)
    ahead, aside = rng.uniform(*along, count), rng.uniform(*across, count)
    place = np.stack([ahead * np.sin(heading) + aside * np.cos(heading),
                      ahead * np.cos(heading) - aside * np.sin(heading), np.full(count, -depth)], -1)
    return place, np.exp(2j * np.pi * rng.random(count))


def _leg(pose, time, lever, target):
    held = pose(np.asarray(time, float))
    rotation = rotation_matrix(*np.moveaxis(held[..., 3:], -1, 0))
    leg = target - (held[..., :3] * np.array([1.0, 1.0, -1.0]) + rotation @ lever)
    return leg, np.linalg.norm(leg, axis=-1)


def _return(pose, time, lever, target, out):
    """Way back, its length, the two-way delay and the sine off broadside; between 17 moments poses are splined."""
    first = 2 * out / SOUND_SPEED
    moments = np.linspace(first.min() - 1e-3, first.max() + 1e-3, 17)
    held = pose(time + moments)
    rotation = rotation_matrix(*np.moveaxis(held[..., 3:], -1, 0))
    place = CubicSpline(moments, held[..., :3] * np.array([1.0, 1.0, -1.0]) + rotation @ lever)
    axis = CubicSpline(moments, rotation[..., 0])
    delay = first
    for _ in range(3):
        back = target - place(delay)
        home = np.sqrt(np.einsum("ni,ni->n", back, back))
        delay = (out + home) / SOUND_SPEED
    return back, home, delay, np.einsum("ni,ni->n", back, axis(delay)) / home


def _pattern(held, leg, element):
    heading = held[..., 5]
    sine = (leg[..., 0] * np.sin(heading) + leg[..., 1] * np.cos(heading)) / np.linalg.norm(leg, axis=-1)
    return np.sinc(element * FREQUENCY / SOUND_SPEED * sine)


def _sums(weight, delay, count):
    """Σ w e^(-i2π f τ) at the frequencies of an FFT of `count` samples."""
    step = -2j * np.pi * RATE / count * delay
    fine = _powers(np.exp(step), FINE)
    coarse = _powers(np.exp(FINE * step), count // FINE) * (weight * np.exp(-count // 2 * step))
    return np.fft.ifftshift((coarse @ fine.T).ravel())


def _powers(base, count):
    """Powers 0 ... count - 1 of numbers, (count, N)."""
    table = np.empty((count, len(base)), complex)
    table[0], done = 1, 1
    while done < count:
        more = min(done, count - done)
        np.multiply(table[:more], table[done - 1] * base, out=table[done:done + more])
        done += more
    return table


def _record(pose, ping_time, time, signal, rx, element, bank, bed_depth, numbers):
    moments = np.arange(ping_time[0] - 0.1, ping_time[-1] + time[-1] + 0.1, STEP)
    motion = pose(moments)
    values = {"signal": signal, "time": time, "ping_time": ping_time,
              "transmitter": np.zeros(len(ping_time), np.int32), "tx_position": np.zeros((1, 3)), "rx_position": rx,
              "rx_bank": np.zeros(len(rx), np.int32) if bank is None else bank, "motion_time": moments,
              **{name: motion[:, i] for i, name in enumerate(
                  ("motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading"))},
              "cast_depth": np.array([0.0, 100.0]), "cast_sound_speed": np.full(2, SOUND_SPEED)}
    return xr.Dataset({name: (RAW_VARIABLES[name].dims, some) for name, some in values.items()}, attrs={
        "sonar": "synthetic_aperture", "frequency": FREQUENCY, "sampling_rate": RATE, "pulse": numbers,
        "source_level_db": 210.0, "absorption_db": 0.0, "look": [0.0, 0.94, 0.34], "tx_length": element,
        "rx_length": element, "bed_depth": bed_depth})
