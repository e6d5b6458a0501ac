"""What a problem with a name is: what it asks for, what answers it, and the answer."""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Options", "Problem", "Progress", "Solved", "beliefs", "image_of"]

Options = Mapping[str, Any]        # what was given, by the options' names, in the units of the command line
Progress = Callable[[float, float], object]


@dataclass(frozen=True, kw_only=True)
class Solved:
    """An answer.

    Attributes
    ----------
    dataset : xarray.Dataset
        For a file.
    sentences : list of str
        What was done, and what was observable.
    """

    dataset: xr.Dataset
    sentences: list[str]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A problem with a name.

    Parameters
    ----------
    asks : str
        The inputs, as the help says them.
    summary : str
    takes : tuple of str
        Names of options.
    solve : callable
        Of inputs, options and progress.
    """

    asks: str
    summary: str
    takes: tuple[str, ...]
    solve: Callable[[Sequence[str], Options, Progress], Solved]


def image_of(record: str) -> xr.Dataset:
    """Read the image of a file.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is none, or it holds something else.
    """
    import xarray as xr

    from ..io import reading

    image = reading.read(record)
    if not isinstance(image, xr.Dataset):
        raise ValueError(f"{record} holds no image; give an EXR or netCDF file of one")
    return image


def beliefs(texts: Sequence[str], names: Sequence[str]) -> dict[str, float]:
    """Read NAME=DEVIATION of some names.

    Raises
    ------
    ValueError
        If a name is none of them or stands twice, or a deviation is no number of 0 or more.
    """
    import math

    from ..spelling import meant

    found: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        if name not in names:
            raise ValueError(f"{text!r} is of none of {', '.join(names)}{meant(name, names)}; give NAME=DEVIATION")
        try:
            deviation = float(number)
        except ValueError:
            deviation = math.nan
        if not (math.isfinite(deviation) and deviation >= 0):
            raise ValueError(f"{text!r} has no deviation of 0 or more; say how far {name} may be off, such as "
                             f"{name}=0.01")
        if name in found:
            raise ValueError(f"{name} is given twice; leave one out")
        found[name] = deviation
    return found
