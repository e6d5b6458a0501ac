"""Input and output of beamformers: labelled element signals in, labelled beams out.

An echo of amplitude a and delay τ reaches an element as a s_b(t - τ) exp(-2πi f0 τ): complex baseband about f0, time
counted from the ping's transmission. Positions are in the body frame (x forward, y starboard, z down), metres from the
array's centre, or for synthetic apertures in any frame that elements and focal points share.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.sonar.arrays.axes import body_direction
from mitsonar.sonar.arrays.shading import window_weights

Shading: TypeAlias = None | str | tuple | ArrayLike
DIMENSIONS = ("ping", "tx", "rx", "sample")
STRAIGHTNESS = 0.02                # wavelengths an element of a uniform line may lie off its place


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Element signals with all numbers that a beamformer needs."""

    values: np.ndarray
    receivers: np.ndarray  # [m]
    transmitters: np.ndarray  # [m]
    start: float  # [s]: time of the first sample
    sampling_rate: float  # [Hz]
    frequency: float  # [Hz]
    sound_speed: float  # [m/s]
    signals: xr.DataArray  # what it was read from, dimensions in order

    @property
    def wavelength(self) -> float:
        """Wavelength at the centre frequency [m]."""
        return self.sound_speed / self.frequency

    @property
    def time(self) -> np.ndarray:
        """Time of the samples [s], float64 (sample,)."""
        return self.start + np.arange(self.values.shape[-1]) / self.sampling_rate


def directions(azimuth: ArrayLike, elevation: ArrayLike = 0.0) -> np.ndarray:
    """Make unit vectors in the body frame.

    Examples
    --------
    >>> directions(np.pi / 2, -np.pi / 6).round(6)
    array([0.      , 0.866025, 0.5     ])
    """
    # azimuth [rad]; elevation [rad] -> (..., 3)
    return body_direction(azimuth, -np.asarray(elevation, float))


def look_directions(vectors: ArrayLike) -> np.ndarray:
    """Check look directions and normalise them: float64 (B, 3)."""
    vectors = np.atleast_2d(np.asarray(vectors, float))
    if vectors.ndim != 2 or vectors.shape[1] != 3 or not len(vectors):
        raise ValueError(f"look directions have shape {vectors.shape}; give (beams, 3), for example from directions()")
    length = np.linalg.norm(vectors, axis=1)
    if not (np.isfinite(length).all() and (length > 0).all()):
        bad = int(np.flatnonzero(~(np.isfinite(length) & (length > 0)))[0])
        raise ValueError(f"look direction {bad} is {vectors[bad]}; give a finite vector that is not zero")
    return vectors / length[:, None]


def read_recording(signals: xr.DataArray) -> Recording:
    """Read and check element signals."""
    unknown = set(signals.dims) - set(DIMENSIONS)
    missing = {"rx", "sample"} - set(signals.dims)
    if unknown or missing:
        raise ValueError(f"element signals have dimensions {tuple(signals.dims)}; a beamformer takes (ping, tx, rx, "
                         "sample), of which ping and tx may be missing")
    if not np.iscomplexobj(signals.values):
        raise ValueError(f"element signals are {signals.dtype}; a beamformer takes complex baseband")
    signals = signals.expand_dims([name for name in ("ping", "tx") if name not in signals.dims])
    signals = signals.transpose(*DIMENSIONS)
    if not signals.size:
        raise ValueError(f"element signals are empty: {dict(signals.sizes)}; give at least one of each")
    values = np.ascontiguousarray(signals.values, np.complex64)
    if not np.isfinite(values.view(np.float32)).all():
        raise ValueError("element signals hold NaN or infinite samples; set samples that were not recorded to 0")
    start, rate = _time_axis(signals)
    numbers = {name: _positive(signals, name) for name in ("frequency", "sound_speed")}
    return Recording(values=values, receivers=_positions(signals, "rx"), transmitters=_positions(signals, "tx"),
                     start=start, sampling_rate=rate, signals=signals, **numbers)


def _positive(signals: xr.DataArray, name: str) -> float:
    value = signals.attrs.get(name)
    if value is None:
        raise ValueError(f"element signals have no attribute {name!r}; set signals.attrs[{name!r}]")
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"attribute {name!r} of the element signals is {value}; give a finite number > 0")
    return float(value)


def _time_axis(signals: xr.DataArray) -> tuple[float, float]:
    """Start [s] and sampling rate [Hz] of the coordinate `time`."""
    if "time" not in signals.coords or signals["time"].dims != ("sample",):
        raise ValueError("element signals have no coordinate 'time' over sample; a beamformer needs the time of every "
                         "sample since the transmission, in seconds")
    time = signals["time"].values.astype(float)
    if len(time) < 2:
        raise ValueError(f"element signals have {len(time)} sample; a beamformer needs at least 2 to know the rate")
    step = (time[-1] - time[0]) / (len(time) - 1)
    if not step > 0 or np.abs(time - time[0] - step * np.arange(len(time))).max() > 0.01 * step:
        raise ValueError("coordinate 'time' of the element signals does not rise in equal steps; resample them first")
    return float(time[0]), 1 / step


def _positions(signals: xr.DataArray, which: str) -> np.ndarray:
    """Return the positions of `rx` or `tx`, float64 (ping, elements, 3) [m]."""
    count, pings = signals.sizes[which], signals.sizes["ping"]
    names = [f"{which}_{axis}" for axis in "xyz"]
    missing = [name for name in names if name not in signals.coords]
    if len(missing) == 3 and which == "tx" and count == 1:
        return np.zeros((pings, 1, 3))                       # transmitted from the array's centre
    if missing:
        raise ValueError(f"element signals with {count} {which} have no coordinate {', '.join(missing)}; give the "
                         f"positions {', '.join(names)} over {which}, in metres from the array's centre")
    axes = []
    for name in names:
        found = signals[name]
        if not set(found.dims) <= {"ping", which}:
            raise ValueError(f"coordinate {name} has dimensions {tuple(found.dims)}; give it over ({which}) or "
                             f"(ping, {which})")
        axes.append(found.broadcast_like(signals[{"sample": 0, {"rx": "tx", "tx": "rx"}[which]: 0}])
                    .transpose("ping", which).values)
    position = np.stack(axes, axis=-1).astype(float)
    if not np.isfinite(position).all():
        raise ValueError(f"positions {', '.join(names)} of the element signals are not all finite")
    return position


def beam_signals(recording: Recording, values: np.ndarray, vectors: np.ndarray, method: str,
                 **coordinates: np.ndarray) -> xr.DataArray:
    """Label beams (ping, beam, sample) by the unit vectors (B, 3) they look along."""
    x, y, z = vectors.T
    beams = _labelled(recording, values, ("ping", "beam", "sample"), method)
    return beams.assign_coords({
        "time": ("sample", recording.signals["time"].values, {"units": "s"}),
        "beam_x": ("beam", x), "beam_y": ("beam", y), "beam_z": ("beam", z),
        "azimuth": ("beam", np.arctan2(y, x), {"units": "rad"}),
        "elevation": ("beam", -np.arcsin(np.clip(z, -1, 1)), {"units": "rad"}),
        **{name: ("beam", value) for name, value in coordinates.items()}})


def point_signals(recording: Recording, values: np.ndarray, points: np.ndarray, method: str) -> xr.DataArray:
    """Label focused values (ping, point) by the points (P, 3)."""
    return _labelled(recording, values, ("ping", "point"), method).assign_coords(
        {f"point_{axis}": ("point", column, {"units": "m"}) for axis, column in zip("xyz", points.T, strict=True)})


def _labelled(recording: Recording, values: np.ndarray, dims: tuple[str, ...], method: str) -> xr.DataArray:
    given = recording.signals
    kept = {name: value for name, value in given.coords.items() if value.dims in ((), ("ping",))}
    attrs = {**given.attrs, "beamformer": method}
    return type(given)(values, dims=dims, coords=kept, name=given.name, attrs=attrs)     # beams can do what signals can


def uniform_line(position: np.ndarray, wavelength: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the line on which elements lie in equal steps."""
    # position (E, 3) [m]; wavelength [m] -> first (3,) [m], axis (3,), pitch [m]
    count = len(position)
    if count < 2:
        raise ValueError(f"a fan of beams needs elements in a line with a pitch; the array has {count} element")
    apart = np.linalg.norm(np.diff(position, axis=0), axis=1)
    reach = position[-1] - position[0]
    pitch = np.linalg.norm(reach) / (count - 1)
    if apart.min() <= STRAIGHTNESS * wavelength:
        first = int(np.argmin(apart))
        raise ValueError(f"a fan of beams needs elements in a line with a pitch; rx elements {first} and {first + 1} "
                         f"coincide at {np.round(position[first], 6)} m: move or drop one, or use delay_and_sum")
    axis = reach / max(np.linalg.norm(reach), 1e-300)
    centre = position.mean(axis=0)
    steps = (np.arange(count) - (count - 1) / 2)[:, None] * pitch * axis
    off = np.linalg.norm(position - centre - steps, axis=1)
    if off.max() > STRAIGHTNESS * wavelength:
        worst = int(np.argmax(off))
        raise ValueError(f"a fan of beams needs elements in a line in equal steps; spacings reach from "
                         f"{apart.min():.6g} m to {apart.max():.6g} m and element {worst} stands {off[worst]:.3g} m "
                         f"({off[worst] / wavelength:.2g} wavelengths) off its place: use delay_and_sum")
    return centre + steps[0], axis, float(pitch)


def weights_of(window: Shading, recording: Recording) -> np.ndarray:
    """Return the weights of the receive elements, their sum 1."""
    count = recording.receivers.shape[1]
    if window is None and "rx_weight" in recording.signals.coords:
        weights = recording.signals["rx_weight"].values.astype(float)
    elif window is None:
        weights = np.ones(count)
    elif isinstance(window, (str, tuple)):
        if count > 1:
            uniform_line(recording.receivers[0], recording.wavelength)
        weights = window_weights(window, count)
    else:
        weights = np.asarray(window, float)
    if weights.shape != (count,) or not np.isfinite(weights).all():
        raise ValueError(f"weights have shape {weights.shape}; give {count} finite numbers, one per rx element")
    if abs(weights.sum()) < 1e-9 * max(np.abs(weights).sum(), 1e-300) or not weights.any():
        raise ValueError("weights of the rx elements add to 0, so no beam has a gain; give at least one that is not 0")
    return weights / weights.sum()
