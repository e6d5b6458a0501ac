"""Draw the gallery: twelve targets at three distances on two beds, with the outlines of their labels.

    python3 scenes/make_gallery.py FOLDER [PICTURE.png]

Runs the sweep gallery.toml into the folder, or what of it is missing there, and draws its images together, by default
as gallery.png beside this script: a column for each species, coloured by it; blue around shadows.
"""
import sys
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image
from scipy import ndimage

from mitsonar import dataset, sweep
from mitsonar.device.files import replacing
from mitsonar.labels.annotations import HIGHLIGHT, annotations
from mitsonar.labels.frames import frames
from mitsonar.labels.pictures import grey
from mitsonar.plots import canvas
from mitsonar.plots.images.truth import BRIGHT, SHADOW_COLOUR, class_colours

ROOT = Path(__file__).resolve().parent
BEDS = {1: "rippled sand", 2: "rough mud"}
ROWS, COLUMNS = 128, 168           # pings and bins of a snippet: 6.6 m along, 8.4 m across
BEFORE = 50                        # bins shown before the target's middle
SHRUNK = 0.72                      # picture elements a bin
GAP, LEFT, TOP = 3, 104, 44
LEVELS, SMALLEST = 15, 8           # shades of grey; bins of a piece that is outlined


def snippet(image, colours):
    """Draw the starboard side of an image around its target, newest ping on top: uint8 (h, w, 3)."""
    starboard = image.sel(side=["starboard"])
    frame, = frames(starboard)
    found = annotations(starboard, [frame], smallest=SMALLEST)[0]
    row, column = middle(found, frame)
    rows, columns = slice(row, row + ROWS), slice(column, column + COLUMNS)
    size = round(SHRUNK * COLUMNS), round(SHRUNK * ROWS)
    picture = frame.lay(grey(starboard)[0])[rows, columns]
    shown = np.array(Image.fromarray(picture).resize(size, Image.Resampling.BOX)).astype(float)
    shown = np.repeat((np.rint(shown / 255 * LEVELS) / LEVELS)[..., None], 3, -1)
    for each in reversed(found):                       # highlights last
        mask = np.zeros((frame.height, frame.width), np.uint8)
        mask[each.row:each.row + each.mask.shape[0], each.column:each.column + each.mask.shape[1]] = each.mask
        mask = np.array(Image.fromarray(255 * mask[rows, columns]).resize(size, Image.Resampling.BOX)) > 127
        rim = ndimage.binary_dilation(mask) & ~mask
        shown[rim] = colours[each.class_name if each.kind == HIGHLIGHT else None]
    return (255 * shown).astype(np.uint8)


def middle(found, frame):
    """Row and column at which a snippet begins that has the target in view."""
    highlight = next((each for each in found if each.kind == HIGHLIGHT), None)
    left, upper, width, height = highlight.box if highlight else (frame.width // 2, frame.height // 2, 0, 0)
    return (int(np.clip(upper + height // 2 - ROWS // 2, 0, frame.height - ROWS)),
            int(np.clip(left + width // 2 - BEFORE, 0, frame.width - COLUMNS)))


def gallery(images):
    """Put the snippets of all images together, with captions, as a figure."""
    species = sorted(set(images.parameters["species"]))
    places = sorted(set(zip(images.parameters["bed_seed"].tolist(), images.parameters["distance"].tolist(),
                            strict=True)))
    colours = {None: to_rgb(SHADOW_COLOUR), **class_colours(species)}
    high, wide = round(SHRUNK * ROWS) + GAP, round(SHRUNK * COLUMNS) + GAP
    width, height = LEFT + wide * len(species), TOP + high * len(places)
    figure = canvas.sheet(width, height, canvas.PAPER)
    sheet = np.full((height - TOP, width - LEFT, 3), 255 * np.array(to_rgb(canvas.PAPER)), np.uint8)
    for number, source in enumerate(images.sources):
        column = species.index(source.parameters["species"])
        row = places.index((int(source.parameters["bed_seed"]), int(source.parameters["distance"])))
        drawn = snippet(images[number], colours)
        sheet[row * high:row * high + high - GAP, column * wide:column * wide + wide - GAP] = drawn
    figure.figimage(sheet[::-1], LEFT, 0, origin="lower")
    for column, name in enumerate(species):
        figure.text((LEFT + (column + 0.5) * wide) / width, 1 - 0.5 * TOP / height, name.replace("_", "\n"),
                    color=colours[name], fontsize=11, fontweight="bold", ha="center", va="center",
                    linespacing=1.0)
    for row, (bed, distance) in enumerate(places):
        figure.text(0.5 * LEFT / width, 1 - (TOP + (row + 0.5) * high) / height, f"{distance} m\n{BEDS[bed]}",
                    color=canvas.INK, fontsize=10, ha="center", va="center")
    return figure


def few_colours(picture):
    """Keep the greys, the colours of outlines and some between them and the paper: a small file for a page."""
    paper = np.array(to_rgb(canvas.PAPER))
    bright = [np.array(to_rgb(colour)) for colour in (*BRIGHT, SHADOW_COLOUR, canvas.INK)]
    colours = [*(np.full(3, level / LEVELS) for level in range(LEVELS + 1)), paper,
               *(share * colour + (1 - share) * paper for colour in bright for share in (0.4, 0.7, 1.0))]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.rint(255 * np.array(colours)).astype(np.uint8).ravel().tolist())
    return picture.convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)


def main(folder, path=ROOT / "gallery.png"):
    """Render what is missing and draw it."""
    plan = sweep.load_plan(ROOT / "gallery.toml")
    outcome = sweep.run(plan, folder, progress=lambda done, total, failed: print(f"{done} of {total}", flush=True))
    if outcome.failed:
        raise SystemExit(f"{outcome.failed} renders failed: {outcome.failures}")
    with replacing(path) as temporary:
        canvas.save(gallery(dataset.open(folder)), temporary)
        few_colours(Image.open(temporary)).save(temporary, optimize=True)
    print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
