"""Hand-made records of a fan of beams and of a rotating head, after the contract of `mitsonar.render`: no rays.

A bed from a first range on; boxes that stand on it, given by where they are in metres, each with the shadow that it
casts away from the sonar.
"""
import numpy as np
import xarray

BOXES = {"box.1": (-3.0, 8.0, 1.2), "box.2": (4.0, 14.0, 1.6)}          # middle x, y [m], width of its square [m]


def fan(boxes=BOXES, *, pings=1, beams=256, bins=600, near=2.0, far=20.0, width=np.deg2rad(120), step="angle", bed=3.0,
        shadow=2.5, seed=1, mean_level=False):
    """Make a record over (ping, beam, range); in ping p the boxes are 0.5 p m nearer."""
    bearing = (np.linspace(-0.5, 0.5, beams) * width if step == "angle"
               else np.arcsin(np.linspace(-1, 1, beams) * np.sin(0.5 * width)))
    frames = [_frame(bearing, np.linspace(near, far, bins), {name: (x, y - 0.5 * ping, size)
                                                              for name, (x, y, size) in boxes.items()}, bed, shadow)
              for ping in range(pings)]
    share, hidden = (np.stack(each) for each in zip(*frames, strict=True))
    coords = {"bearing": ("beam", bearing, {"units": "rad"}), "beam": ("beam", bearing, {"units": "rad"}),
              "beam_x": ("beam", np.cos(bearing)), "beam_y": ("beam", np.sin(bearing)), "beam_z": ("beam", 0 * bearing)}
    return _record(share.swapaxes(0, 1), hidden, ("ping", "beam", "range"), boxes, coords, near, far, seed, mean_level)


def head(boxes=BOXES, *, turns=1, steps=400, bins=500, near=1.0, far=20.0, bed=2.0, shadow=2.5, seed=1):
    """Make a record over (ping, range) of a head that turns clockwise, all around, as often as given."""
    bearing = np.tile(2 * np.pi * np.arange(steps) / steps, turns)
    share, hidden = _frame(bearing, np.linspace(near, far, bins), boxes, bed, shadow)
    coords = {"bearing": ("ping", bearing, {"units": "rad"}), "turn": ("ping", np.repeat(np.arange(turns), steps))}
    return _record(share, hidden, ("ping", "range"), boxes, coords, near, far, seed, False)


def _frame(bearing, slant_range, boxes, bed, shadow):
    """Shares of bed and boxes (shape, beam, range), and which box hides the bed (beam, range)."""
    x, y = slant_range * np.sin(bearing)[:, None], slant_range * np.cos(bearing)[:, None]
    share = np.zeros((1 + len(boxes), *x.shape), np.float32)
    share[0] = slant_range >= bed
    hidden = np.zeros(x.shape, np.uint32)
    for number, (east, north, size) in enumerate(boxes.values(), 1):
        inside = (np.abs(x - east) <= size / 2) & (np.abs(y - north) <= size / 2)
        behind = np.logical_or.accumulate(inside, -1) & ~inside & (slant_range < np.hypot(east, north) + shadow)
        share[:, inside] = 0.2 * (np.arange(1 + len(boxes)) == 0)[:, None]
        share[number, inside] = 0.8
        share[:, behind], hidden[behind] = 0, number + 1
    return share, hidden


def _record(share, hidden, dims, boxes, coords, near, far, seed, mean_level):
    rng = np.random.default_rng(seed)
    slant_range = np.linspace(near, far, share.shape[-1])
    strong = 10 ** 4 * share[0] + 10 ** 6 * share[1:].sum(0) + 1                     # of the bed 40 dB, of boxes 60 dB
    level = 60 + 10 * np.log10(strong * rng.exponential(size=strong.shape)) - 30 * np.log10(slant_range)
    shapes, names = ["seabed", *boxes], sorted({name.partition(".")[0] for name in boxes} | {"seabed"})
    label = np.where(share.any(0), share.argmax(0) + 1, 0).astype(np.uint32)
    number = np.array([0, *(1 + names.index(name.partition(".")[0]) for name in shapes)], np.uint32)
    pings = share.shape[1]
    variables = {"level": level.astype(np.float32), "label": label, "class": number[label], "object_shadow": hidden,
                 "hidden": (hidden > 0).astype(np.float32), "shadow": (hidden > 0).astype(np.uint8),
                 "seabed_depth": np.where(share[0] > 0, 10, np.nan).astype(np.float32)}
    if mean_level:
        variables["mean_level"] = (60 + 10 * np.log10(strong) - 30 * np.log10(slant_range)).astype(np.float32)
    coords = {"ping": np.arange(pings), "range": ("range", slant_range, {"units": "m"}), "shape": ("shape", shapes),
              **{name: ("ping", np.arange(pings) * 0.5, {"units": "m"}) for name in "xyz"},
              "altitude": ("ping", np.full(pings, 3.0)), **coords}
    attrs = {"sonar": "array_sonar", "seed": seed, "frequency": 750e3, "sound_speed": 1500.0, "seabed": f"bed{seed}",
             "bin_width": float(slant_range[1] - slant_range[0]), "parameters": {}, "file": "fan.xml",
             "labels": {str(k): name for k, name in enumerate(shapes, 1)},
             "classes": {str(k): name for k, name in enumerate(names, 1)},
             "objects": {str(k): {"class": name.partition(".")[0], "lower": [0, 0, -10], "upper": [1, 1, -9]}
                         for k, name in enumerate(shapes, 1) if name != "seabed"}}
    return xarray.Dataset({**{name: (dims, values) for name, values in variables.items()},
                           "share": (("shape", *dims), share)}, coords, attrs)
