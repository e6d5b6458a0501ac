"""Dates and hours of pings as XTF has them."""
import numpy as np

__all__ = ["clock"]

EARLIEST, LATEST = "1970-01-01", "10000-01-01"


def clock(time: np.ndarray, ticks: int) -> dict[str, np.ndarray]:
    """Split times into the calendar's fields.

    Parameters
    ----------
    time : array (P,) [s]
        Since 1970, UTC.
    ticks : int
        Into how many parts a second is divided; times are rounded to them.

    Returns
    -------
    dict
        Year, Month, Day, Hour, Minute, Second, ``Tick`` (of the second) and JulianDay (1 on the first of January), each
        an int64 array (P,).

    Raises
    ------
    ValueError
        If a time lies before 1970 or after the year 9999.
    """
    first, last = (np.datetime64(day, "s").astype(np.int64) for day in (EARLIEST, LATEST))
    outside = np.flatnonzero(~((time >= first) & (time < last)))
    if outside.size:
        raise ValueError(f"ping {outside[0]} is at {time[outside[0]]:.6g} s from 1970; XTF holds the years 1970 to "
                         "9999: give another start.")
    whole = np.rint(np.asarray(time, float) * ticks).astype(np.int64)
    second, tick = np.divmod(whole, ticks)
    day, rest = np.divmod(second, 86400)
    date = day.astype("datetime64[D]")
    month, year = date.astype("datetime64[M]"), date.astype("datetime64[Y]")
    return {"Year": year.astype(np.int64) + 1970, "Month": month.astype(np.int64) % 12 + 1,
            "Day": (date - month).astype(np.int64) + 1, "Hour": rest // 3600, "Minute": rest // 60 % 60,
            "Second": rest % 60, "Tick": tick, "JulianDay": (date - year).astype(np.int64) + 1}
