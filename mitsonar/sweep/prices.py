"""Prices of a sweep from an estimate: core hours and months of storage, at rates that the user gives."""
import math
from dataclasses import dataclass

from mitsonar.device.machine import cores

from .estimate import Estimate, SceneCost
from .values import shortened

MANY = 1000                        # renders that prices are also said of
LONGEST = 20                       # letters of a currency


@dataclass(frozen=True, kw_only=True)
class Rates:
    """Rates of a provider; None: not asked for."""

    core_hour: float | None = None
    gb_month: float | None = None
    currency: str = ""

    def __post_init__(self):
        for name, rate in (("core hour", self.core_hour), ("GB and month", self.gb_month)):
            if rate is not None and not 0 <= rate < math.inf:
                raise ValueError(f"the rate of a {name} is {rate:g}; give a number of at least 0, such as 0.04")
        if len(self.currency) > LONGEST or not self.currency.isprintable():
            raise ValueError(f"the currency is {shortened(self.currency)}; give a short text, such as EUR")

    def price(self, hours: float, size: float) -> str:         # size [bytes]
        """Return the price of core hours, and that of storage per month, as text."""
        parts = [*([self._money(hours * self.core_hour)] if self.core_hour is not None else []),
                 *([f"{self._money(size / 1e9 * self.gb_month)} a month"] if self.gb_month is not None else [])]
        return " and ".join(parts)

    def _money(self, amount):
        return f"{amount:,.2f}" * (amount >= 1) + f"{amount:.2g}" * (amount < 1) + f" {self.currency}".rstrip()


def core_hours(seconds: float, threads: int, renders: int) -> float:
    """Return the core hours of renders of that many seconds each, on cores like those of this machine."""
    return seconds * min(threads, cores()) / 3600 * renders


def costs(each: Estimate | SceneCost, threads: int, rates: Rates, renders: int) -> tuple[float, float, str]:
    """Return the core hours, the bytes and the price of that many renders, by the means of a plan or a scene."""
    hours, size = core_hours(each.seconds or 0.0, threads, renders), (each.bytes or 0.0) * renders
    return hours, size, rates.price(hours, size)
