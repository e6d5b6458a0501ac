"""Beams of a line by brute force and in closed form, in NumPy alone: straight rays, uniform water, elements one by one.

Nothing is shared with the renderer but conventions: body frame forward, starboard, down; scene x east, y north, z up;
heading clockwise from north; the beam of a direction u is focused at the range c t / 2 from the body's origin.
"""
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

OVER = 12                          # samples a cycle of bandwidth, of the signals that are interpolated
ROUNDS = 6                         # of iteration for the time of emission: each gains five digits at 3 knots


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A linear sweep under a Hann window, which is as good as nothing outside its band.

    Attributes
    ----------
    frequency, bandwidth : float [Hz]
    duration : float [s]
    """

    frequency: float
    bandwidth: float
    duration: float

    def at(self, time: np.ndarray) -> np.ndarray:
        """Complex envelope at times (...) [s] from the beginning."""
        share = time / self.duration
        inside = (share >= 0) & (share <= 1)
        phase = np.pi * self.bandwidth * (time ** 2 / self.duration - time)
        return np.where(inside, 0.5 - 0.5 * np.cos(2 * np.pi * share), 0) * np.exp(1j * phase)

    def compressed(self, rate: float) -> np.ndarray:
        """Autocorrelation at a sampling rate [Hz], 1 in the middle."""
        pulse = self.at(np.arange(0, self.duration, 1 / rate))
        return np.correlate(pulse, pulse, "full") / np.sum(np.abs(pulse) ** 2)


@dataclass(frozen=True, kw_only=True)
class Course:
    """A platform that goes straight on and turns evenly.

    Attributes
    ----------
    start : (3,) [m]
        At time 0.
    velocity : (3,) [m/s]
    heading, turn_rate : float [rad], [rad/s]
    """

    start: np.ndarray
    velocity: np.ndarray
    heading: float = 0.0
    turn_rate: float = 0.0

    def places(self, body: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Where a point (3,) of the body is at times (...): (..., 3) [m], scene."""
        h = self.heading + self.turn_rate * time
        forward, starboard, down = body
        turned = np.stack([forward * np.sin(h) + starboard * np.cos(h), forward * np.cos(h) - starboard * np.sin(h),
                           np.full(np.shape(h), -down)], -1)
        return self.start + self.velocity * np.asarray(time)[..., None] + turned


def beams_of_points(places: np.ndarray, strength_db: np.ndarray, *, course: Course, sweep: Sweep,
                    elements: np.ndarray, weight: np.ndarray, directions: np.ndarray, time: np.ndarray,
                    sound_speed: float, absorption_db: float, source_level_db: float,
                    transmitter: np.ndarray = np.zeros(3)) -> np.ndarray:
    """Sum what omnidirectional elements hear of point targets.

    What an element hears at t left the transmitter at u, where |p - x_t(u)| + |p - x_n(t)| = c (t - u).

    Parameters
    ----------
    places, strength_db : (T, 3) [m], (T,) [dB re 1 m²]
    elements, transmitter : (N, 3), (3,) [m]
        Body frame.
    weight : (N,)
    directions : (B, 3)
        Of beams, body frame.
    time : (S,) [s]
        Since the transmission begins, at the course's time 0.
    absorption_db : float [dB/m]

    Returns
    -------
    complex (B, S) [µPa]
    """
    rate = OVER * sweep.bandwidth
    # what the platform moves while echoes are on their way is a small part of a pulse's length
    guard = sweep.duration + 4 * np.ptp(elements, axis=0).max() / sound_speed
    fine = np.arange(time[0] - guard, time[-1] + 2 * guard, 1 / rate)
    replica = sweep.at(np.arange(0, sweep.duration, 1 / rate))
    length = len(fine) + len(replica)
    matched = np.conj(np.fft.fft(replica, length)) / np.sum(np.abs(replica) ** 2)
    distance = 0.5 * sound_speed * time
    out = np.zeros((len(directions), len(time)), complex)
    for element, w in zip(elements, weight):
        heard = np.zeros(len(fine), complex)
        for place, strength in zip(places, strength_db):
            begins = 2 * np.linalg.norm(place - course.start) / sound_speed
            some = slice(*np.searchsorted(fine, (begins - 0.5 * guard, begins + sweep.duration + 0.5 * guard)))
            now = fine[some]
            back = np.linalg.norm(place - course.places(element, now), axis=1)
            sent = now - 2 * back / sound_speed
            for _ in range(ROUNDS):
                way = np.linalg.norm(place - course.places(transmitter, sent), axis=1)
                sent = now - (way + back) / sound_speed
            loss = 10 ** ((strength - absorption_db * (way + back)) / 20) / (way * back)
            heard[some] += loss * sweep.at(sent) * np.exp(2j * np.pi * sweep.frequency * (sent - now))
        compressed = CubicSpline(fine, np.fft.ifft(np.fft.fft(heard, length) * matched)[:len(fine)])
        late = (np.linalg.norm(distance[:, None] * directions[:, None] - element, axis=-1) - distance) / sound_speed
        out += w * compressed(time + late) * np.exp(2j * np.pi * sweep.frequency * late)
    return out * 10 ** (source_level_db / 20) / np.abs(weight).sum()


def beam_power_of_bed(distance: np.ndarray, sines: np.ndarray, *, altitude: float, lambert_db: float, sweep: Sweep,
                      place: np.ndarray, weight: np.ndarray, sound_speed: float, absorption_db: float,
                      source_level_db: float, pattern: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Integrate the sonar equation over the rings of a level bed of Lambert's law below a level line.

        <|B|²> = SL ∫ µ (h/R)² 10^(-2 α R / 10) / R⁴ |z(2 (R' - R) / c)|² |W(s - s_b)|² R dR dφ
        s = √(1 - (h/R)²) sin φ

    Parameters
    ----------
    distance, sines : (K,) [m], (B,) [-]
    place, weight : (N,) [wavelengths], (N,)
        Of the line.
    pattern : callable
        Two-way intensity of unit vectors (..., 3), body frame, forward, starboard, down.

    Returns
    -------
    (B, K) [µPa²]
    """
    rate = OVER * sweep.bandwidth
    echo = np.abs(sweep.compressed(rate)) ** 2
    away = (np.arange(len(echo)) - len(echo) // 2) * 0.5 * sound_speed / rate
    turn = np.linspace(-np.pi, np.pi, 6000, endpoint=False)
    gaps = np.linspace(-2, 2, 8001)
    line_power = np.abs(np.exp(2j * np.pi * gaps[:, None] * place) @ weight / np.abs(weight).sum()) ** 2
    out = np.zeros((len(sines), len(distance)))
    mu, level = 10 ** (lambert_db / 10), 10 ** (source_level_db / 10)
    for k, middle in enumerate(distance):
        R = middle + away
        some = R > altitude
        # the ring's strength over the pulse's extent, the pattern of the line that of the middle
        ring = np.sum((echo * (altitude / np.where(some, R, 1)) ** 2 * 10 ** (-0.2 * absorption_db * R)
                       / np.where(some, R, 1) ** 3)[some]) * (away[1] - away[0])
        level_share = np.sqrt(1 - (altitude / middle) ** 2)
        sight = np.stack([level_share * np.cos(turn), level_share * np.sin(turn),
                          np.full(turn.shape, altitude / middle)], -1)
        line = np.interp(sight[:, 1] - sines[:, None], gaps, line_power)
        out[:, k] = level * mu * ring * (line * pattern(sight)).sum(1) * (turn[1] - turn[0])
    return out
