"""Receiver and recorder of a sidescan: leakage between its sides, ringing and quantisation.

    p²_port  = p²_port + (a + x) p²_starboard,     z_port = z_port + √(a + x) z_starboard,    likewise starboard
    A        = ⌊min(|z|, A_1) / q⌋ q + q/2,        q = A_1 / 2^bits

Leakage adds a faint copy of the other side's record at the same ranges. The face of a side receives through its baffle
by the back-to-front ratio a -> ``back``, -20 to -45 dB for faces in a hull (Urick 1983, ch. 3; Butler and Sherman
2016). Channels leak electrically by x -> ``crosstalk``, -35 to -70 dB between receivers on one tow cable or board.

A recorder stores envelopes A as the middles of 2^``bits`` steps, clipped at A_1² -> ``full_scale``. The receiver also
picks up its own transmission, compressed like echoes: at full scale over ``blind``, the effective pulse, then falling
by 60 dB over ``ringing``.
"""
from dataclasses import dataclass

import numpy as np

DECAY = np.log(1e6)                # of a power over the ringing


@dataclass(frozen=True, kw_only=True)
class Recorder:
    """Receiver and recorder, without faults by default."""

    back: float = 0.0  # share of the other side's power received through the back of the face
    crosstalk: float = 0.0  # share of the other side's power received through the wires
    bits: int = 0  # per sample; 0: not quantised
    full_scale: float = np.inf  # [µPa²]: loudest intensity that a sample holds
    blind: float = 0.0  # [s]: length of the compressed transmission
    ringing: float = 0.0  # [s]: time in which the transmission falls by 60 dB

    def __post_init__(self):
        for name in ("back", "crosstalk"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g} of the other side's power; give 0 to 1.")
        if self.bits < 0 or self.bits and not 0 < self.full_scale < np.inf:
            raise ValueError(f"{self.bits} bits of a full scale of {self.full_scale:g} µPa²; give bits of 0 or more, "
                             "and a finite full scale above 0.")

    @property
    def leakage(self) -> float:
        """Return the share of the other side's power in a channel [-]."""
        return self.back + self.crosstalk


FAULTLESS = Recorder()


def leaked(intensity: np.ndarray, recorder: Recorder) -> np.ndarray:
    """Return mean intensities (ping, side, ...) with the leakage of the other side added."""
    return intensity + recorder.leakage * intensity[:, ::-1] if recorder.leakage else intensity


def leaked_pressure(pressure: np.ndarray, recorder: Recorder) -> np.ndarray:
    """Return complex pressures (ping, side, ...) with the leakage of the other side added."""
    return pressure + np.sqrt(recorder.leakage) * pressure[:, ::-1] if recorder.leakage else pressure


def recorded(intensity: np.ndarray, recorder: Recorder, time: np.ndarray) -> np.ndarray:
    """Return the recorded intensities (..., bins) [µPa²] of received ones at times [s]."""
    if not recorder.bits:
        return intensity
    if recorder.ringing:
        after = np.maximum(time - recorder.blind, 0) / recorder.ringing
        intensity = intensity + recorder.full_scale * np.exp(-DECAY * after)
    step = np.sqrt(recorder.full_scale) / 2.0 ** recorder.bits
    count = np.minimum(np.sqrt(intensity) / step, 2.0 ** recorder.bits - 1)
    return ((np.floor(count) + 0.5) * step) ** 2
