"""The commands labels and shards: training data from images."""
import argparse
import os
import sys

from .arguments import Commands, add_gain, gain, whole
from .completion import add_file
from .progress import Progress
from .words import announce, warn

MOST_NAMES = 10                    # of meshes in a warning


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    labels = commands.add_parser("labels", help="write pictures with masks, boxes and polygons as training data")
    add_file(labels, "images", nargs="+", metavar="IN.exr|nc|SWEEP", help="images, and folders of sweeps")
    labels.add_argument("-o", "--output", metavar="FOLDER", help="default, for one input: its name with _labels")
    labels.add_argument("--coco", action="store_true", help="write annotations.json: boxes and polygons of COCO")
    labels.add_argument("--yolo", nargs="?", const="boxes", metavar="FORM",
                        help="write data.yaml and label files of YOLO: boxes (default) or polygons")
    labels.add_argument("--masks", action="store_true", help="write PNGs of instances, classes and shadows, 16 bits")
    labels.add_argument("--threshold", type=float, default=0.5, metavar="SHARE",
                        help="least share of a bin's energy that an object must have; default: 0.5")
    labels.add_argument("--above-noise", type=float, default=0.0, metavar="DB",
                        help="least level of a highlight's mean echo above the noise; default: 0")
    labels.add_argument("--smallest", type=whole, default=8, metavar="BINS",
                        help="least size of a piece of an annotation; default: 8")
    labels.add_argument("--min-visible", type=float, default=0.0, metavar="SHARE",
                        help="least visible share of an annotation, and of an object's side that faces the sonar; "
                             "default: 0")
    labels.add_argument("--min-contrast", type=float, metavar="SIGMA",
                        help="least contrast of an annotation, in standard deviations of the grey values around, as "
                             "0.5; default: any")
    labels.add_argument("--no-shadows", action="store_true", help="annotate objects only; masks still have shadows")
    labels.add_argument("--whole", action="store_true",
                        help="also annotate objects together with their shadows, as \"cylinder with shadow\"")
    labels.add_argument("--classes", metavar="NAMES",
                        help="names of objects, numbered in this order, such as \"cylinder, tyre\"; default: those of "
                             "the plan or images")
    labels.add_argument("--negatives", default="", metavar="NAMES",
                        help="names of objects that a detector must not find, such as \"rounded_stone, tyre\": they "
                             "get no annotations")
    labels.add_argument("--negative-class", metavar="NAME", help="annotate them, too, as one class of that name")
    labels.add_argument("--tile", type=_size, metavar="PINGSxBINS",
                        help="cut the pictures into tiles, as 512x512; for arrays BINSxBEAMS, in metres ROWSxCOLUMNS")
    labels.add_argument("--overlap", type=float, default=0.0, metavar="SHARE",
                        help="overlap of neighbouring tiles; default: 0")
    labels.add_argument("--drop-empty", action="store_true", help="leave out pictures and tiles without annotations")
    labels.add_argument("--cartesian", action="store_true",
                        help="draw fans and rotating heads in metres; default: a column per beam")
    labels.add_argument("--cell", type=float, metavar="M",
                        help="side of a picture element in metres; default: a bin, with at most 1024 a side")
    add_gain(labels, "seabed", "display gain over range, except in focused images")
    labels.add_argument("--window", type=_window, metavar="BLACK,WHITE",
                        help="levels after the gain [dB], as --window=60,90; default: chosen for each image")
    labels.add_argument("--split", metavar="SHARES",
                        help="subsets without a common seabed: train=0.8,val=0.1,test=0.1; default: those of the plan, "
                        "if it has a split")
    labels.add_argument("--split-seed", type=whole, default=0, metavar="N", help="random seed of the split; default: 0")
    labels.add_argument("--split-by", metavar="PARAMETER", help="parameter of the scene to split by, not the seabed")
    labels.set_defaults(run=_labels)

    shards = commands.add_parser("shards", help="gather the samples of sweeps in a few tars, with an index and a card")
    add_file(shards, "folders", nargs="+", metavar="SWEEP", help="folders of sweeps whose output ends in .tar")
    add_file(shards, "-o", "--output", required=True, metavar="FOLDER", help="folder of the set")
    shards.add_argument("--size", type=whole, default=500, metavar="MB", help="size of a shard; default: 500")
    shards.add_argument("--split", metavar="SHARES",
                        help="subsets without a common seabed: train=0.8,val=0.1,test=0.1; default: those of the plan, "
                        "if it has a split")
    shards.add_argument("--split-by", metavar="PARAMETER", help="parameter of the scene to split by, not the seabed")
    shards.add_argument("--seed", type=whole, default=0, metavar="N",
                        help="random seed of the split and of the order of samples; default: 0")
    for word in ("title", "licence", "authors", "homepage"):
        shards.add_argument(f"--{word}", metavar="TEXT", help=f"{word} on the card")
    shards.set_defaults(run=_shards)


def _labels(arguments):
    from mitsonar.dataset.labels.writing import write
    from mitsonar.dataset.split import read_shares
    from mitsonar.labels.rules import Labels

    output = arguments.output
    if output is None:
        if len(arguments.images) > 1:
            raise ValueError("several inputs were given; name the folder for their labels by -o")
        output = f"{os.path.splitext(os.path.normpath(arguments.images[0]))[0]}_labels"
    rules = Labels(
        coco=arguments.coco, yolo=arguments.yolo, masks=arguments.masks, threshold=arguments.threshold,
        classes=None if arguments.classes is None else _names(arguments.classes),
        negatives=_names(arguments.negatives) if arguments.negatives else (), negative_class=arguments.negative_class,
        above_noise_db=arguments.above_noise, smallest=arguments.smallest,
        min_visible=arguments.min_visible, min_contrast=arguments.min_contrast, whole=arguments.whole,
        shadows=not arguments.no_shadows,
        tile=arguments.tile, overlap=arguments.overlap, drop_empty=arguments.drop_empty,
        tvg=gain(arguments), form="cartesian" if arguments.cartesian else "polar", cell=arguments.cell,
        window=arguments.window, split=None if arguments.split is None else read_shares(arguments.split),
        split_seed=arguments.split_seed, split_by=arguments.split_by)
    with Progress("images", "labelling") as progress:
        counts = write(arguments.images, output, rules, progress)
    invisible, empty = counts.pop("invisible"), counts.pop("empty")
    print(", ".join(f"{count} {kind[:-1] if count == 1 else kind}" for kind, count in counts.items())
          + f"; {invisible} more that the pictures do not show" * bool(invisible)
          + f"; {empty} empty picture{'s' * (empty != 1)} left out" * bool(empty), file=sys.stderr)
    announce(output)


def _shards(arguments):
    from mitsonar.dataset.balance import balances
    from mitsonar.dataset.card import meshes_in
    from mitsonar.dataset.shards import write_shards
    from mitsonar.dataset.split import read_shares
    from mitsonar.io.scene_files.mesh_lists import NAME, NOT_STATED
    from mitsonar.sweep.balance import tally_said

    if arguments.split is None and arguments.split_by is not None:
        raise ValueError("a parameter to split by is given, but no split; give its shares or leave it out.")
    about = {word: text for word in ("title", "licence", "authors", "homepage")
             if (text := getattr(arguments, word)) is not None}
    with Progress("shards", "writing") as progress:
        shards = write_shards(arguments.folders, arguments.output, size=arguments.size * 1_000_000, seed=arguments.seed,
                              shares=None if arguments.split is None else read_shares(arguments.split),
                              by=arguments.split_by, about=about, progress=progress)
    samples = sum(len(shard.samples) for shard in shards)
    print(f"{samples} records in {len(shards)} shard{'s' * (len(shards) != 1)}", file=sys.stderr)
    for sweep in balances(shards):
        print(f"{sweep.folder}: {tally_said(sweep.tally)}", file=sys.stderr)
        for verdict in sweep.verdicts:
            if not verdict.met:
                warn(f"{sweep.folder}: {verdict.words}")
    pictures = [picture for shard in shards for sample in shard.samples for picture in sample.pictures]
    if bare := sorted({mesh[0] for mesh in meshes_in(pictures) if mesh[2] == NOT_STATED}):
        warn(f"no licence is stated of {len(bare)} mesh{'es' * (len(bare) != 1)}: {', '.join(bare[:MOST_NAMES])}"
             + ", ..." * (len(bare) > MOST_NAMES) + f"; state it in {NAME} beside them and run the sweep again")
    announce(arguments.output)


def _names(text):
    return [name.strip() for name in text.split(",")]


def _size(text):
    try:
        pings, bins = map(int, text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no size of a tile; give PINGSxBINS, as 512x512") from None
    return pings, bins


def _window(text):
    try:
        black, white = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no pair of levels; give BLACK,WHITE in dB, as 60,90") from None
    return black, white
