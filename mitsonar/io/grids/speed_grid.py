"""Sound speed on a grid in a netCDF-4 file, by its CF names: an ocean model's, or a section.

    speed_of_sound_in_sea_water                                      or, by TEOS-10,
    sea_water_temperature, or sea_water_potential_temperature, with sea_water_salinity or sea_water_practical_salinity
    over depth, and any of time, projection_y_coordinate or latitude, projection_x_coordinate or longitude

x and y are metres in the scene. A section lacks x or y, and is the same along the other one. Cells without a value, on
land or below the bed, take that of the nearest cell that has one.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath, check_readable
from mitsonar.water.fields import GridField
from mitsonar.water.profile import FASTEST, SLOWEST, SoundSpeedProfile
from mitsonar.water.seawater import sound_speed

from ..records.netcdf import dataset_in

SPEED = ("speed_of_sound_in_sea_water",)
TEMPERATURE = ("sea_water_temperature", "sea_water_potential_temperature")
SALINITY = ("sea_water_salinity", "sea_water_practical_salinity")
AXES = {"time": ("time",), "depth": ("depth",), "y": ("projection_y_coordinate", "latitude"),
        "x": ("projection_x_coordinate", "longitude")}
MOST = {"x": 128, "y": 128, "depth": 96}      # nodes of a field
AROUND = 2000.0                    # [m] around the track that a field covers
DATED = 1e8                        # [s] above which times of a track count from 1970
MOST_NUMBERS = 100_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedGrid:
    """Sound speed on a grid, not yet placed in a scene."""

    path: str
    time: np.ndarray | None  # (T,) [s]: since 1970; None for one time
    depth: np.ndarray  # (Z,) [m]: increasing
    y: np.ndarray | None  # (Y,) [m] or [degrees]: increasing; None if the grid does not change along y
    x: np.ndarray | None  # (X,) the same
    geographic: bool  # True for degrees
    speed: np.ndarray  # (T, Z, Y, X) [m/s]

    @property
    def profile(self) -> SoundSpeedProfile:
        """Return the mean profile."""
        return SoundSpeedProfile(self.depth, self.speed.mean((0, 2, 3)))

    def placed(self, frame: Frame | None, track: np.ndarray, start: float) -> GridField:
        """Return the field around a track (P, 2) [m] that begins at `start` [s]."""
        from scipy.interpolate import RegularGridInterpolator

        if self.time is not None and len(self.time) > 1 and start < DATED:
            raise ValueError(f"{self.path} has {len(self.time)} times, and the track has no dates; give the track "
                             "dates, or a grid of one time.")
        if self.geographic and frame is None:
            raise ValueError(f"{self.path} has latitudes and longitudes, but the scene has no place on Earth; give the "
                             "sonar an origin, or the grid x and y.")
        low, high = track.min(0) - AROUND, track.max(0) + AROUND
        axes = {"depth": _even(self.depth, MOST["depth"])}
        for k, name in enumerate("xy"):
            axis = getattr(self, name)
            if axis is None:
                axes[name] = np.array([low[k], high[k]])
            elif self.geographic:
                axes[name] = np.linspace(low[k], high[k], MOST[name])
            else:
                if axis[0] > high[k] or axis[-1] < low[k]:
                    raise ValueError(f"{self.path} spans {name} = {axis[0]:.0f} to {axis[-1]:.0f} m, and the track "
                                     "lies elsewhere; check its coordinates.")
                axes[name] = _even(axis[(axis > low[k] - np.ptp(axis)) & (axis < high[k] + np.ptp(axis))], MOST[name])
        x, y = np.meshgrid(axes["x"], axes["y"], indexing="ij")
        if self.geographic and frame is not None:
            place = frame.on_globe(np.stack([x.ravel(), y.ravel()], -1))
            y, x = (part.reshape(x.shape) for part in place[:2])
            self._check_degrees(y, x)
        nodes = [axis for axis in (self.depth, self.y, self.x) if axis is not None]
        places = [np.broadcast_to(part, (len(axes["depth"]), *x.shape)) for axis, part in (
            (self.depth, axes["depth"][:, None, None]), (self.y, y), (self.x, x)) if axis is not None]
        held = np.stack([np.clip(part, axis[0], axis[-1]) for axis, part in zip(nodes, places)], -1)
        speed = []
        for values in self.speed:
            kept = values[:, :, 0] if self.x is None else values
            kept = kept[:, 0] if self.y is None else kept
            speed.append(np.moveaxis(RegularGridInterpolator(nodes, kept)(held), 0, -1))
        return GridField(corner=tuple(float(axes[name][0]) for name in ("x", "y", "depth")),
                         step=tuple(float(axes[name][1] - axes[name][0]) for name in ("x", "y", "depth")),
                         speed=np.stack(speed), time=self.time)

    def _check_degrees(self, latitude: np.ndarray, longitude: np.ndarray) -> None:
        for name, axis, there in (("latitude", self.y, latitude), ("longitude", self.x, longitude)):
            if axis is not None and (axis[0] > there.max() or axis[-1] < there.min()):
                raise ValueError(f"{self.path} spans {name} {axis[0]:.3f} to {axis[-1]:.3f} degrees, and the track "
                                 f"lies at {there.mean():.3f}; give a grid of this sea.")


def _even(axis: np.ndarray, most: int) -> np.ndarray:
    """Return an even axis over the same range, at least as fine, of at most so many nodes."""
    finest = float(np.diff(axis).min()) if len(axis) > 1 else 1.0
    count = int(np.clip(np.ceil(np.ptp(axis) / finest - 1e-9) + 1, 2, most))
    return np.linspace(axis[0], axis[-1] if len(axis) > 1 else axis[0] + 1.0, count)


def read(path: FilePath) -> SpeedGrid:
    """Read a grid of sound speed; raise `ValueError` if the file holds none."""
    check_readable(path, "the field", "a netCDF file")
    with dataset_in(path) as dataset:
        named = {str(variable.attrs.get("standard_name", "")): name for name, variable in dataset.variables.items()}
        speed = _first(dataset, named, SPEED)
        if speed is None:
            temperature, salinity = _first(dataset, named, TEMPERATURE), _first(dataset, named, SALINITY)
            if temperature is None or salinity is None:
                raise ValueError(f"cannot read the field {path}: no variable has the standard_name {SPEED[0]}, or "
                                 f"{TEMPERATURE[0]} with {SALINITY[0]}; name the variables so (CF conventions).")
            variables = [temperature, salinity]
        else:
            variables = [speed]
        axes = {what: next((named[name] for name in names if name in named), None) for what, names in AXES.items()}
        if axes["depth"] is None or (axes["x"] is None and axes["y"] is None):
            raise ValueError(f"cannot read the field {path}: it needs coordinates with the standard_names depth, and "
                             "projection_x_coordinate or longitude, or the same for y.")
        geographic = any(one in named for one in ("latitude", "longitude"))
        numbers, arrays = {}, []
        for what, name in axes.items():
            if name is not None:
                numbers[what] = np.atleast_1d(dataset[name].values)
                if dataset[name].ndim > 1:
                    raise ValueError(f"cannot read the field {path}: {name} has {dataset[name].ndim} dimensions; give "
                                     "a grid with one latitude a row and one longitude a column.")
        for variable in variables:
            if variable.size > MOST_NUMBERS:
                raise ValueError(f"cannot read the field {path}: it has {variable.size} numbers; cut out the scene's "
                                 "part.")
            order = [dataset[axes[what]].dims[0] if axes[what] is not None and dataset[axes[what]].ndim else None
                     for what in ("time", "depth", "y", "x")]
            extra = set(variable.dims) - set(order)
            if extra or order[1] not in variable.dims:
                raise ValueError(f"cannot read the field {path}: {variable.name} has the dimensions "
                                 f"{', '.join(map(str, variable.dims))}; it takes time, depth, y and x.")
            kept = [dim for dim in order if dim in variable.dims]
            values = variable.transpose(*kept).values.astype(float)
            arrays.append(values.reshape([variable.sizes[dim] if dim in variable.dims else 1 for dim in order]))
    potential = str(variables[0].attrs["standard_name"]) == TEMPERATURE[1]
    return _grid(str(path), numbers, arrays, potential, geographic)


def _grid(path: str, numbers: dict[str, np.ndarray], arrays: list[np.ndarray], potential: bool,
          geographic: bool) -> SpeedGrid:
    """Return the grid of numbers along axes, and of the sound speed, or temperature and salinity, (T, Z, Y, X) each."""
    time = None
    if "time" in numbers:
        time = numbers["time"]
        time = time.astype("datetime64[ns]").astype(np.int64) * 1e-9 if time.dtype.kind == "M" else time.astype(float)
        if np.any(np.diff(time) <= 0):
            raise ValueError(f"cannot read the field {path}: its times run back; sort them.")
    axes = {}
    for k, what in enumerate(("depth", "y", "x"), 1):
        if what in numbers and len(numbers[what]) > 1:
            axis = numbers[what].astype(float)
            order = np.argsort(axis)
            if np.any(np.diff(axis[order]) <= 0) or not np.isfinite(axis).all():
                raise ValueError(f"cannot read the field {path}: its {what} repeats a number or lacks one.")
            axes[what], arrays = axis[order], [np.take(array, order, k) for array in arrays]
    if "depth" not in axes or axes["depth"][0] < 0:
        raise ValueError(f"cannot read the field {path}: depth needs two or more numbers, positive down.")
    depth = axes["depth"][:, None, None]
    if len(arrays) == 2:
        temperature, salinity = arrays
        if potential:
            import gsw

            pressure = gsw.p_from_z(-depth, 45.0)
            temperature = gsw.pt_from_t(gsw.SR_from_SP(salinity), temperature, 0.0, pressure)
        speed = np.full(temperature.shape, np.nan)
        known = np.isfinite(temperature) & np.isfinite(salinity)
        speed[known] = sound_speed(temperature[known], salinity[known], np.broadcast_to(depth, speed.shape)[known])
    else:
        speed = arrays[0]
    return SpeedGrid(path=path, time=time, depth=axes["depth"], y=axes.get("y"), x=axes.get("x"), geographic=geographic,
                     speed=_filled(path, speed))


def _filled(path: str, speed: np.ndarray) -> np.ndarray:
    """Return sound speeds with missing ones from the nearest cell of the same time."""
    from scipy.ndimage import distance_transform_edt

    known = np.isfinite(speed)
    wrong = known & ((speed <= SLOWEST) | (speed >= FASTEST))
    if wrong.any() or not known.reshape(len(speed), -1).any(1).all():
        said = f"a sound speed of {speed[wrong][0]:g} m/s" if wrong.any() else "a time without any sound speed"
        raise ValueError(f"cannot read the field {path}: it has {said}; check its variable and units.")
    if known.all():
        return speed
    return np.stack([values[tuple(distance_transform_edt(~there, return_distances=False, return_indices=True))]
                     for values, there in zip(speed, known)])


def _first(dataset: xr.Dataset, named: dict[str, str], names: tuple[str, ...]) -> xr.DataArray | None:
    """Return the variable with the first of some standard names; None without one."""
    return next((dataset[named[name]] for name in names if name in named), None)
