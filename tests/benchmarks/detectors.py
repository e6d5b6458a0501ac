"""Scores of two detectors on the held-out pictures of a set: local contrast, and a forest that learned from the others.

    mitsonar shards SWEEP -o SET --split train=0.75,test=0.25
    python tests/benchmarks/detectors.py SET [SET ...]

Both score pixels, join those above a level to boxes, and rank these. The contrast of a pixel is its smoothed grey value
over the median about it, in deviations. The forest (Breiman 2001) is asked about pixels that stand out of the median;
its clues are that and other filters, here and some steps off on either side, where shadows are. Levels, and whether
large boxes rank higher, are what does best in 15 pictures learned from. Highlights of all classes are objects. A box is
right where it and an object overlap by half (intersection over union), each object once. AP is the mean over all
objects of the precision down to their score, 0 of those that no box meets.
"""
import argparse
import io
import json
import sys
import tarfile
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))          # a checkout that is not installed
sys.path.insert(0, str(Path(__file__).resolve().parent))              # what stands beside it

import mitsonar  # noqa: F401  (chooses libLLVM: must come before anything that imports Dr.Jit)

import numpy as np
from PIL import Image
from scipy import ndimage
from telling_apart import forest

from mitsonar.dataset.scores import average_precision

TAKEN, SMALLEST = 400, 6           # pixels of either kind of a picture to learn from; of a box
LEVELS = {"contrast": (1, 1.5, 2, 3, 4), "forest": (0.4, 0.5, 0.6, 0.7, 0.8)}
SIZES = (0, 0.5)                   # exponents of the number of pixels of a box in its score
STANDS_OUT = 0.5                   # contrast
BESIDE = [(0, -24), (0, -12), (0, 12), (0, 24), (-16, 0), (16, 0)]    # rows, columns


def pictures(folder, subset):
    """Yield the pictures of a subset: grey values, pixels and boxes (left, top, width, height) of highlights."""
    for path in sorted(Path(folder).glob(f"{subset}-*.tar")):
        with tarfile.open(path) as tar:
            held = {member.name: tar.extractfile(member).read() for member in tar if member.isfile()}
        for key in sorted(name[:-5] for name in held if name.endswith(".json")):
            grey, mask = (np.asarray(Image.open(io.BytesIO(held[f"{key}.{kind}"])))
                          for kind in ("png", "instance.png"))
            truth = [each["bbox"] for each in json.loads(held[f"{key}.json"])["annotations"]
                     if not each["category"].endswith(" shadow")]
            yield grey.astype(np.float32), mask > 0, np.array(truth).reshape(-1, 4)


def clues(grey):
    """Return clues (row, column, clue) of pixels; the first is their contrast."""
    middle = ndimage.zoom(ndimage.median_filter(grey[::4, ::4], 15), 4, order=0)[:grey.shape[0], :grey.shape[1]]
    smooth = [ndimage.gaussian_filter(grey - middle, width) for width in (0, 1, 2, 4, 8)]
    rough = np.sqrt(ndimage.gaussian_filter((grey - middle) ** 2, 16)) + 4
    beside = [ndimage.shift(smooth[3], [-step for step in steps], order=0, mode="nearest") for steps in BESIDE]
    return np.stack([smooth[1] / rough, *smooth, rough, middle, *beside], -1)


def boxes(score, level, size):
    """Return boxes of connected pixels above a level, and their scores."""
    number, _ = ndimage.label(score > level)
    parts = [(part, number[part] == which) for which, part in enumerate(ndimage.find_objects(number), 1)]
    parts = [((rows, columns), mask) for (rows, columns), mask in parts if mask.sum() >= SMALLEST]
    return (np.array([(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
                      for (rows, columns), _ in parts]).reshape(-1, 4),
            np.array([score[part][mask].mean() * mask.sum() ** size for part, mask in parts]))


def judged(found, truth, least):
    """Return scores of the boxes of a picture, and which are right: the strongest first, each object once."""
    rows, values = found
    right, free = np.zeros(len(rows), bool), np.ones(len(truth), bool)
    for which in np.argsort(-values):
        box = rows[which]
        low, high = np.maximum(box[:2], truth[:, :2]), np.minimum(box[:2] + box[2:], truth[:, :2] + truth[:, 2:])
        both = np.prod(np.clip(high - low, 0, None), -1)
        shares = np.where(free, both / (np.prod(box[2:]) + np.prod(truth[:, 2:], -1) - both), -1)
        if free.any() and shares.max() >= least:
            right[which], free[shares.argmax()] = True, False
    return values, right


def scores(found, truths, least=0.5):
    """Return AP, and the recall at 0.5, 1 and 2 false alarms a picture."""
    values, right = map(np.concatenate, zip(*(judged(*pair, least) for pair in zip(found, truths)), strict=True))
    share = right.sum() / sum(map(len, truths))
    precision = float(share) if right.all() or not right.any() else average_precision(values, right) * share
    right = right[np.argsort(-values, kind="stable")]
    wrong = np.cumsum(~right) / len(truths)
    return precision, [right[wrong <= most].sum() / sum(map(len, truths)) for most in (0.5, 1, 2)]


def learned(seen):
    """Return a function that scores pixels of grey values, learned from pictures."""
    rng, rows, wanted = np.random.default_rng(0), [], []
    for grey, mask, _ in seen:
        every = clues(grey)
        for kind in (True, False):
            places = every[(mask == kind) & (every[..., 0] > STANDS_OUT)]
            rows.append(rng.permutation(places)[:TAKEN])
            wanted.append(np.full(len(rows[-1]), kind))
    ask = forest(np.concatenate(rows), np.concatenate(wanted))

    def scored(grey):
        every = clues(grey)
        score, asked = np.zeros(grey.shape), every[..., 0] > STANDS_OUT
        score[asked] = ask(every[asked])
        return ndimage.gaussian_filter(score, 0.7)

    return scored


def main(argv=None):
    """Learn, detect, print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("sets", nargs="+", metavar="SET", help="folder of shards with the subsets train and test")
    for folder in parser.parse_args(argv).sets:
        seen, asked = list(pictures(folder, "train")), list(pictures(folder, "test"))
        truths = [truth for *_, truth in asked]
        objects = sum(map(len, truths))
        if not seen or not objects:
            sys.exit(f"detectors: {folder} has {len(seen)} pictures of train and {objects} objects in those of test; "
                     "make shards of more pictures with --split train=0.75,test=0.25.")
        print(f"{folder}: {len(seen)} pictures learned from, {len(asked)} held out with {objects} objects")
        for name, scored in (("contrast", lambda grey: clues(grey)[..., 0]), ("forest", learned(seen))):
            known = [scored(grey) for grey, *_ in seen[:15]]
            best = max(product(LEVELS[name], SIZES), key=lambda ways: scores([boxes(each, *ways) for each in known],
                                                                             [truth for *_, truth in seen[:15]])[0])
            found = [boxes(scored(grey), *best) for grey, *_ in asked]
            for least in (0.5, 0.1):
                precision, recalls = scores(found, truths, least)
                print(f"  {name:8} overlap {least}: AP {precision:.2f}; recall at 0.5, 1, 2 false alarms a picture "
                      + " ".join(f"{recall:.2f}" for recall in recalls))


if __name__ == "__main__":
    main()
