"""A hand-made sidescan record with labels of every bin, after the contract of `mitsonar.render`: rectangles, no rays.

The box is to starboard, the wreck to port; each has a highlight and behind it a shadow as long as the picture says.
"""
import numpy as np
from synthetic_sidescan import sidescan

CLASSES = {"seabed": "seabed", "box.1": "box", "wreck": "wreck", "box.2": "box"}


def labelled(pings=60, bins=100, *, seabed="abc", rectangles=None, objects=None, **more):
    """Make a record; `rectangles` are (kind, name, side, first ping, last, first bin, last) with the ends left out."""
    classes = objects or CLASSES
    shapes = list(classes)
    rectangles = rectangles if rectangles is not None else [
        ("highlight", "box.1", 1, 20, 30, 40, 45), ("shadow", "box.1", 1, 20, 30, 45, 60),
        ("highlight", "wreck", 0, 10, 50, 70, 80), ("shadow", "wreck", 0, 12, 48, 80, 100)]
    record = sidescan(pings, bins)
    shape = record["level"].shape
    share = np.zeros((len(shapes), *shape), np.float32)
    share[0] = record["range"].values >= 12.0
    shadow = np.zeros(shape, np.uint32)
    level = record["mean_level"].values.copy()
    level[:] = np.where(share[0] > 0, 80.0, -200.0)
    for kind, name, side, first, last, near, far in rectangles:
        where = (slice(first, last), side, slice(near, far))
        if kind == "shadow":
            shadow[where] = 1 + shapes.index(name)
            level[where] = 40.0
        else:
            share[(slice(None), *where)] = 0.2 * (np.arange(len(shapes)) == 0)[:, None, None]
            share[(shapes.index(name), *where)] = 0.8
            level[where] = 95.0
    heard = share.sum(0) > 0
    dims = record["level"].dims
    names = sorted(set(classes.values()))
    label = np.where(heard, share.argmax(0) + 1, 0).astype(np.uint32)
    number = np.array([0, *(1 + names.index(classes[name]) for name in shapes)], np.uint32)
    record = record.assign(
        level=(dims, level.astype(np.float32), record["level"].attrs),
        mean_level=(dims, level.astype(np.float32), record["mean_level"].attrs), label=(dims, label),
        share=(("shape", *dims), share), object_shadow=(dims, shadow), hidden=(dims, (shadow > 0).astype(np.float32)),
        layover=(dims, (1 * heard).astype(np.uint8))).assign({"class": (dims, number[label])})
    record = record.assign_coords(shape=("shape", shapes))
    record.attrs.update(
        noise_db=52.0, seabed=seabed, labels={str(k): name for k, name in enumerate(shapes, 1)},
        classes={str(k): name for k, name in enumerate(names, 1)},
        label_class={str(k): 1 + names.index(classes[name]) for k, name in enumerate(shapes, 1)},
        objects={str(k): {"class": classes[name], "lower": [0.0, 0.0, -20.0], "upper": [1.0, 1.0, -19.0]}
                 for k, name in enumerate(shapes, 1) if classes[name] != "seabed"}, **more)
    return record
