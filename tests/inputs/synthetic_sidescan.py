"""A hand-made sidescan record that follows the dataset contract: no rays, only the geometry of a flat bed.

Lambert bed at a fixed altitude (water column, first bottom return, fall-off with range), ripples on the starboard
outer part, one box with its shadow on starboard, speckle of circular complex Gaussian echoes.
"""
import numpy as np
import xarray

LABELS = {"1": "seabed", "2": "box", "3": "a wreck"}


def sidescan(pings=120, bins=200, *, slant_range=75.0, altitude=12.0, interval=0.1, speed=2.0, seed=1):
    """Make the dataset of a straight northbound track over a flat bed with a box 1.8 m high and a low wreck."""
    rng = np.random.default_rng(seed)
    bin_width = slant_range / bins
    centre = (np.arange(bins) + 0.5) * bin_width
    ping = np.arange(pings)
    along = ping * interval * speed
    bottom = np.broadcast_to(centre >= altitude, (pings, 2, bins))
    ground = np.sqrt(np.maximum(centre**2 - altitude**2, 0))
    strength = np.full((pings, 2, bins), -27.0)
    ripples = 3 * np.sin(2 * np.pi * (ground / 2.5 + 0.15 * along[:, None]))
    strength[:, 1] += np.where(ground > 0.45 * slant_range, ripples, 0)
    strength[:, 0] += 4 * np.exp(-((along[:, None] - along.mean()) / 8) ** 2 - ((ground - 40) / 12) ** 2)

    label = np.where(bottom, 1, 0).astype(np.uint32)
    shadow = np.zeros((pings, 2, bins), np.uint8)
    for number, side, start, width, length, height, bright in ((2, 1, 0.42, 1.6, 0.1, 1.8, 15),
                                                               (3, 0, 0.55, 5.0, 0.22, 3.0, 9)):
        near = start * slant_range
        end = near * altitude / (altitude - height)
        inside = np.abs(along - 0.6 * along[-1])[:, None] <= 0.5 * length * along[-1] + 1e-9
        body = inside & (centre >= near) & (centre < near + width)
        dark = inside & (centre >= near + width) & (centre < end + width)
        strength[:, side] += bright * body
        label[:, side][body] = number
        label[:, side][dark] = 0
        shadow[:, side][dark] = 1

    # Sonar equation on a flat Lambert bed: 30 log R with the area law, 20 log sin(grazing), absorption 0.03 dB/m.
    absorption_db = 0.03
    grazing = np.clip(altitude / centre, 0, 1)
    echo = 210 + strength + 20 * np.log10(grazing) - 30 * np.log10(centre) - 2 * absorption_db * centre - 6
    echo = np.where(bottom & (shadow == 0), echo, -200)
    noise = 52.0
    total = 10 ** (echo / 10) + 10 ** (noise / 10)
    level = 10 * np.log10(total * rng.exponential(size=total.shape))
    depth = np.where(label > 0, 20.0 - 1.8 * (label == 2) - 3.0 * (label == 3), np.nan)
    rays = np.where(label > 0, rng.poisson(40, label.shape), 0)

    dims = ("ping", "side", "range")
    variables = {
        "level": (dims, level.astype(np.float32), "dB re 1 µPa", "echo level"),
        "mean_level": (dims, np.where(echo > -200, echo, -200).astype(np.float32), "dB re 1 µPa",
                       "echo level without speckle and noise"),
        "label": (dims, label, "1", "shape label"),
        "depth": (dims, depth.astype(np.float32), "m", "energy-weighted depth of the hits"),
        "shadow": (dims, shadow, "1", "shadow flag"),
        "rays": (dims, rays.astype(np.uint32), "1", "rays that reached the bin"),
    }
    wobble = 0.02 * np.sin(along / 3)
    per_ping = {"ping_time": (ping * interval, "s"), "x": (500 + wobble, "m"), "y": (along, "m"),
                "z": (np.full(pings, altitude - 20.0), "m"), "roll": (wobble / 2, "rad"), "pitch": (-wobble, "rad"),
                "heading": (wobble / 5, "rad"), "altitude": (np.full(pings, altitude), "m")}
    coords = {
        "ping": ("ping", ping, {"units": "1", "long_name": "ping number"}),
        "side": ("side", ["port", "starboard"], {"units": "1", "long_name": "side"}),
        "range": ("range", centre, {"units": "m", "long_name": "slant range"}),
        "time": ("range", 2 * centre / 1492.3, {"units": "s", "long_name": "two-way travel time"}),
        **{name: ("ping", values, {"units": units, "long_name": name}) for name, (values, units) in per_ping.items()},
    }
    attrs = {"sonar": "sidescan", "seed": 2**40 + 7, "sound_speed": 1492.3, "frequency": 100e3,
             "source_level_db": 210.0, "absorption_db": absorption_db, "bin_width": bin_width, "labels": LABELS,
             "scene": "<scene version=\"3.0.0\"/>", "parameters": {"pings": pings, "speckle": True, "note": None},
             "versions": {"mitsonar": "0.1.0", "mitsuba": "3.9.1"}, "local_origin": [431000.1, 5.2e6], "crs": None}
    return xarray.Dataset(
        {name: (dims, values, {"units": units, "long_name": text})
         for name, (dims, values, units, text) in variables.items()}, coords, attrs)
