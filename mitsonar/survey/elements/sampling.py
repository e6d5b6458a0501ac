"""When the samples of a record are taken, and about which carrier."""
from __future__ import annotations

from dataclasses import dataclass

from ...device.types import Float, Float64, Int32
from ...signal.accumulation import centre

__all__ = ["Sampling"]


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """The samples of a record in complex baseband.

    Attributes
    ----------
    start : float [s]
        Time of sample 0, from the transmission on.
    sampling_rate, frequency : float [Hz]
        Of the samples; of the carrier.
    """

    start: float
    sampling_rate: float
    frequency: float

    def place(self, delay: Float64) -> tuple[Float, Int32, Float]:
        """Give the carrier phase [cycles], the sample and the fraction of a sample of delays (R,) [s]; see `centre`."""
        return centre(delay, start=self.start, frequency=self.frequency, sampling_rate=self.sampling_rate)
