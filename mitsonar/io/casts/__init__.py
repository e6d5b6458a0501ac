"""Sound-speed casts in the files of instruments and survey software, recognised by content, not by suffix.

`FORMATS` lists the known formats. A new format is one file, with a function that recognises its lines and a reader that
takes all lines and the number of a section and returns `Samples`, and a row in the list. The rest is common to all
formats: `completion` cleans the samples and computes missing quantities.
"""
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from mitsonar.device.files import FilePath, check_readable

from . import aml, caris, castaway, hypack, kongsberg, seabird, table, text, valeport
from .completion import EXTENSIONS, SOUND_SPEEDS, completed
from .records import Cast, Cleaning, Samples

__all__ = ["EXTENSIONS", "FORMATS", "SOUND_SPEEDS", "Cast", "Cleaning", "Format", "read"]


class Format(NamedTuple):
    """Format of casts: its name, the test of the lines that carry content, and the reader."""

    name: str
    recognises: Callable[[Sequence[str]], bool]
    reads: Callable[..., Samples]          # of the lines, and of the section if there are several
    several: bool = False                  # a file may hold several casts


# The table comes last, because it accepts most.
FORMATS = (
    Format("CARIS SVP", caris.recognises, caris.read, several=True),
    Format("CastAway CSV", castaway.recognises, castaway.read),
    Format("AML CSV", aml.recognises, aml.read),
    Format("Kongsberg ASVP", kongsberg.recognises, kongsberg.read),
    Format("Sea-Bird CNV", seabird.recognises, seabird.read),
    Format("HYPACK VEL", hypack.recognises, hypack.read),
    Format("Valeport MiniSVP", valeport.recognises, valeport.read),
    Format("table of depth and sound speed", table.recognises, table.read),
)


def read(path: FilePath, section: int = 0, *, sound_speed: str = "file", extension: str = "constant") -> Cast:
    """Read a cast.

    Parameters
    ----------
    path : str or path
        A file in one of `FORMATS`; the last of them is a plain table of depth [m] and sound speed [m/s], separated by
        commas, semicolons, tabs or spaces, with or without a header, with comments after #.
    section : int
        Number of the cast in a file with several casts, from 0.
    sound_speed : {"file", "teos-10"}
        The file's sound speed, computed only if missing; or sound speed by TEOS-10 from temperature and salinity (or
        conductivity) in any case.
    extension : {"constant", "gradient"}
        Sound speed below the deepest sample: its last value, or that of mixed water at rising pressure down to 12000 m,
        as in `completion`. Above the first sample it is constant.

    Returns
    -------
    Cast

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the file is too large, its format is unknown, a value is not a number or out of range, depths do not increase
        in a plain table (the line is named), a recording holds no water or no way down, data for the sound speed are
        missing, the section does not exist, or a choice is unknown.
    """
    for what, choice, choices in (("sound_speed", sound_speed, SOUND_SPEEDS), ("extension", extension, EXTENSIONS)):
        if choice not in choices:
            raise ValueError(f"{what} of a cast: {choice!r} is unknown; use one of {', '.join(choices)}.")
    path = Path(path)
    check_readable(path, "the cast", "the file of one cast")
    try:
        lines = text.read_lines(path)
        content = [line for line in lines or () if line.partition("#")[0].strip()]
        for known in FORMATS:
            if lines and content and known.recognises(content):
                if section and not known.several:
                    raise ValueError(f"section {section} does not exist; this format has one cast per file: leave "
                                     "section out.")
                samples = known.reads(lines, section) if known.several else known.reads(lines)
                return completed(samples, known.name, sound_speed, extension)
    except ValueError as error:
        raise ValueError(f"cannot read the cast {path}: {error}") from None
    what = "its content" if content else "it is empty, which" if lines is not None else "it is binary, which"
    raise ValueError(f"cannot read the cast {path}: {what} is none of the formats known "
                     f"({', '.join(known.name for known in FORMATS)}); convert it to a plain table of depth [m] and "
                     "sound speed [m/s].")
