"""Delay-and-sum: every element is read when the echo from the focus reaches it, then all are added.

A beam along the unit vector u is focused anew for every sample of time t, at the point r u, r = c t / 2, from which an
echo sent and received in the array's centre would come at t; elements stand at their true places, so there is no far
field to wait for. Beyond a few array lengths this is the plane-wave beam (Johnson & Dudgeon 1993, ch. 4), close by it
is its dynamic focus. An echo of amplitude a in the look direction comes out as a, with the phase it would have at the
centre; noise that is independent from element to element goes down by Σw²/(Σw)².

The water is homogeneous here, at ``sound_speed``. Directions are as seen by the array at reception: an array that moves
on at v meanwhile receives a target's echo up to 2 v/c from where it stood at transmission.
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.device.arrays import upload
from mitsonar.device.turns import one_at_a_time
from mitsonar.device.types import DrJitArray

from .alignment import ElementSignals, Focus, dealt, device_arrays, to_complex
from .interpolation import RATE
from .recording import Recording, Shading, beam_signals, look_directions, point_signals, read_recording, weights_of

BLOCK = 1 << 22                    # values computed at once
FAR = 2.0 ** 30                    # samples; what lies further off is outside of any record


@one_at_a_time
def delay_and_sum(signals: xr.DataArray, directions: ArrayLike, *, window: Shading = None,
                  interpolation: str = "band_limited", like: DrJitArray | type | None = None) -> xr.DataArray:
    """Form beams along directions, focused at every range."""
    # directions (B, 3)
    recording = read_recording(signals)
    vectors = look_directions(directions)
    lib = device_arrays(like)
    array = ElementSignals(lib, recording, interpolation, weights_of(window, recording))
    pings, transmitters, _, samples = recording.values.shape
    beams = np.empty((pings, len(vectors), samples), np.complex64)
    together = max(1, BLOCK // samples)
    for ping in range(pings):
        array.load(ping, np.zeros(3))
        for begin in range(0, len(vectors), together):
            block = vectors[begin:begin + together]
            foci = ([beam_foci(array, block[group], transmitter) for group in dealt(len(block))]
                    for transmitter in recording.transmitters[ping])
            beams[ping, begin:begin + together] = array.summed(foci).reshape(-1, samples)[:len(block)]
    return beam_signals(recording, beams / transmitters, vectors, "delay_and_sum")


@one_at_a_time
def aligned(array: ElementSignals, vector: np.ndarray, transmitter: np.ndarray) -> np.ndarray:
    """Align the element signals of a ping for one look direction; their sum is `delay_and_sum`."""
    # vector (3,); transmitter (3,) [m]
    _, _, elements, samples = array.recording.values.shape
    foci = beam_foci(array, np.tile(vector, (elements, 1)), transmitter)
    number = dr.arange(array.lib.UInt32, elements * samples) // dr.opaque(array.lib.UInt32, samples)
    return to_complex(*array.read(number, array.element(number), foci)).reshape(elements, samples)


@one_at_a_time
def focus(signals: xr.DataArray, points: ArrayLike, *, window: Shading = None, interpolation: str = "band_limited",
          like: DrJitArray | type | None = None) -> xr.DataArray:
    """Focus every ping at points."""
    # points (P, 3) [m]
    recording, points = read_recording(signals), _points(points)
    values = np.stack(list(_images(recording, points, window, interpolation, like)))
    return point_signals(recording, values.astype(np.complex64), points, "focus")


@one_at_a_time
def backproject(signals: xr.DataArray, points: ArrayLike, *, window: Shading = None,
                interpolation: str = "band_limited", like: DrJitArray | type | None = None) -> xr.DataArray:
    """Focus all pings together at points: a synthetic aperture."""
    recording, points = read_recording(signals), _points(points)
    total = np.zeros(len(points), np.complex128)
    for image in _images(recording, points, window, interpolation, like):
        total += image
    values = (total / recording.values.shape[0]).astype(np.complex64)
    whole = point_signals(recording, values[None], points, "backproject")
    return whole.drop_vars([name for name, value in whole.coords.items() if "ping" in value.dims]).isel(ping=0)


def _points(points: ArrayLike) -> np.ndarray:
    points = np.atleast_2d(np.asarray(points, float))
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise ValueError(f"points to focus at have shape {points.shape}; give (points, 3) in metres")
    if not np.isfinite(points).all():
        raise ValueError(f"point {int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])} to focus at is not finite")
    return points


def _images(recording: Recording, points: np.ndarray, window: Shading, interpolation: str,
            like: DrJitArray | type | None) -> Iterator[np.ndarray]:
    """Yield the focused values complex (P,) of ping after ping."""
    lib = device_arrays(like)
    array = ElementSignals(lib, recording, interpolation, weights_of(window, recording))
    transmitters = recording.values.shape[1]
    for ping in range(recording.values.shape[0]):
        centre = recording.receivers[ping].mean(axis=0)      # near it float32 differences are small and exact
        array.load(ping, centre)
        image = []
        for begin in range(0, len(points), BLOCK):
            block = points[begin:begin + BLOCK]
            foci = ([_point_foci(array, block[group], centre, transmitter) for group in dealt(len(block))]
                    for transmitter in recording.transmitters[ping])
            image.append(array.summed(foci)[:len(block)])
        yield np.concatenate(image) / transmitters


def _point_foci(array: ElementSignals, points: np.ndarray, centre: np.ndarray, transmitter: np.ndarray) -> Focus:
    """Make foci of points (P, 3) seen from the elements' centre, the echo's place and phase there in float64."""
    lib, recording = array.lib, array.recording
    column = [upload(lib.Float64, axis) for axis in points.T]

    def seen_from(place):
        apart = [axis - dr.opaque(lib.Float64, float(p)) for axis, p in zip(column, place, strict=True)]
        return apart, dr.sqrt(sum(axis * axis for axis in apart))

    point, distance = seen_from(centre)
    way = distance + seen_from(transmitter)[1]
    turns = way * dr.opaque(lib.Float64, recording.frequency / recording.sound_speed)
    place = way * dr.opaque(lib.Float64, RATE * recording.sampling_rate / recording.sound_speed)
    place -= dr.opaque(lib.Float64, RATE * recording.start * recording.sampling_rate)
    place = dr.clip(place, -FAR, FAR)
    whole = dr.floor(place)
    foci = Focus([lib.Float(axis) for axis in point], lib.Float(distance), lib.Int32(whole), lib.Float(place - whole),
                 lib.Float(turns - dr.floor(turns)))
    dr.eval(foci)
    return foci


def beam_foci(array: ElementSignals, vectors: np.ndarray, transmitter: np.ndarray) -> Focus:
    """Make the foci of beams (B, 3) at their samples, beam by beam; phases count from an echo by way of the origin."""
    lib, recording = array.lib, array.recording
    samples = recording.values.shape[-1]
    index = dr.arange(lib.UInt32, len(vectors) * samples)
    beam = index // dr.opaque(lib.UInt32, samples)
    sample = index - beam * dr.opaque(lib.UInt32, samples)
    ranges = np.maximum(0.5 * recording.sound_speed * recording.time, 0)
    distance = dr.gather(lib.Float, upload(lib.Float, ranges.astype(np.float32)), sample)
    point = [distance * dr.gather(lib.Float, upload(lib.Float, axis.astype(np.float32)), beam) for axis in vectors.T]
    place = [dr.opaque(lib.Float, float(v)) for v in (*transmitter, transmitter @ transmitter)]
    further = array.detour(point, distance, place)
    foci = Focus(point, distance, lib.Int32(RATE * sample), further * array.samples_per_metre,
                 further * array.cycles_per_metre)
    dr.eval(foci)
    return foci
