"""Raw echoes of a synthetic aperture, as the command signals writes them: ping by ping, going on where it was ended."""
from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from .progress import Progress, duration
from .words import InterruptSignals, announce, warn

if TYPE_CHECKING:
    import mitsuba as mi
    import xarray as xr

WORTH_SAYING = 10.0                # [s]; less is a moment
OF_ARRAYS = (("--ping", "ping", None), ("--response", "response", False), ("--kernel", "kernel", "band_limited"),
             ("--return-path", "return_path", "vector"), ("--path", "path", None))


def is_strip(scene: mi.Scene, sensor: int | str) -> bool:
    """Tell whether a scene's sensor of that number or id is a synthetic aperture."""
    from mitsonar.survey.kinds import KINDS, kind_of
    from mitsonar.verbs.images import opened

    return kind_of(opened(scene, sensor)[1]) is KINDS["synthetic_aperture"]


def write_strip(arguments: argparse.Namespace, scene: mi.Scene) -> None:
    """Write the raw echoes of a scene's synthetic aperture."""
    from mitsonar.device.files import check_writable
    from mitsonar.io.records import netcdf, raw_echoes
    from mitsonar.verbs.strips import raw_pings, scatterers

    for option, name, usual in OF_ARRAYS:
        if getattr(arguments, name) != usual:
            raise ValueError(f"{option} is of arrays whose pings stand alone, and this sensor is a synthetic_aperture; "
                             "leave it out.")
    if arguments.scatterers is not None:
        _check_beside(arguments.scatterers, arguments.output)
        netcdf.write(scatterers(scene, sensor=arguments.sensor), arguments.scatterers)
        announce(arguments.scatterers)
    counts: list[int] = []
    start = raw_echoes.written(arguments.output)
    planned = raw_pings(scene, arguments.seed, sensor=arguments.sensor, count=counts.append)
    if InterruptSignals.active is not None:
        InterruptSignals.active.left = raw_echoes.part_of(check_writable(arguments.output))
    with Progress() as progress:
        def pings_from(number: int) -> Iterator[xr.Dataset]:
            made = planned if number == 0 else raw_pings(scene, arguments.seed, sensor=arguments.sensor, start=number)
            return _told(made, number, counts[0])

        raw_echoes.write(pings_from, arguments.output, count=counts[0],
                         progress=lambda done, total: progress(done - start, total - start))
    announce(arguments.output)
    if start:
        warn(f"{start} of {counts[0]} pings were there from before")


def _size(size: int) -> str:
    return f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"


def _check_beside(path: str, output: str) -> None:
    """Refuse a name for the scatterers that is no netCDF file's, or that of the echoes."""
    if os.path.splitext(path)[1].lower() != ".nc":
        raise ValueError(f"cannot write {path}: its name must end in .nc")
    if os.path.realpath(path) == os.path.realpath(output):
        raise ValueError(f"{path} is asked for scatterers and for echoes; give another name.")


def _told(made: Iterator[xr.Dataset], start: int, count: int) -> Iterator[xr.Dataset]:
    """The pings, and after the first a sentence on how much all are, where that is more than a moment."""
    from mitsonar.io.records.raw_echoes import size_of

    began = time.monotonic()
    for number, one in enumerate(made, start):
        seconds = (time.monotonic() - began) * (count - start)
        if number == start and seconds > WORTH_SAYING:
            shape = one["signal"].shape
            warn(f"{count - start} pings of {shape[1]} receivers x {shape[2]} samples: {_size(size_of(one, count))}, "
                 f"at most about {duration(seconds)}; if interrupted, the same command goes on")
        yield one
