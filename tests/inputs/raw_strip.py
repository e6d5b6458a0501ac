"""Raw echoes of point targets by brute force: exact delays of every pulse to every receiver, nothing stands still.

What leaves the transmitter at t_e reaches the receiver at t_a, t_a = t_e + T(x_t(t_e), p) + T(p, x_r(t_a)), T the time
of the straight way or of the exact eigenray. t_a(t_e) is solved at three instants of the pulse; t_e(t_a) is the
parabola through them. The receiver hears, 1 m² of target strength and lossless water left out,

    s(t) = 10^(SL/20) b(t_e(t)) e^(i2πf₀(t_e - t)) / (R_t R_r)                 all times after the ping's transmission
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from mitsonar.device.rotations import rotation_matrix
from mitsonar.propagation import eigenray
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.synthetic_aperture.record import check_raw
from mitsonar.water import SoundSpeedProfile

Way = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]     # times -> x, y, depth and roll, pitch, heading (..., 3)
RATE = 200.0                       # [Hz] of the recorded trajectory
MARGIN = 0.1                       # [s]


def straight(speed: float = 1.5, depth: float = 10.0, heading: float = 0.0, start: tuple[float, float] = (0.0, 0.0),
             **motion: tuple[float, float]) -> Way:
    """Sail straight; motion: sway, heave, surge [m], roll, pitch, yaw [rad] = (amplitude, period [s])."""
    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = np.asarray(t, float)
        swing = {name: a * np.sin(2 * np.pi * t / period + number)
                 for number, (name, (a, period)) in enumerate(sorted(motion.items()))}
        none = np.zeros_like(t)
        ahead, aside = speed * t + swing.get("surge", none), swing.get("sway", none)
        s, c = np.sin(heading), np.cos(heading)
        place = np.stack([start[0] + ahead * s + aside * c, start[1] + ahead * c - aside * s,
                          depth + swing.get("heave", none)], -1)
        turns = [swing.get("roll", none), swing.get("pitch", none), heading + swing.get("yaw", none)]
        return place, np.stack(turns, -1)
    return at


def circle(radius: float, speed: float = 1.5, depth: float = 10.0) -> Way:
    """Sail clockwise round the origin: starboard looks inwards."""
    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bearing = speed * np.asarray(t, float) / radius
        none = np.zeros_like(bearing)
        return (np.stack([radius * np.sin(bearing), radius * np.cos(bearing), none + depth], -1),
                np.stack([none, none, bearing + np.pi / 2], -1))
    return at


def line_array(receivers: int, length: float, banks: int = 1, bank_spacing: float = 0.3) -> np.ndarray:
    """Places (banks·receivers, 3) of receivers end to end along the body, one bank above the other."""
    along = (np.arange(receivers) - 0.5 * (receivers - 1)) * length
    return np.concatenate([np.stack([along, 0 * along, 0 * along + (bank - 0.5 * (banks - 1)) * bank_spacing], -1)
                           for bank in range(banks)])


def raw_strip(way: Way, pulse: Pulse, targets: np.ndarray, *, ping_time: np.ndarray, sampling_rate: float,
              window: tuple[float, float], receivers: np.ndarray, transmitters: np.ndarray | None = None,
              bank: np.ndarray | None = None, profile: SoundSpeedProfile | float = 1500.0, side: float = 1.0,
              depression: float = 0.3, tx_length: float = 0.05, rx_length: float = 0.05, beam: bool = True,
              source_level_db: float = 210.0, absorption_db: float = 0.0, bed_depth: float = 20.0) -> xr.Dataset:
    """Make raw echoes.

    Parameters
    ----------
    way : callable
        `straight`, `circle`, or another.
    pulse : Pulse
    targets : (N, 4)
        x, y, depth [m] and target strength [dB].
    ping_time : (P,) [s]
    sampling_rate : float [Hz]
    window : (float, float) [s]
        First and last time of the samples after the transmission.
    receivers, transmitters : (R, 3), (T, 3) [m]
        Body frame; one transmitter at the origin by default; they send in turn.
    bank : (R,) int
    profile : SoundSpeedProfile or float [m/s]
    side, depression : float
        Starboard 1, port -1; of the look [rad].
    tx_length, rx_length : float [m]
    beam : bool
        Elements have the beams of their lengths, along the track; else none.
    """
    transmitters = np.zeros((1, 3)) if transmitters is None else transmitters
    ping_time, targets = np.asarray(ping_time, float), np.atleast_2d(np.asarray(targets, float))
    time = np.arange(window[0], window[1], 1 / sampling_rate)
    sender = np.arange(len(ping_time)) % len(transmitters)
    water = SoundSpeedProfile.constant(profile) if isinstance(profile, (int, float)) else profile
    signal = np.zeros((len(ping_time), len(receivers), len(time)), np.complex64)
    wavelength = float(water.at(float(way(np.zeros(1))[0][0, 2]))) / pulse.frequency
    for x, y, depth, strength in targets:
        point = np.array([x, y, depth])
        level = 10 ** ((source_level_db + strength) / 20)
        for ping, start in enumerate(ping_time):
            sent, arrived, gain = _arrivals(way, start, transmitters[sender[ping]], receivers, point, pulse, water)
            loss = 10 ** (-absorption_db * gain[0] / 20) * level / gain[1]
            if beam:
                loss = loss * np.sinc(tx_length / wavelength * gain[2]) * np.sinc(rx_length / wavelength * gain[3])
            for rx in range(len(receivers)):
                first, last = np.searchsorted(time, [arrived[0, rx], arrived[-1, rx] + 1e-9])
                t = time[first:last]
                own = np.polynomial.polynomial.polyval(t - arrived[1, rx], _parabola(arrived[:, rx], sent))
                signal[ping, rx, first:last] += loss[rx] * pulse.envelope(own) * np.exp(
                    2j * np.pi * pulse.frequency * (own - t))
    moments = np.arange(ping_time[0] - MARGIN, ping_time[-1] + window[1] + MARGIN + 1 / RATE, 1 / RATE)
    place, attitude = way(moments)
    record = xr.Dataset({
        "signal": (("ping", "rx", "sample"), signal), "time": ("sample", time), "ping_time": ("ping", ping_time),
        "transmitter": ("ping", sender.astype(np.int32)), "tx_position": (("tx", "axis"), transmitters),
        "rx_position": (("rx", "axis"), receivers),
        "rx_bank": ("rx", np.zeros(len(receivers), np.int32) if bank is None else np.asarray(bank, np.int32)),
        "motion_time": ("motion", moments),
        **{f"motion_{name}": ("motion", place[:, k]) for k, name in enumerate(("x", "y", "depth"))},
        **{f"motion_{name}": ("motion", attitude[:, k]) for k, name in enumerate(("roll", "pitch", "heading"))},
        "cast_depth": ("node", water.depth), "cast_sound_speed": ("node", water.sound_speed),
        **{f"target_{name}": ("target", targets[:, k]) for k, name in enumerate(("x", "y", "depth", "strength_db"))},
        "target_name": ("target", np.array([f"target_{k}" for k in range(len(targets))], str))},
        coords={"ping": np.arange(len(ping_time))}, attrs={
            "sonar": "synthetic_aperture", "frequency": pulse.frequency, "sampling_rate": sampling_rate,
            "pulse": pulse.numbers, "source_level_db": source_level_db, "absorption_db": absorption_db,
            "look": [0.0, side * float(np.cos(depression)), float(np.sin(depression))],
            "tx_length": tx_length, "rx_length": rx_length, "bed_depth": bed_depth})
    check_raw(record)
    return record


def leg(water: SoundSpeedProfile, source: np.ndarray, point: np.ndarray) -> np.ndarray:
    """One-way times (...) [s] between sources (..., 3) and a point (3,): x, y, depth."""
    across = np.hypot(*(point - source)[..., :2].T).T
    if np.ptp(water.sound_speed) == 0:
        return np.hypot(across, point[2] - source[..., 2]) / water.sound_speed[0]
    return eigenray(water, source[..., 2], np.full(across.shape, point[2]), across).travel_time


def placed(way: Way, times: np.ndarray, element: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (..., 3) of elements, and their forward axes, at times (...): x, y, depth."""
    place, attitude = way(times)
    turned = rotation_matrix(*np.moveaxis(attitude, -1, 0))
    down = np.array([1.0, 1.0, -1.0])
    return place + (turned @ element[..., None])[..., 0] * down, turned[..., 0] * down


def _arrivals(way: Way, start: float, transmitter: np.ndarray, receivers: np.ndarray, point: np.ndarray, pulse: Pulse,
              water: SoundSpeedProfile) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants sent (3,), arrivals (3, R); length of the way, product of its legs, sines from abreast: (4, R)."""
    sent = np.array([0.0, 0.5, 1.0]) * pulse.duration
    origin, ahead = placed(way, start + sent, transmitter)
    out = leg(water, origin, point)[:, None]
    arrived = sent[:, None] + out + np.broadcast_to(out, (3, len(receivers)))
    for _ in range(5):
        there, axis = placed(way, start + arrived, receivers)
        arrived = sent[:, None] + out + leg(water, there, point)
    ways = point - origin[1], point - there[1]
    lengths = [np.linalg.norm(one, axis=-1) for one in ways]
    sines = ways[0] @ ahead[1] / lengths[0], np.sum(ways[1] * axis[1], -1) / lengths[1]
    return sent, arrived, np.stack(np.broadcast_arrays(lengths[0] + lengths[1], lengths[0] * lengths[1], *sines))


def _parabola(arrived: np.ndarray, sent: np.ndarray) -> np.ndarray:
    """Coefficients of sent(arrived - arrived[1]), lowest first, through three points."""
    before, after = arrived[0] - arrived[1], arrived[2] - arrived[1]
    slopes = (sent[0] - sent[1]) / before, (sent[2] - sent[1]) / after
    bend = (slopes[1] - slopes[0]) / (after - before)
    return np.array([sent[1], slopes[0] - bend * before, bend])
