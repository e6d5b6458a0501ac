"""The command focus: raw echoes of a synthetic aperture, from a file or made of a scene, to an image.

The grid that the options of the command focus ask for.
"""
from __future__ import annotations

import argparse
import itertools
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .arguments import Commands, add_scene, number, parameters, set_up, whole
from .completion import FILES, complete_with
from .progress import Progress, duration
from .words import announce, warn

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from mitsonar.synthetic_aperture.focusing.grids import Grid

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from mitsonar.water.profile import SoundSpeedProfile

WINDOW = "taylor 4 30"


@dataclass(frozen=True, kw_only=True)
class Usual:
    """What holds where an option is left out: of a scene what its sensor says."""

    grid: str = "ground"
    spacing: float | None = None  # [m]: none
    window: str = WINDOW
    range_window: str = WINDOW


def chosen_grid(arguments: argparse.Namespace, usual: Usual, trajectory: xr.Dataset, raw: xr.Dataset,
                times: np.ndarray) -> Grid:
    """Lay the grid."""
    # times (P,) [s]
    import numpy as np

    from mitsonar.synthetic_aperture.focusing.grids import default_grid, ground_grid, slant_grid

    motion = {name: variable for name, variable in trajectory.variables.items() if str(name).startswith("motion_")}
    known = raw.drop_vars([name for name in raw.variables if str(name).startswith("motion_")]).assign(motion)
    if arguments.depth is not None:
        known = known.assign_attrs(bed_depth=arguments.depth)
    spacing = _spacing(arguments.spacing)
    whole = default_grid(known, spacing=usual.spacing if spacing is None else spacing,
                         kind=arguments.grid or usual.grid, ping_time=times)
    if arguments.grid == "slant" and whole.kind != "slant":
        raise ValueError("a slant grid lies beside a straight line, and this track is a circle; leave out --grid "
                         "slant.")
    if arguments.along is None and arguments.across is None:
        return whole
    step = tuple(float(np.diff(axis[:2])[0]) if len(axis) > 1 else 1.0
                 for axis in (whole.along_track, whole.across_track)) if spacing is None else spacing
    along = _between(arguments.along, whole.along_track)
    across = _between(arguments.across, whole.across_track)
    place = {"origin": whole.origin, "heading": whole.heading}
    if whole.kind == "ground":
        return ground_grid(along, across, (step[0], step[1]), known.attrs["bed_depth"], **place)
    farthest = int(np.argmax(np.abs(whole.across_track)))
    depth = float(whole.depth[0, farthest])
    height = np.sqrt(whole.across_track[farthest] ** 2 - whole.ground[farthest] ** 2)
    side = 1 if whole.across_track[farthest] > 0 else -1
    if min(side * across[0], side * across[1]) < 0:
        raise ValueError(f"--across is {across[0]:g} to {across[1]:g} m; slant ranges to "
                         f"{'starboard are not below' if side > 0 else 'port are not above'} 0.")
    near, far = sorted((side * across[0], side * across[1]))
    return slant_grid(along, (near, far), (step[0], step[1]), depth, line_depth=depth - height, side=side, **place)


def _between(asked: list[float] | None, axis: np.ndarray) -> tuple[float, float]:
    return (float(axis[0]), float(axis[-1])) if asked is None else (float(asked[0]), float(asked[1]))


def _spacing(text: str | None) -> tuple[float, float] | None:
    """One number, or two with an x between."""
    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.lower().split("x")]
        along, across = numbers if len(numbers) == 2 else numbers * 2
    except ValueError:
        raise ValueError(f"--spacing is {text!r}; give metres, such as 0.02, or along x across, such as 0.03x0.01."
                         ) from None
    return along, across


WIDEST_ANGLE = 64.0                # [degrees]
WORTH_SAYING = 10.0                # [s]; less is a moment


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    command = commands.add_parser("focus", help="focus the raw echoes of a synthetic aperture to an image")
    add_scene(command, ", or a file of raw echoes")
    complete_with(command.add_argument("-o", "--output", required=True, metavar="OUT.exr|nc|h5|tif"), FILES)
    complete_with(command.add_argument("--preview", metavar="OUT.png", help="also draw it"), FILES)
    command.add_argument("--grid", choices=("ground", "slant"),
                         help="points of a level plane, or even in slant range; default: as the scene says, or ground")
    command.add_argument("--spacing", metavar="M|ALONGxACROSS", help="of its points, such as 0.02 or 0.03x0.01; "
                                                                     "default: as the scene says, or half the "
                                                                     "resolution")
    command.add_argument("--along", nargs=2, type=number, metavar=("FROM", "TO"),
                         help="metres along the track from the first ping; default: to the last")
    command.add_argument("--across", nargs=2, type=number, metavar=("FROM", "TO"),
                         help="metres to starboard, of a slant grid in slant range; default: all that is recorded")
    command.add_argument("--depth", type=number, metavar="M", help="of the plane; default: the mean depth of the bed")
    complete_with(command.add_argument("--profile", metavar="CAST|M/S",
                                       help="water to focus with: the file of a cast, or one sound speed; default: "
                                            "that of the echoes"), FILES)
    command.add_argument("--window", help=f"over the aperture's angles: \"{WINDOW}\", hann, boxcar ..., or none: the "
                                          "elements' own beams; default: as the scene says, or the first")
    command.add_argument("--range-window", help="over the pulse's band, likewise")
    command.add_argument("--angle", type=number, metavar="DEG",
                         help="widest angle from abreast that is used; default: what the elements' lengths resolve")
    complete_with(command.add_argument("--trajectory", metavar="TRACK.nc",
                                       help="file of another trajectory than the true one, with motion_time, motion_x "
                                            "and so on"), FILES)
    command.add_argument("--interferogram", action="store_true",
                         help="of two banks: also phase, coherence and height of the bed")
    command.add_argument("--pings", nargs=2, type=whole, metavar=("FIRST", "LAST"), help="of them; default: all")
    command.add_argument("--sensor", default=0, metavar="ID", help="which of a scene's sonars; default: the first")
    command.set_defaults(run=_focus)


def _focus(arguments: argparse.Namespace) -> None:
    from mitsonar.device.files import check_writable
    from mitsonar.io import reading
    from mitsonar.io.reading import is_netcdf

    check_writable(arguments.output)
    suffix = os.path.splitext(arguments.output)[1].lower()
    if arguments.angle is not None and not 0 < arguments.angle <= WIDEST_ANGLE:
        raise ValueError(f"--angle is {arguments.angle:g} degrees from abreast; give one above 0 and up to "
                         f"{WIDEST_ANGLE:g}.")
    if suffix not in reading.IMAGES:
        raise ValueError(f"cannot write {arguments.output}: its name says no kind of file; let it end in one of "
                         f"{', '.join(reading.IMAGES)}.")
    if arguments.preview is not None:
        from mitsonar.plots.canvas import file_format

        file_format(arguments.preview)
        check_writable(arguments.preview)
    set_up(arguments.threads)
    image = _of_file(arguments) if is_netcdf(arguments.scene) else _of_scene(arguments)
    reading.write(image, arguments.output)
    announce(arguments.output)
    if arguments.preview is not None:
        from mitsonar import plots

        plots.preview(image, arguments.preview)
        announce(arguments.preview)


def _of_file(arguments: argparse.Namespace) -> xr.Dataset:
    """The image of echoes in a file, read ping by ping."""
    given = [option for option, there in (("-D", arguments.parameters), ("--seed", arguments.seed),
                                          ("--sensor", arguments.sensor)) if there]
    if given:
        raise ValueError(f"{given[0]} is of scenes, and {arguments.scene} holds raw echoes; leave it out.")
    from mitsonar.io.records import raw_echoes

    if os.path.exists(arguments.output) and os.path.samefile(arguments.scene, arguments.output):
        raise ValueError(f"{arguments.output} holds the raw echoes; give another name.")
    with raw_echoes.opened(arguments.scene) as record:
        first, last = _pings(arguments, record.sizes["ping"])
        chosen = record.isel(ping=slice(first, last + 1))
        return _focused(arguments, Usual(), chosen["ping_time"].values, raw_echoes.pings(chosen))


def _of_scene(arguments: argparse.Namespace) -> xr.Dataset:
    """The image of a scene's echoes, made ping by ping, with its truth."""
    from mitsonar.device.files import described
    from mitsonar.io.scene_files import scenes
    from mitsonar.scene.loading import load_file
    from mitsonar.survey.synthetic_aperture.image import with_truth
    from mitsonar.verbs.strips import raw_pings, strip_survey

    path = scenes.find(arguments.scene)
    if os.path.isfile(path) and (what := described(path)):
        raise ValueError(f"{path} is {what}; focus needs a scene (.xml), or raw echoes (.nc or .h5) that mitsonar "
                         "signals writes.")
    scene = load_file(path, **parameters(arguments))
    survey = strip_survey(scene, sensor=arguments.sensor)
    first, last = _pings(arguments, survey.track.pings)
    made = raw_pings(scene, arguments.seed, sensor=arguments.sensor, start=first)
    times = survey.track.time[first:last + 1]
    usual = Usual(grid=survey.grid, spacing=survey.grid_spacing, window=survey.aperture_window,
                  range_window=survey.range_window)
    image = _focused(arguments, usual, times, (one for _, one in zip(times, made, strict=False)))
    return with_truth(image, survey, arguments.seed)


def _focused(arguments: argparse.Namespace, usual: Usual, times: np.ndarray, pings: Iterator[xr.Dataset]) -> xr.Dataset:
    """The image of pings, of which one is held at a time."""
    import math

    from mitsonar.io.records.records import SonarImage
    from mitsonar.synthetic_aperture.focusing.focusing import Focuser

    navigated, profile = _trajectory(arguments.trajectory), _profile(arguments.profile)
    _check_even(arguments, usual)
    one = next(pings)
    if arguments.interferogram and len(set(one["rx_bank"].values.tolist())) < 2:
        raise ValueError("--interferogram is of two banks of receivers, and these echoes have one; leave it out.")
    grid = chosen_grid(arguments, usual, one if navigated is None else navigated, one, times)
    sine = None if arguments.angle is None else math.sin(math.radians(arguments.angle))
    window, range_window = (known if asked is None else asked for asked, known in (
        (arguments.window, usual.window), (arguments.range_window, usual.range_window)))
    focuser = Focuser(one, grid, profile, window=window, range_window=range_window, trajectory=navigated, aperture=sine)
    total, began = len(times), time.monotonic()
    with Progress(verb="focusing") as progress:
        for done, ping in enumerate(itertools.chain([one], pings), 1):
            focuser.add(ping)
            progress(done, total)
            seconds = (time.monotonic() - began) * total
            if done == 1 and seconds > WORTH_SAYING:
                warn(f"{total} pings onto {' x '.join(map(str, grid.depth.shape))} points: at most about "
                     f"{duration(seconds)}; a coarser --spacing, or a part --along and --across, is faster")
    image = focuser.image()
    if arguments.interferogram:
        from mitsonar.synthetic_aperture.products.interferometry import interferogram

        image = interferogram(image, one, trajectory=navigated)
    return SonarImage.of(image)


def _check_even(arguments: argparse.Namespace, usual: Usual) -> None:
    """Refuse a slant grid in a GeoTIFF before there is one."""
    from mitsonar.io.reading import GEOTIFF

    if (arguments.grid or usual.grid) == "slant" and os.path.splitext(arguments.output)[1].lower() in GEOTIFF:
        raise ValueError("a slant grid is not even on a map, and a GeoTIFF is; focus with --grid ground, or write "
                         ".exr, .nc or .h5.")


def _pings(arguments: argparse.Namespace, count: int) -> tuple[int, int]:
    """The first and the last ping that are asked for."""
    first, last = arguments.pings or (0, count - 1)
    if not 0 <= first < last < count:
        raise ValueError(f"pings {first} to {last} were asked for, and there are {count}, counted from 0; give two or "
                         "more of them.")
    return first, last


def _trajectory(path: str | None) -> xr.Dataset | None:
    """The trajectory in a file, of its own or beside echoes, whose signals stay there."""
    if path is None:
        return None
    from mitsonar.io.records import netcdf

    with netcdf.opened(path) as record:
        names = [name for name in getattr(record, "variables", ()) if str(name).startswith("motion_")]
        if "motion_time" not in names:
            raise ValueError(f"{path} holds no trajectory; give a netCDF file with motion_time, motion_x, motion_y, "
                             "motion_depth, motion_roll, motion_pitch and motion_heading.")
        return record[names].load()


def _profile(text: str | None) -> SoundSpeedProfile | float | None:
    """The water that is asked for: a number is one sound speed, anything else a file."""
    if text is None:
        return None
    try:
        return float(text)
    except ValueError:
        from mitsonar.io import casts

        return casts.read(text).profile
