"""Requirements of IHO S-44 (edition 6.1.0, 2022, table 1) on the uncertainty of soundings.

    TVU = sqrt(a² + (b d)²)          THU = e + f d          at 95 %

d -> depth; a, b, e, f -> coefficients of the order; TVU, THU -> total vertical and horizontal uncertainty. Features to
detect are cubes of a side that for order 1a grows from 40 m of depth on to a tenth of the depth.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from mitsonar.units import Values

__all__ = ["HORIZONTAL_95", "ORDERS", "VERTICAL_95", "SurveyOrder", "survey_order", "vertical_orders"]

VERTICAL_95 = 1.96                 # 95 % in standard deviations of a depth
HORIZONTAL_95 = 2.448 / 2**0.5     # of a distance, the same in all directions: 2.448 of each coordinate
FEATURE_DEPTH = 40.0               # [m] from which on features of order 1a grow with the depth


@dataclass(frozen=True, kw_only=True)
class SurveyOrder:
    """Order of S-44: coefficients a [m], b, e [m], f, the share of the area to cover, and features to detect.

    ``feature`` [m] is the side of the least feature to detect, and ``feature_share`` its share of the depth where that
    is larger; None and 0 if the order does not ask for features.
    """

    name: str
    a: float
    b: float
    e: float
    f: float
    coverage: float
    feature: float | None = None
    feature_share: float = 0.0

    def vertical(self, depth: Values) -> Values:
        """Return the allowed total vertical uncertainty [m], 95 %, at a depth [m]."""
        return cast(Values, np.hypot(self.a, np.multiply(self.b, depth)))

    def horizontal(self, depth: Values) -> Values:
        """Return the allowed total horizontal uncertainty [m], 95 %, at a depth [m]."""
        return cast(Values, np.add(self.e, np.multiply(self.f, depth)))

    def least_feature(self, depth: float) -> float | None:
        """Return the side [m] of the least feature to detect at a depth [m]; None if the order asks for none."""
        if self.feature is None:
            return None
        return max(self.feature, self.feature_share * depth if depth > FEATURE_DEPTH else 0.0)


ORDERS = {one.name: one for one in (
    SurveyOrder(name="exclusive", a=0.15, b=0.0075, e=1.0, f=0.0, coverage=2.0, feature=0.5),
    SurveyOrder(name="special", a=0.25, b=0.0075, e=2.0, f=0.0, coverage=1.0, feature=1.0),
    SurveyOrder(name="1a", a=0.5, b=0.013, e=5.0, f=0.05, coverage=1.0, feature=2.0, feature_share=0.1),
    SurveyOrder(name="1b", a=0.5, b=0.013, e=5.0, f=0.05, coverage=0.05),
    SurveyOrder(name="2", a=1.0, b=0.023, e=20.0, f=0.1, coverage=0.05))}


def vertical_orders() -> dict[str, SurveyOrder]:
    """Return one order for each vertical limit, by the names of all orders that share it, such as "1a, 1b"."""
    names: dict[tuple[float, float], list[str]] = {}
    for order in ORDERS.values():
        names.setdefault((order.a, order.b), []).append(order.name)
    return {", ".join(alike): ORDERS[alike[0]] for alike in names.values()}


def survey_order(name: str) -> SurveyOrder:
    """Return an order by its name; raise ValueError for an unknown name."""
    if name not in ORDERS:
        raise ValueError(f"S-44 has no order {name!r}; choose one of {', '.join(ORDERS)}.")
    return ORDERS[name]
