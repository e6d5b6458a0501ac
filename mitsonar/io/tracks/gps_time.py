"""Clocks of navigation that counts seconds of a GPS week, from midnight to Sunday.

GPS time runs ahead of UTC by the leap seconds since 1980 (IERS Bulletin C).
"""
from __future__ import annotations

from datetime import datetime, timedelta, timezone

import numpy as np

WEEK = 7 * 86400.0                 # [s]
EPOCH = datetime(1980, 1, 6, tzinfo=timezone.utc).timestamp()
# dates since which GPS time is ahead of UTC by 1, 2, 3 ... s
_LEAPS = ("1981-07", "1982-07", "1983-07", "1985-07", "1988-01", "1990-01", "1991-01", "1992-07", "1993-07", "1994-07",
          "1996-01", "1997-07", "1999-01", "2006-01", "2009-01", "2012-07", "2015-07", "2017-01")
_SINCE = np.array([datetime.fromisoformat(f"{month}-01T00:00:00+00:00").timestamp() for month in _LEAPS])


def ahead(time: float) -> float:
    """Return by how many seconds GPS time is ahead of UTC at a time [s] since 1970."""
    return float(np.searchsorted(_SINCE, time, side="right"))


def week_of(time: float) -> float:
    """Return the beginning [s] since 1970 of the week, from Sunday on, that holds a time [s] since 1970."""
    return float(EPOCH + np.floor((time - EPOCH) / WEEK) * WEEK)


def instant(text: str, what: str) -> float:
    """Return the time [s] since 1970 of a date in ISO 8601; `what` names it in the error."""
    try:
        found = datetime.fromisoformat(text.strip().replace("Z", "+00:00"))
        found = found if found.tzinfo else found.replace(tzinfo=timezone.utc)
        if not timedelta(0) <= found - datetime(1980, 1, 6, tzinfo=timezone.utc) < timedelta(days=60000):
            raise ValueError
    except ValueError:
        raise ValueError(f"the {what} is {text!r}; give a date such as 2026-05-01.") from None
    return found.timestamp()


def date(time: float) -> str:
    """Return the date of a time [s] since 1970, to the second, for messages."""
    if not -6e10 < time < 2e11:                           # in the years that `datetime` has
        return f"{time:g} s after 1970"
    return (datetime(1970, 1, 1) + timedelta(seconds=round(float(time)))).isoformat(" ") + " UTC"


def unwrapped(seconds: np.ndarray) -> np.ndarray:
    """Return seconds of the week (N,) that run on where a new week begins."""
    return np.unwrap(seconds, period=WEEK)
