"""The command that makes training data of images: labels."""
import argparse
import os
import sys

from .arguments import Commands, whole
from .completion import FILES, complete_with
from .progress import Progress
from .words import announce


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    labels = commands.add_parser("labels", help="write pictures with masks, boxes and polygons to train on")
    images = labels.add_argument("images", nargs="+", metavar="IN.exr|nc|SWEEP", help="files and folders of sweeps")
    complete_with(images, FILES)
    labels.add_argument("-o", "--output", metavar="FOLDER", help="default, for one input: its name with _labels")
    labels.add_argument("--coco", action="store_true", help="annotations.json: boxes and polygons of COCO")
    labels.add_argument("--yolo", nargs="?", const="boxes", metavar="FORM",
                        help="data.yaml and texts of YOLO: boxes (default) or polygons")
    labels.add_argument("--masks", action="store_true", help="PNGs of instances, classes and shadows, 16 bits")
    labels.add_argument("--threshold", type=float, default=0.5, metavar="SHARE",
                        help="of a bin's energy that an object must exceed; default: 0.5")
    labels.add_argument("--above-noise", type=float, default=0.0, metavar="DB",
                        help="of a highlight's mean echo; default: 0")
    labels.add_argument("--smallest", type=whole, default=8, metavar="BINS",
                        help="of a piece of an annotation; smaller ones are dropped; default: 8")
    labels.add_argument("--min-visible", type=float, default=0.0, metavar="SHARE",
                        help="of an annotation that the picture shows, of objects also of what faces the sonar; "
                             "default: 0")
    labels.add_argument("--whole", action="store_true",
                        help="annotate objects together with their shadows, too, as \"cylinder with shadow\"")
    labels.add_argument("--classes", metavar="NAMES",
                        help="of objects, numbered in this order; default: those of the plan or images; "
                             "\"cylinder, tyre\"")
    labels.add_argument("--tile", type=_size, metavar="PINGSxBINS",
                        help="cut the pictures, as 512x512; of arrays BINSxBEAMS, in metres ROWSxCOLUMNS")
    labels.add_argument("--overlap", type=float, default=0.0, metavar="SHARE", help="of neighbouring tiles; default: 0")
    labels.add_argument("--drop-empty", action="store_true", help="leave out pictures and tiles without annotations")
    labels.add_argument("--cartesian", action="store_true",
                        help="pictures of fans and rotating heads in metres; default: a column per beam")
    labels.add_argument("--cell", type=float, metavar="M", help="side of their elements; default: what fits 1024")
    labels.add_argument("--tvg", default="seabed", choices=("seabed", "target", "recorder", "none"),
                        help="display gain over range; focused images have none")
    labels.add_argument("--window", type=_window, metavar="BLACK,WHITE",
                        help="levels with their gain [dB]; default: found for each image; --window=60,90")
    labels.add_argument("--split", metavar="SHARES", help="subsets without a common seabed: train=0.8,val=0.1,test=0.1")
    labels.add_argument("--split-seed", type=whole, default=0, metavar="N", help="another one deals otherwise")
    labels.add_argument("--split-by", metavar="PARAMETER", help="of the scene, in place of the seabed")
    labels.set_defaults(run=_labels)


def _labels(arguments):
    from mitsonar.dataset.labels.rules import Labels
    from mitsonar.dataset.labels.writing import write
    from mitsonar.dataset.split import read_shares

    output = arguments.output
    if output is None:
        if len(arguments.images) > 1:
            raise ValueError("several inputs were given; say by -o in which folder their labels go")
        output = f"{os.path.splitext(os.path.normpath(arguments.images[0]))[0]}_labels"
    rules = Labels(
        coco=arguments.coco, yolo=arguments.yolo, masks=arguments.masks, threshold=arguments.threshold,
        classes=None if arguments.classes is None else [name.strip() for name in arguments.classes.split(",")],
        above_noise_db=arguments.above_noise, smallest=arguments.smallest,
        min_visible=arguments.min_visible, whole=arguments.whole, tile=arguments.tile,
        overlap=arguments.overlap, drop_empty=arguments.drop_empty,
        tvg=None if arguments.tvg == "none" else arguments.tvg,
        form="cartesian" if arguments.cartesian else "polar", cell=arguments.cell,
        window=arguments.window, split=None if arguments.split is None else read_shares(arguments.split),
        split_seed=arguments.split_seed, split_by=arguments.split_by)
    with Progress("images", "labelling") as progress:
        counts = write(arguments.images, output, rules, progress)
    invisible, empty = counts.pop("invisible"), counts.pop("empty")
    print(", ".join(f"{count} {kind[:-1] if count == 1 else kind}" for kind, count in counts.items())
          + f"; {invisible} more where the picture is black all around" * bool(invisible)
          + f"; {empty} empty picture{'s' * (empty != 1)} left out" * bool(empty), file=sys.stderr)
    announce(output)


def _size(text):
    try:
        pings, bins = map(int, text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no size of tiles; give PINGSxBINS, as 512x512") from None
    return pings, bins


def _window(text):
    try:
        black, white = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no pair of levels; give BLACK,WHITE in dB, as 60,90") from None
    return black, white
