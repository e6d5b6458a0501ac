"""Real or rendered: what gives rendered sonar pictures away, clue by clue, and how surely all clues together do.

    python -m tests.benchmarks.real_or_rendered A.xtf=A.exr B.xtf=B.exr -o table.txt -o sheet.png
    python -m tests.benchmarks.real_or_rendered A.xtf=A.exr --tuned "A: beam width, noise"
    python -m tests.benchmarks.real_or_rendered --frames ping.raw=ping.exr -o frames.png

Each pair is a recorded line and a rendered one of the same range, samples and pings a metre; lines are called A, B, C
in their order, then frames, those of imaging sonars. clue_records.py and mitsonar/comparison/sidescan_amplitudes.py say
what is read and cut, mitsonar/comparison/clue_features.py which clues there are, telling_apart.py how they are asked.

AUC: the chance that a real item has the higher value; 0.5 is no clue, 0 and 1 always tell. Three yardsticks stand
beside it, without their sign (0.5 to 1):
    floor     port against starboard of the real line, of frames left against right: a sonar beside itself
    ceiling   the largest between two real lines: real sonars beside each other
    excess    AUC without its sign less the floor, the mean of the lines; clues are sorted by it
All clues together: within a line, five folds of whole runs of pings; transfer, learned from the other pairs and asked
about this one (below 0.5: what the others taught is the wrong way round here). Each with the standard error of whole
runs drawn anew. The picture has the strongest clues, each by the real and the rendered items nearest to the median.
"""
import argparse
import sys
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))          # a checkout that is not installed
sys.path.insert(0, str(Path(__file__).resolve().parent))              # what stands beside it, also with -m

import mitsonar  # noqa: F401  (chooses libLLVM: must come before anything that imports Dr.Jit)

import clue_records
import numpy as np
from telling_apart import by_folds, folded, forest, logistic

from mitsonar.comparison.sidescan_amplitudes import (
    ClueItems,
    SidescanAmplitudes,
    auc,
    auc_error,
    bed_items,
    run_items,
)

STRONGEST = 10
MOST_ROWS = 25
APART = 0.03                       # of the spacing of samples
KINDS = {"patches of bed": bed_items, "runs of pings": run_items}
FRAME_KINDS = {"patches of frames": clue_records.frame_items}
LEARNERS = {"forest": forest, "logistic": logistic}


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A real line or its frames, and the rendered twin, cut into items of one kind."""

    letter: str
    real: ClueItems
    rendered: ClueItems


@dataclass(frozen=True, kw_only=True)
class Clue:
    """One clue of all pairs."""

    name: str
    kind: str
    aucs: tuple[float, ...]  # of the pairs; above 0.5: real ones have the higher value
    floors: tuple[float, ...]  # of the pairs, 0.5 to 1
    ceiling: float  # 0.5 to 1, or NaN of one pair
    medians: tuple[tuple[float, float], ...]  # of the pairs: real, rendered
    excess: float


def main(argv=None):
    """Read, compare, print tables; write those and the picture."""
    arguments = _arguments(argv)
    try:
        tables, shown = [], []
        for pairs, read, kinds, before in ((arguments.lines, clue_records.line, KINDS, 0),
                                           (arguments.frames, clue_records.frames, FRAME_KINDS, len(arguments.lines))):
            if pairs:
                records = {_letter(before + number): tuple(read(path) for path in pair.split("=", 1))
                           for number, pair in enumerate(pairs)}
                tables += _about(records, arguments.tuned)
                compared = [_compared(kind, records, cut) for kind, cut in kinds.items()]
                tables += [line for _, _, text in compared for line in text]
                shown.append((sorted((clue for _, clues, _ in compared for clue in clues), key=_rank)[:STRONGEST],
                              {kind: parts for (kind, (parts, _, _)) in zip(kinds, compared)}))
    except (ValueError, OSError) as problem:
        sys.exit(f"real_or_rendered: {problem}")
    print("\n".join(tables))
    for path in arguments.output:
        if path.suffix == ".png":
            draw(path, shown)
        else:
            path.write_text("\n".join(tables) + "\n", encoding="utf-8")


def _arguments(argv):
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lines", nargs="*", metavar="REAL=RENDERED", help="XTF file and the picture rendered of it")
    parser.add_argument("--frames", nargs="+", action="extend", default=[], metavar="REAL=RENDERED",
                        help="frames of an imaging sonar and what was rendered of them")
    parser.add_argument("--tuned", action="append", default=[], metavar="'A: WHAT'",
                        help="what of a rendered line was tuned by looking at which real one; said in the table")
    parser.add_argument("-o", "--output", type=Path, action="append", default=[], metavar="FILE",
                        help="table as .txt, picture of the ten strongest clues as .png; repeatable")
    arguments = parser.parse_args(argv)
    pairs = [*arguments.lines, *arguments.frames]
    if not pairs or any("=" not in pair for pair in pairs):
        parser.error(f"pairs are REAL=RENDERED, two files; got {' '.join(pairs) or 'none'}.")
    wrong = [path for path in arguments.output if path.suffix not in (".txt", ".png")]
    if wrong:
        parser.error(f"{wrong[0]} ends neither in .txt, for the table, nor in .png, for the picture.")
    unnamed = [text for text in arguments.tuned if text.partition(":")[0] not in map(_letter, range(len(pairs)))]
    if unnamed:
        parser.error(f"--tuned '{unnamed[0]}' names no pair; begin with {_letter(0)}: or so, by the order of pairs.")
    return arguments


def _letter(number):
    return chr(ord("A") + number)


def _about(records, tuned):
    """Return what the pairs are, and what was tuned on which, as lines of text."""
    text = []
    for letter, (real, rendered) in records.items():
        said = [one.partition(":")[2].strip() for one in tuned if one.startswith(letter + ":")]
        text += [f"{letter}  real      {real.name}: {real.about}; {_size(real)}",
                 f"   rendered  {rendered.name}: {rendered.about}; {_size(rendered)}",
                 f"   tuned on {letter}: {'; '.join(said) or 'nothing, as far as was said'}"]
        spacings = [getattr(record, "spacing", 1.0) for record in (real, rendered)]
        if abs(spacings[1] - spacings[0]) > APART * spacings[0]:
            text.append(f"   samples are {spacings[0]:.4f} m apart in the real line and {spacings[1]:.4f} m in the "
                        "rendered one: clues of texture and range differ by that alone")
    return [*text, ""]


def _size(record):
    if isinstance(record, SidescanAmplitudes):
        pings, samples = record.sides[0].shape
        return f"{pings} pings x 2 x {samples} samples of {100 * record.spacing:.1f} cm"
    return "{} frames x {} beams x {} samples".format(*record.frames.shape)


def _compared(kind, records, cut):
    """Return the pairs' items, the clues and the lines of text of one kind of items."""
    cuts = {letter: (cut(real), cut(rendered)) for letter, (real, rendered) in records.items()}
    names = tuple(dict.fromkeys(name for pair in cuts.values() for items in pair for name in items.names))
    pairs = [Pair(letter=letter, real=_aligned(real, names), rendered=_aligned(rendered, names))
             for letter, (real, rendered) in cuts.items()]
    clues = sorted((_clue(kind, pairs, number) for number in range(len(names))), key=_rank)
    return pairs, clues, [*_table_of_clues(kind, pairs, clues), *_table_of_all(kind, pairs)]


def _aligned(items, names):
    """Return items with the clues of all pairs; those that one lacks are NaN."""
    column = {name: items.clues[:, number] for number, name in enumerate(items.names)}
    missing = np.full(len(items.clues), np.nan)
    return ClueItems(names=names, clues=np.stack([column.get(name, missing) for name in names], 1), runs=items.runs,
                 sides=items.sides, pictures=items.pictures)


def _clue(kind, pairs, number):
    """Measure one clue in all pairs."""
    real = [pair.real.clues[:, number] for pair in pairs]
    rendered = [pair.rendered.clues[:, number] for pair in pairs]
    aucs = tuple(map(auc, real, rendered))
    floors = tuple(folded(auc(values[pair.real.sides == 0], values[pair.real.sides == 1]))
                   for values, pair in zip(real, pairs))
    excesses = [folded(value) - np.fmax(floor, .5) for value, floor in zip(aucs, floors) if np.isfinite(value)]
    between = [folded(auc(*two)) for two in combinations(real, 2)]
    return Clue(name=pairs[0].real.names[number], kind=kind, aucs=aucs, floors=floors, ceiling=_largest(between),
                medians=tuple((_median(a), _median(b)) for a, b in zip(real, rendered)),
                excess=float(np.mean(excesses)) if excesses else np.nan)


def _median(values):
    return float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else np.nan


def _largest(values):
    known = [value for value in values if np.isfinite(value)]
    return max(known) if known else np.nan


def _rank(clue):
    return -clue.excess if np.isfinite(clue.excess) else np.inf


def _number(value, pattern=".2f"):
    return format(value, pattern) if np.isfinite(value) else "-"


def _table_of_clues(kind, pairs, clues):
    """Return the table of clues of one kind as lines of text."""
    rows = [[kind, "excess", *(f"{pair.letter}: AUC, floor" for pair in pairs), "ceiling",
             *(f"{pair.letter}: real, rendered" for pair in pairs)]]
    for clue in clues[:MOST_ROWS]:
        rows.append([clue.name + (" *" if len(pairs) > 1 and _one_sign(clue) else ""), _number(clue.excess),
                     *(f"{_number(value)}  {_number(floor)}" for value, floor in zip(clue.aucs, clue.floors)),
                     _number(clue.ceiling), *(f"{_number(real, '.3g')}  {_number(rendered, '.3g')}"
                                              for real, rendered in clue.medians)])
    hidden = len(clues) - MOST_ROWS
    return [*_columns(rows), *([f"and {hidden} weaker clues"] if hidden > 0 else []),
            *(["* the same sign in all lines"] if len(pairs) > 1 else []), ""]


def _one_sign(clue):
    return all(value > .5 for value in clue.aucs) or all(value < .5 for value in clue.aucs)


def _table_of_all(kind, pairs):
    """Return what all clues together tell, as lines of text."""
    rows = [[f"all clues, {kind}", "within", "floor", "ceiling", "transfer"]]
    for name, learn in LEARNERS.items():
        between = {}
        for one, other in combinations(pairs, 2):
            between[one.letter, other.letter] = folded(_within(learn, one.real, other.real)[0])
        for pair in pairs:
            sides = pair.real.sides == 0
            floor = auc(*_parted(by_folds(learn, pair.real.clues, sides, pair.real.runs), sides))
            ceiling = _largest([value for letters, value in between.items() if pair.letter in letters])
            transfer = _transfer(learn, pair, [other for other in pairs if other is not pair])
            rows.append([f"{pair.letter}: {name}", _pm(*_within(learn, pair.real, pair.rendered)),
                         _number(folded(floor)), _number(ceiling), _pm(*transfer)])
    return [*_columns(rows), ""]


def _pm(value, spread):
    return f"{value:.2f} ± {spread:.2f}" if np.isfinite(value) else "-"


def _parted(scores, real):
    return scores[real], scores[~real]


def _stacked(*sets):
    """Return clues, `real` and runs of real and rendered items one after the other."""
    real = np.concatenate([np.full(len(items.clues), not number) for number, items in enumerate(sets)])
    return (np.concatenate([items.clues for items in sets]), real, np.concatenate([items.runs for items in sets]))


def _within(learn, real, rendered):
    clues, is_real, runs = _stacked(real, rendered)
    scores = by_folds(learn, clues, is_real, runs)
    return auc(*_parted(scores, is_real)), auc_error(scores, is_real, runs)


def _transfer(learn, pair, others):
    """Return AUC and its error for a pair, learned from the others alone."""
    if not others:
        return np.nan, np.nan
    taught = [_stacked(other.real, other.rendered) for other in others]
    learned = learn(np.concatenate([one[0] for one in taught]), np.concatenate([one[1] for one in taught]))
    clues, is_real, runs = _stacked(pair.real, pair.rendered)
    scores = learned(clues)
    return auc(*_parted(scores, is_real)), auc_error(scores, is_real, runs)


def _columns(rows):
    """Return rows of text as lines in columns, the first flush left."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join([row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:]))])
             for row in rows]
    return [lines[0], "-" * len(lines[0]), *lines[1:]]


def draw(path, shown):
    """Write the strongest clues as rows of pictures: the real and the rendered item nearest to the median, by line."""
    from matplotlib.figure import Figure

    rows = [(clue, parts[clue.kind]) for clues, parts in shown for clue in clues]
    columns = 2 * max(len(pairs) for _, pairs in rows)
    figure = Figure(figsize=(2.6 + 1.7 * columns, 1.55 * len(rows) + 0.4), layout="constrained")
    axes = np.atleast_2d(figure.subplots(len(rows), columns))
    for row, (clue, pairs) in zip(axes, rows):
        number = pairs[0].real.names.index(clue.name)
        for axis in row:
            axis.set_axis_off()
        row[0].text(-.06, .5, f"{clue.name}\n{clue.kind}\nexcess {_number(clue.excess)}", ha="right", va="center",
                    fontsize=8, transform=row[0].transAxes)
        for column, (items, what) in enumerate((items, what) for pair in pairs for items, what in (
                (pair.real, f"{pair.letter} real"), (pair.rendered, f"{pair.letter} rendered"))):
            values = items.clues[:, number]
            if not np.isfinite(values).any():
                continue
            item = int(np.nanargmin(np.abs(values - np.nanmedian(values))))
            picture = items.pictures[item]
            if clue.kind == "runs of pings":                          # water and bed in one picture
                picture = np.sqrt(np.maximum(picture, 0))
            top = max(np.quantile(picture, .995), 1e-9)
            row[column].imshow(picture, cmap="gray", vmin=0, vmax=top, aspect="auto", interpolation="nearest")
            row[column].set_title(f"{what}: {values[item]:.3g}", fontsize=7, pad=2)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
