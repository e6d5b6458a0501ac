"""Messages of a record's pings: images over beams and range, pictures in metres, soundings, water column, truth.

Numbers of an image stand range by range, all beams of a range together: index = range * beam_count + beam, as
`sonar_image_proc` reads them.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.imaging.focused import GROUND

from . import axes
from .bag_messages import BAD, IMAGE_TYPES, BagMessage, cloud, header, nanoseconds, vector
from .beams import SonarBeams, beam_widths
from .poses import MAP, BagNames

ACOUSTIC = "marine_acoustic_msgs/msg/"
# variable of an image -> its topic
PROJECTED = {"level": "image", "recorded": "recorded", "label": "labels"}
PICTURES = {"level": "picture", "label": "picture_labels"}
ENCODINGS = {"f4": "32FC1", "i4": "32SC1", "u2": "16UC1", "u1": "8UC1"}


def ping_messages(ping: xr.Dataset, beams: SonarBeams, names: BagNames, start: float) -> Iterator[BagMessage]:
    """Yield the messages of a record of one ping, of its own or of its soundings."""
    stamp = nanoseconds(float(ping["ping_time"].values[0]), start)
    if "travel_time" in ping:
        yield from _sounded(ping, beams, names, stamp)
    elif {"x", "y"} <= set(ping["level"].dims):
        yield from _pictures(ping.isel(ping=0), names, stamp, ("y", "x"))
    else:
        yield from _projected(ping, beams, names, stamp)


def focused_messages(image: xr.Dataset, names: BagNames, start: float) -> Iterator[BagMessage]:
    """Yield the pictures of a focused image; the first row is the farthest along the track."""
    stamp, picture = nanoseconds(0.0, start), image.isel({GROUND[0]: slice(None, None, -1)})
    for bank in range(picture.sizes.get("bank", 1)):
        one = picture.isel(bank=bank, missing_dims="ignore")
        yield from _pictures(one if bank == 0 else one[["level"]], names, stamp, GROUND, f"_{bank}" if bank else "")


# ---- images

def _projected(ping, beams, names, stamp):
    """Yield an image, its counts, its labels, and the bed that its bins see."""
    ping = ping.isel(ping=0).transpose(..., "range")
    rows = [dim for dim in ping["level"].dims if dim != "range"]
    direction = axes.in_sonar(beams.directions(ping.expand_dims("ping")), beams.frame)
    about = {"header": header(stamp, names.sonar), "beam_directions": [vector(row) for row in direction],
             "ranges": ping["range"].values, "ping_info": {
                 **{name: float(ping.attrs.get(name) or 0) for name in ("frequency", "sound_speed")},
                 **beam_widths(ping.attrs)}}
    for name, topic in PROJECTED.items():
        if name in ping:
            values = ping[name].transpose("range", *rows).values.reshape(ping.sizes["range"], -1)
            yield BagMessage(topic=f"{names.topics}/{topic}", type=f"{ACOUSTIC}ProjectedSonarImage", stamp=stamp,
                             fields={**about, "image": _image(values)})
    if "measured_depth" in ping and "measured_x" in ping:
        kept = ping["valid"].values
        yield _points("soundings", names, stamp, x=ping["measured_x"].values[kept], y=ping["measured_y"].values[kept],
                      z=-ping["measured_depth"].values[kept], intensity=ping["level"].values[kept])
    if {"seabed_x", "seabed_y", "seabed_depth", "label"} <= set(ping):
        kept = np.isfinite(ping["seabed_depth"].values)
        yield _points("truth", names, stamp, x=ping["seabed_x"].values[kept], y=ping["seabed_y"].values[kept],
                      z=-ping["seabed_depth"].values[kept], intensity=ping["level"].values[kept],
                      label=ping["label"].values[kept])


def _image(values: np.ndarray) -> dict[str, Any]:
    """Return a SonarImageData of numbers (range, beam)."""
    plain = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    return {"dtype": IMAGE_TYPES[plain.dtype.str[1:]], "beam_count": plain.shape[1], "data": plain.view(np.uint8)}


def _pictures(picture, names, stamp, dims, suffix=""):
    """Yield the levels and the labels of a picture in metres."""
    for name, topic in PICTURES.items():
        if name not in picture:
            continue
        values = picture[name].transpose(*dims).values
        values = values.astype(np.int32) if values.dtype == np.uint32 else values.astype(np.float32)
        plain = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        yield BagMessage(topic=f"{names.topics}/{topic}{suffix}", type="sensor_msgs/msg/Image", stamp=stamp, fields={
            "header": header(stamp, names.sonar), "height": plain.shape[0], "width": plain.shape[1],
            "encoding": ENCODINGS[plain.dtype.str[1:]], "step": plain.strides[0], "data": plain.view(np.uint8)})


def _points(topic, names, stamp, **columns):
    """Return a cloud of points in the scene's frame."""
    columns = {name: np.asarray(column, np.uint32 if name in ("label", "beam") else np.float32)
               for name, column in columns.items()}
    return BagMessage(topic=f"{names.topics}/{topic}", type="sensor_msgs/msg/PointCloud2", stamp=stamp,
                      fields=cloud(columns, stamp, MAP))


# ---- soundings

def _sounded(ping, beams, names, stamp):
    """Yield the soundings of a ping, their places, the places' truth, and the water column."""
    one, there = ping.isel(ping=0), header(stamp, names.sonar)
    speed, valid = float(one["head_sound_speed"]), one["valid"].values
    info = {"frequency": float(np.nanmean(one["sector_frequency"])), "sound_speed": speed,
            **beam_widths(one.attrs)}
    delay = one["sector_delay"].values[one["sector"].values]
    strength = one["backscatter_db"].values if "backscatter_db" in one else np.zeros(0)
    flags = [{"flag": 0 if good else BAD} for good in valid]
    yield BagMessage(topic=f"{names.topics}/detections", type=f"{ACOUSTIC}SonarDetections", stamp=stamp, fields={
        "header": there, "ping_info": info, "flags": flags, "two_way_travel_times": one["travel_time"].values,
        "tx_delays": delay, "intensities": strength, "tx_angles": one["transmit_angle"].values,
        "rx_angles": one["angle"].values})
    direction = axes.in_sonar(beams.directions(ping), beams.frame)
    yield BagMessage(topic=f"{names.topics}/ranges", type=f"{ACOUSTIC}SonarRanges", stamp=stamp, fields={
        "header": there, "ping_info": info, "flags": flags, "transmit_delays": delay, "intensities": strength,
        "beam_unit_vec": [vector(row) for row in direction], "ranges": 0.5 * speed * one["travel_time"].values})
    beam = np.flatnonzero(valid)
    place = {"x": one["x"].values[valid], "y": one["y"].values[valid]}
    yield _points("soundings", names, stamp, **place, z=-one["depth"].values[valid], beam=beam,
                  **{name: one[of].values[valid] for name, of in (("intensity", "backscatter_db"),
                                                                  ("uncertainty", "uncertainty")) if of in one})
    if "true_depth" in one:
        yield _points("truth", names, stamp, **place, z=-one["true_depth"].values[valid], beam=beam,
                      **{name: one[name].values[valid] for name in ("error", "label") if name in one})
    if "column_level_db" in one:
        yield _column(one, names, stamp, info)


def _column(one, names, stamp, info):
    """Return the water column of a ping; beams that begin later have no numbers (NaN) before their first."""
    rate = float(one["column_rate"].values[0])
    first = np.round(one["column_start"].values * rate).astype(int)
    level = one["column_level_db"].values
    if np.ptp(first):
        late = first - first.min()
        shifted = np.full((level.shape[0], level.shape[1] + late.max()), np.nan, np.float32)
        for beam, (row, lag) in enumerate(zip(level, late)):
            shifted[beam, lag:lag + row.size] = row
        level = shifted
    sector = one["column_sector"].values
    return BagMessage(topic=f"{names.topics}/column", type=f"{ACOUSTIC}RawSonarImage", stamp=stamp, fields={
        "header": header(stamp, names.sonar), "ping_info": info, "sample_rate": rate,
        "samples_per_beam": level.shape[1], "sample0": max(int(first.min()), 0),
        "tx_delays": one["sector_delay"].values[sector], "tx_angles": one["sector_angle"].values[sector],
        "rx_angles": one["column_angle"].values, "image": _image(level.T)})
