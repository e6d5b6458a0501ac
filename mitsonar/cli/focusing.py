"""The command focus: focus raw echoes of a synthetic aperture, from a file or a scene, to an image."""
from __future__ import annotations

import argparse
import itertools
import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .arguments import Commands, add_scene, check_output, check_picture, number, parameters, set_up, whole
from .completion import add_file
from .progress import Progress, long_run
from .words import announce, warn

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from mitsonar.synthetic_aperture.focusing.grids import Grid
    from mitsonar.water.profile import SoundSpeedProfile

WINDOW = "taylor 4 30"
WIDEST_ANGLE = 64.0                # [degrees]


@dataclass(frozen=True, kw_only=True)
class Usual:
    """Default options; the sensor of a scene has its own."""

    grid: str = "ground"
    spacing: float | None = None           # [m]
    window: str = WINDOW
    range_window: str = WINDOW


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    command = commands.add_parser("focus", help="focus the raw echoes of a synthetic aperture to an image")
    add_scene(command, ", or a file of raw echoes")
    add_file(command, "-o", "--output", required=True, metavar="OUT.exr|nc|h5|tif", help="focused image")
    add_file(command, "--preview", metavar="OUT.png", help="also draw the image")
    command.add_argument("--grid", choices=("ground", "slant"),
                         help="image points on a level plane, or even in slant range; default: the scene's, or ground")
    command.add_argument("--spacing", metavar="M|ALONGxACROSS",
                         help="spacing of image points, such as 0.02 or 0.03x0.01; default: the scene's, or half the "
                              "resolution")
    command.add_argument("--along", nargs=2, type=number, metavar=("FROM", "TO"),
                         help="extent in metres along the track from the first ping; default: to the last ping")
    command.add_argument("--across", nargs=2, type=number, metavar=("FROM", "TO"),
                         help="extent in metres to starboard, of a slant grid in slant range; default: all recorded")
    command.add_argument("--depth", type=number, metavar="M",
                         help="depth of the plane; default: the mean depth of the bed")
    add_file(command, "--profile", metavar="CAST|M/S",
             help="water to focus with: the file of a cast, or one sound speed; default: that of the echoes")
    command.add_argument("--window", help="window over the aperture's angles: hann, boxcar ..., or none: the elements' "
                                          f"own beams; default: the scene's, or \"{WINDOW}\"")
    command.add_argument("--range-window", help="window over the pulse's band, likewise")
    command.add_argument("--angle", type=number, metavar="DEG",
                         help="widest angle from abreast to use; default: what the elements' lengths resolve")
    add_file(command, "--trajectory", metavar="TRACK.nc",
             help="file of another trajectory than the true one, with motion_time, motion_x and so on")
    command.add_argument("--interferogram", action="store_true",
                         help="add phase, coherence and height of the bed, from two banks of receivers")
    command.add_argument("--pings", nargs=2, type=whole, metavar=("FIRST", "LAST"), help="pings to use; default: all")
    command.set_defaults(run=_focus)


def _focus(arguments: argparse.Namespace) -> None:
    from mitsonar.io import reading

    check_output(arguments.output, reading.IMAGES)
    if arguments.angle is not None and not 0 < arguments.angle <= WIDEST_ANGLE:
        raise ValueError(f"--angle is {arguments.angle:g} degrees from abreast; give one above 0 and up to "
                         f"{WIDEST_ANGLE:g}.")
    check_picture(arguments.preview)
    set_up(arguments.threads)
    image = _of_file(arguments) if reading.is_netcdf(arguments.scene) else _of_scene(arguments)
    reading.write(image, arguments.output)
    announce(arguments.output)
    if arguments.preview is not None:
        from mitsonar import plots

        plots.preview(image, arguments.preview)
        announce(arguments.preview)


def _of_file(arguments: argparse.Namespace) -> xr.Dataset:
    """Return the image focused from echoes in a file, which is read ping by ping."""
    given = [option for option, value in (("-D", arguments.parameters), ("--seed", arguments.seed),
                                          ("--sensor", arguments.sensor)) if value]
    if given:
        raise ValueError(f"{given[0]} applies to scenes only, and {arguments.scene} holds raw echoes; leave it out.")
    from mitsonar.io.records import raw_echoes

    if os.path.exists(arguments.output) and os.path.samefile(arguments.scene, arguments.output):
        raise ValueError(f"{arguments.output} holds the raw echoes; give another name.")
    with raw_echoes.opened(arguments.scene) as record:
        first, last = _pings(arguments, record.sizes["ping"])
        chosen = record.isel(ping=slice(first, last + 1))
        return _focused(arguments, Usual(), chosen["ping_time"].values, raw_echoes.pings(chosen))


def _of_scene(arguments: argparse.Namespace) -> xr.Dataset:
    """Return the image focused from a scene's echoes, simulated ping by ping, with the truth."""
    from mitsonar.device.files import described
    from mitsonar.io.scene_files import scenes
    from mitsonar.scene.loading import load_for_sonar
    from mitsonar.survey.synthetic_aperture.image import with_truth
    from mitsonar.verbs.strips import raw_pings, strip_survey

    path = scenes.find(arguments.scene)
    if os.path.isfile(path) and (content := described(path)):
        raise ValueError(f"{path} is {content}; focus needs a scene (.xml), or raw echoes (.nc or .h5) that mitsonar "
                         "signals writes.")
    scene = load_for_sonar(path, **parameters(arguments))
    survey = strip_survey(scene, sensor=arguments.sensor)
    first, last = _pings(arguments, survey.track.pings)
    pings = raw_pings(scene, arguments.seed, sensor=arguments.sensor, start=first)
    times = survey.track.time[first:last + 1]
    usual = Usual(grid=survey.grid, spacing=survey.grid_spacing, window=survey.aperture_window,
                  range_window=survey.range_window)
    image = _focused(arguments, usual, times, itertools.islice(pings, len(times)))
    return with_truth(image, survey, arguments.seed)


def _focused(arguments: argparse.Namespace, usual: Usual, times: np.ndarray, pings: Iterator[xr.Dataset]) -> xr.Dataset:
    """Return the image focused from pings; only one ping is in memory at a time."""
    from mitsonar.io.reading import GEOTIFF
    from mitsonar.io.records.records import SonarImage
    from mitsonar.synthetic_aperture.focusing.focusing import Focuser

    navigated, profile = _trajectory(arguments.trajectory), _profile(arguments.profile)
    if (arguments.grid or usual.grid) == "slant" and os.path.splitext(arguments.output)[1].lower() in GEOTIFF:
        raise ValueError("a slant grid is not even on a map, and a GeoTIFF is; focus with --grid ground, or write "
                         ".exr, .nc or .h5.")
    first = next(pings)
    if arguments.interferogram and len(set(first["rx_bank"].values.tolist())) < 2:
        raise ValueError("--interferogram needs two banks of receivers, and these echoes have one; leave it out.")
    grid = _grid(arguments, usual, first if navigated is None else navigated, first, times)
    sine = None if arguments.angle is None else math.sin(math.radians(arguments.angle))
    window, range_window = (default if asked is None else asked for asked, default in (
        (arguments.window, usual.window), (arguments.range_window, usual.range_window)))
    focuser = Focuser(first, grid, profile, window=window, range_window=range_window, trajectory=navigated,
                      aperture=sine)
    total, began = len(times), time.monotonic()
    with Progress(verb="focusing") as progress:
        for done, ping in enumerate(itertools.chain([first], pings), 1):
            focuser.add(ping)
            progress(done, total)
            if done == 1 and (expected := long_run(began, total)):
                warn(f"{total} pings onto {' x '.join(map(str, grid.depth.shape))} points: {expected}; a coarser "
                     "--spacing, or a part --along and --across, is faster")
    image = focuser.image()
    if arguments.interferogram:
        from mitsonar.synthetic_aperture.products.interferometry import interferogram

        image = interferogram(image, first, trajectory=navigated)
    return SonarImage.of(image)


def _pings(arguments: argparse.Namespace, count: int) -> tuple[int, int]:
    """Return the first and the last ping of ``--pings``."""
    first, last = arguments.pings or (0, count - 1)
    if not 0 <= first < last < count:
        raise ValueError(f"pings {first} to {last} were asked for, and there are {count}, counted from 0; give two or "
                         "more of them.")
    return first, last


def _trajectory(path: str | None) -> xr.Dataset | None:
    """Read a trajectory from its own file or from a file of echoes, without their signals."""
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
    """Return the water of ``--profile``: a number is a sound speed, other text the file of a cast."""
    if text is None:
        return None
    try:
        return float(text)
    except ValueError:
        from mitsonar.io import casts

        return casts.read(text).profile


def _grid(arguments: argparse.Namespace, usual: Usual, trajectory: xr.Dataset, raw: xr.Dataset,
          times: np.ndarray) -> Grid:                  # (P,) [s]
    """Return the image grid that the options ask for."""
    import numpy as np

    from mitsonar.synthetic_aperture.focusing.grids import default_grid, ground_grid, slant_grid

    motion = {name: variable for name, variable in trajectory.variables.items() if str(name).startswith("motion_")}
    known = raw.drop_vars([name for name in raw.variables if str(name).startswith("motion_")]).assign(motion)
    if arguments.depth is not None:
        known = known.assign_attrs(bed_depth=arguments.depth)
    spacing = _spacing(arguments.spacing)
    full = default_grid(known, spacing=usual.spacing if spacing is None else spacing,
                        kind=arguments.grid or usual.grid, ping_time=times)
    if arguments.grid == "slant" and full.kind != "slant":
        raise ValueError("a slant grid lies beside a straight line, and this track is a circle; leave out --grid "
                         "slant.")
    if arguments.along is None and arguments.across is None:
        return full
    step = tuple(float(np.diff(axis[:2])[0]) if len(axis) > 1 else 1.0
                 for axis in (full.along_track, full.across_track)) if spacing is None else spacing
    along, across = ((float(ends[0]), float(ends[-1])) for ends in (
        full.along_track if arguments.along is None else arguments.along,
        full.across_track if arguments.across is None else arguments.across))
    place = {"origin": full.origin, "heading": full.heading}
    if full.kind == "ground":
        return ground_grid(along, across, (step[0], step[1]), known.attrs["bed_depth"], **place)
    farthest = int(np.argmax(np.abs(full.across_track)))
    depth = float(full.depth[0, farthest])
    height = np.sqrt(full.across_track[farthest] ** 2 - full.ground[farthest] ** 2)
    side = 1 if full.across_track[farthest] > 0 else -1
    if min(side * across[0], side * across[1]) < 0:
        raise ValueError(f"--across is {across[0]:g} to {across[1]:g} m; slant ranges to "
                         f"{'starboard are not below' if side > 0 else 'port are not above'} 0.")
    near, far = sorted((side * across[0], side * across[1]))
    return slant_grid(along, (near, far), (step[0], step[1]), depth, line_depth=depth - height, side=side, **place)


def _spacing(text: str | None) -> tuple[float, float] | None:
    """Return the spacings along and across of ``--spacing``: one number, or two with an x between them."""
    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.lower().split("x")]
        along, across = numbers if len(numbers) == 2 else numbers * 2
    except ValueError:
        raise ValueError(f"--spacing is {text!r}; give metres, such as 0.02, or along x across, such as 0.03x0.01."
                         ) from None
    return along, across
