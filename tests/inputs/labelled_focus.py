"""A focused image with labels of every point, after the contract of `mitsonar.render`: rectangles, no rays."""
import numpy as np
from focused_image import focused_image

SHAPES = {"seabed": "seabed", "box.1": "box", "wreck": "wreck"}
# kind, name, first row, last, first column, last, ends left out; columns count from the near end
RECTANGLES = (("highlight", "box.1", 10, 16, 30, 36), ("shadow", "box.1", 10, 16, 36, 50),
              ("highlight", "wreck", 28, 40, 60, 75), ("shadow", "wreck", 29, 39, 75, 90))


def labelled_focus(rows=50, columns=90, *, banks=2, heading=0.3, spacing=0.05, seabed="abc", port=False, seed=0,
                   rectangles=RECTANGLES, **more):
    """Make an image whose grid begins 10 m abeam; with `port` it is looked at to port, columns still to starboard."""
    image = focused_image(rows, columns, banks=banks, heading=heading, spacing=spacing, seed=seed)
    rng, dims = np.random.default_rng(seed), ("along_track", "across_track")
    share = np.zeros((len(SHAPES), rows, columns), np.float32)
    share[0] = 1
    shadow, scale = np.zeros((rows, columns), np.uint32), np.full((rows, columns), 0.01)
    for kind, name, first, last, near, far in rectangles:
        where, number = (slice(first, last), slice(near, far)), 1 + list(SHAPES).index(name)
        if kind == "shadow":
            shadow[where], scale[where] = number, 0.0005
        else:
            share[(slice(None), *where)] = np.array([0.2 * (shape in (1,)) + 0.8 * (shape == number)
                                                     for shape in range(1, 1 + len(SHAPES))])[:, None, None]
            scale[where] = 0.1
    speckle = rng.normal(size=(banks, rows, columns)) + 1j * rng.normal(size=(banks, rows, columns))
    values = (scale * speckle).astype(np.complex64)
    names = sorted(set(SHAPES.values()))
    classes = np.array([0, *(1 + names.index(kind) for kind in SHAPES.values())], np.uint32)
    label = (share.argmax(0) + 1).astype(np.uint32)
    image = image.assign(
        image=(image["image"].dims, values, image["image"].attrs),
        level=(image["level"].dims, (20 * np.log10(np.abs(values))).astype(np.float32), image["level"].attrs),
        label=(dims, label), share=(("shape", *dims), share), object_shadow=(dims, shadow),
        hidden=(dims, (shadow > 0).astype(np.float32)), shadow=(dims, np.zeros((rows, columns), np.float32)),
        layover=(dims, np.ones((rows, columns), np.uint8))).assign({"class": (dims, classes[label])})
    image = image.assign_coords(shape=list(SHAPES))
    if port:
        image = image.isel(across_track=slice(None, None, -1))
        image = image.assign_coords(across_track=-image["across_track"])
        ahead = (np.sin(heading), np.cos(heading))
        for number, name in enumerate("xy"):
            abeam = (ahead[1], -ahead[0])[number]
            image[name] = (dims, image["along_track"].values[:, None] * ahead[number]
                           + image["across_track"].values * abeam)
    image.attrs.update(seabed=seabed, labels={str(k): name for k, name in enumerate(SHAPES, 1)},
                       classes={str(k): name for k, name in enumerate(names, 1)},
                       label_class={str(k): 1 + names.index(kind) for k, kind in enumerate(SHAPES.values(), 1)},
                       objects={str(k): {"class": kind, "lower": [0.0] * 3, "upper": [1.0] * 3}
                                for k, kind in enumerate(SHAPES.values(), 1) if kind != "seabed"}, **more)
    return image
