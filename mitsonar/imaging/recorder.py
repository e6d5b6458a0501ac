"""Receiver and recorder of a sidescan: gain, crosstalk, ringing and quantisation of its sides' echoes.

    p²_port  = p²_port + (a + x) p²_starboard,     z_port = z_port + √(a + x) z_starboard,    and so starboard
    A        = ⌊min(|z|, A_1) / q⌋ q + q/2,        q = A_1 / 2^bits

Leakage: the face of one side hears on the other side what that one sends. It does so behind its baffle, by the
front-to-back ratio a -> ``back`` of the same aperture, 20 to 45 dB of faces in a hull (Urick 1983, ch. 3; Butler and
Sherman 2016); and channels talk across by x -> ``crosstalk``, 35 to 70 dB between receivers that share a tow cable or a
board. Both bring a fainter copy of the other side's record, at its ranges.

A recorder's samples are envelopes A. A_1 -> ``full_scale`` is the loudest; what is louder is that. ``bits`` -> how
many steps they have; a sample shows the middle of its step. The receiver hears its own transmission, which is
compressed as echoes are: at full scale over ``blind``, the effective pulse, then falling by 60 dB over ``ringing``.
"""
from dataclasses import dataclass

import numpy as np

DECAY = np.log(1e6)                # of a power over the ringing


@dataclass(frozen=True, kw_only=True)
class Recorder:
    """Receiver and recorder; by default without faults."""

    back: float = 0.0  # share of the other side's power that a side receives through the back of its face
    crosstalk: float = 0.0  # share of the other side's power that a channel receives through its wires
    bits: int = 0  # of a sample
    full_scale: float = np.inf  # [µPa²]: loudest intensity that a sample holds
    blind: float = 0.0  # [s]: length of the compressed transmission
    ringing: float = 0.0  # [s]: time in which the transmission falls by 60 dB

    def __post_init__(self):
        for name in ("back", "crosstalk"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g} of the other side; give a power from 0 to 1")
        if self.bits < 0 or self.bits and not 0 < self.full_scale < np.inf:
            raise ValueError(f"{self.bits} bits of a full scale of {self.full_scale:g} µPa²; give bits of 0 or more, "
                             "and a finite full scale above 0")

    @property
    def leakage(self) -> float:
        """Power of the other side that a side's channel has [-]."""
        return self.back + self.crosstalk


FAULTLESS = Recorder()


def leaked(intensity: np.ndarray, recorder: Recorder) -> np.ndarray:
    """Return the mean intensities (ping, side, ...) of channels that hear the other side too."""
    return intensity + recorder.leakage * intensity[:, ::-1] if recorder.leakage else intensity


def leaked_pressure(pressure: np.ndarray, recorder: Recorder) -> np.ndarray:
    """Return the complex pressures (ping, side, ...) of channels that hear the other side too."""
    return pressure + np.sqrt(recorder.leakage) * pressure[:, ::-1] if recorder.leakage else pressure


def recorded(intensity: np.ndarray, recorder: Recorder, time: np.ndarray) -> np.ndarray:
    """Return the intensities [µPa²] of the samples that are kept."""
    # intensity (..., bins) [µPa²]; time [s] -> (..., bins) [µPa²]
    if not recorder.bits:
        return intensity
    if recorder.ringing:
        after = np.maximum(time - recorder.blind, 0) / recorder.ringing
        intensity = intensity + recorder.full_scale * np.exp(-DECAY * after)
    step = np.sqrt(recorder.full_scale) / 2.0 ** recorder.bits
    count = np.minimum(np.sqrt(intensity) / step, 2.0 ** recorder.bits - 1)
    return ((np.floor(count) + 0.5) * step) ** 2
