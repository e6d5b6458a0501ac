"""A sheet of the first pictures of a set, with boxes of highlights and shadows: to look at before it is learned from.

    mitsonar shards SWEEP -o SET
    python make_sheet.py SET -o sheet.png

Mines, wrecks and divers are orange, other objects green, shadows blue. SET is a folder of shards or of a sweep's
samples.
"""
import argparse
import io
import json
import sys
import tarfile
from pathlib import Path

from PIL import Image, ImageDraw

SOUGHT = {"cylinder", "truncated_cone", "sphere", "wedge", "torpedo", "hulk", "wreck", "diver"}
ORANGE, GREEN, BLUE, GAP = (255, 150, 0), (60, 220, 60), (70, 130, 255), 3
GREYS = 32                         # of the file, which keeps it small


def pictures(folder):
    """Yield the pictures of a folder of tars, and what their JSON says."""
    for path in sorted(Path(folder).glob("*.tar")):
        with tarfile.open(path) as tar:
            held = {member.name: tar.extractfile(member).read() for member in tar if member.isfile()}
        for name in sorted(name for name in held if name.endswith(".json")):
            yield Image.open(io.BytesIO(held[name[:-5] + ".png"])).convert("RGB"), json.loads(held[name])


def drawn(picture, told, width):
    """Return a picture of a width, with the boxes of its annotations."""
    factor = width / picture.width
    picture = picture.resize((width, round(picture.height * factor)), Image.Resampling.LANCZOS)
    draw = ImageDraw.Draw(picture)
    for each in told["annotations"]:
        left, top, across, down = (factor * value for value in each["bbox"])
        category = each["category"]
        colour = BLUE if category.endswith(" shadow") else ORANGE if category in SOUGHT else GREEN
        draw.rectangle((left - 1, top - 1, left + across, top + down), outline=colour)
    return picture


def sheet(shown, columns):
    """Return pictures of one width side by side, every row as high as its highest."""
    rows = [shown[first:first + columns] for first in range(0, len(shown), columns)]
    heights = [max(picture.height for picture in row) + GAP for row in rows]
    page = Image.new("RGB", (columns * (shown[0].width + GAP) - GAP, sum(heights) - GAP), (30, 30, 30))
    for number, row in enumerate(rows):
        for column, picture in enumerate(row):
            page.paste(picture, (column * (picture.width + GAP), sum(heights[:number])))
    return page


def main(argv=None):
    """Read, draw, write."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", metavar="SET", help="folder of shards or samples")
    parser.add_argument("-o", "--output", default="sheet.png", metavar="FILE", help="PNG; default: sheet.png")
    parser.add_argument("--columns", type=int, default=6, help="pictures in a row; default: 6")
    parser.add_argument("--rows", type=int, default=4, help="rows; default: 4")
    parser.add_argument("--width", type=int, default=200, help="pixels of a picture's width; default: 200")
    arguments = parser.parse_args(argv)
    shown = [drawn(*each, arguments.width)
             for _, each in zip(range(arguments.columns * arguments.rows), pictures(arguments.folder))]
    if not shown:
        sys.exit(f"make_sheet: {arguments.folder} holds no .tar with pictures; give a folder of shards, or of a sweep "
                 "whose output ends in .tar.")
    few = Image.new("P", (1, 1))
    few.putpalette([value for grey in range(GREYS) for value in 3 * [255 * grey // (GREYS - 1)]]
                   + [*ORANGE, *GREEN, *BLUE])
    page = sheet(shown, arguments.columns).quantize(palette=few, dither=Image.Dither.NONE)
    page.save(arguments.output, optimize=True)


if __name__ == "__main__":
    main()
