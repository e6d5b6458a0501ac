"""Survey of a sonar with arrays: scene, water, pulse, arrays, and sampling of its record."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mitsonar.device.types import Float, Float64, Int32
from mitsonar.signal.accumulation import centre
from mitsonar.signal.noise import ElementNoise
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.motion.trajectory import PingTravel
from mitsonar.sonar.pulses.pulses import Pulse

from ..survey import Survey
from .sources import RaySources


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Sampling of a record in complex baseband."""

    start: float  # [s], time of sample 0 after the transmission
    sampling_rate: float  # [Hz]
    frequency: float  # [Hz], of the carrier

    def place(self, delay: Float64) -> tuple[Float, Int32, Float]:
        """Return carrier phase [cycles], sample and fraction of a sample of delays (R,) [s]; see `centre`."""
        return centre(delay, start=self.start, frequency=self.frequency, sampling_rate=self.sampling_rate)


class Steering(Protocol):
    """Directions (3,) by the number of a ping, such as those that a transmit array is steered to."""

    def __getitem__(self, ping: int, /) -> np.ndarray: ...


@dataclass(frozen=True, kw_only=True)
class ArraySurvey(Survey):
    """Run of a sonar with arrays.

    `rays` is the number of rays of one source and ping. It matters only if rays find the scatterers, and for echoes
    that are drawn at random.
    """

    pulse: Pulse
    source_level_db: float  # [dB re 1 µPa @ 1 m], of all transmit elements with their waves in phase
    transmit: Array
    receive: Array
    start: float  # [s], time of sample 0 after the transmission
    sampling_rate: float  # [Hz]
    samples: int
    lead: int  # number of samples before the beginning of the requested record
    cell_size: float  # [m], longest side of a cell, which has one scatterer
    per_cell: float  # scatterers in a resolution cell of a picture in the beam domain
    ensonification: str  # method of finding the scatterers: "scatterers" or "rays"
    sources: RaySources  # places where rays start
    pass_number: int = 0  # number of the pass over the ground
    noise: ElementNoise | None = None
    steering: Steering | None = None  # (P, 3) [-], direction that the transmit array is steered to
    sending: np.ndarray | None = None  # (P,), number of the transmit element that sends alone at a ping
    thin_below: float = 0.0  # two-way intensity of the beams below which cells are thinned

    @property
    def velocity(self) -> np.ndarray:
        """Return the velocity at the transmissions, (P, 3) [m/s], scene frame."""
        return self.voyage.velocity

    @property
    def frequency(self) -> float:
        """Return the frequency of the carrier [Hz]."""
        return self.pulse.frequency

    @property
    def wavelength(self) -> float:
        """Return the carrier's wavelength at the array at the first ping [m]: beams keep it in the same water."""
        return self.planned_speed / self.frequency

    @property
    def radius(self) -> float:
        """Return the distance [m] of the farthest element of both arrays from the arrays' centre."""
        return max(self.transmit.radius, self.receive.radius)

    @property
    def sampling(self) -> Sampling:
        """Return the sampling of the record."""
        return Sampling(start=self.start, sampling_rate=self.sampling_rate, frequency=self.frequency)

    @property
    def time(self) -> np.ndarray:
        """Return the times of the samples [s], (S,)."""
        return self.start + np.arange(self.samples) / self.sampling_rate

    def transmit_delay(self, ping: int) -> np.ndarray:
        """Return the delays of transmit elements (E,) [s]: their own, plus r_e·u / c with u = `steering`."""
        array = self.transmit
        if self.steering is None:
            return array.delay
        place = array.position - array.position[array.working].mean(0)
        return array.delay + place @ self.steering[ping] / self.sound_speed(ping)

    def sender(self, ping: int) -> int:
        """Return the number of the transmit element that sends at a ping; 0 if all send together."""
        return 0 if self.sending is None else int(self.sending[ping])

    def transmit_weight(self, ping: int) -> np.ndarray:
        """Return the weights of transmit elements (E,), whose magnitudes add to 1."""
        weight = self.transmit.weight
        if self.sending is not None:
            weight = np.where(np.arange(len(weight)) == self.sending[ping], weight, 0)
        return weight / np.abs(weight).sum()

    def travel(self, ping: int, position: np.ndarray) -> PingTravel:
        """Return the travel of a point (3,) [m] of the body while the echoes of a ping arrive."""
        return self.voyage.trajectory.carried(position).during(self.track.time[[ping]], self.time[-1]).trimmed()
