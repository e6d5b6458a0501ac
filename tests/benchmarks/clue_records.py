"""Real and rendered pictures as amplitudes, and what of them clues are taken from: patches of bed, runs of pings.

A rendered record is compared by its variable `recorded`, the counts of its recorder, as it is. Without one, by

    A = 10^((L + 30 log R + 2 a R) / 20)

L -> `level`, R -> `range`, held before the bed's first return at the altitude: a gain that fell with R there would hide
the transmission. a -> the attribute absorption_db.
"""
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from clue_features import RUN, patch_clues, run_clues

import mitsonar
from mitsonar.imaging.picture_statistics import first_return
from mitsonar.io.xtf import read_amplitudes

PATCHES = 14                       # across the bed of a run
FRAME_PATCH, FRAME_STEP = 32, 16   # samples and beams
SECTOR = 64                        # beams that are left out together
NEAR = 2.0                         # [m] beyond the first return, no bed
DARK = 0.15                        # of the median: patches that are darker lie in shadow
SIDES = "port", "starboard"


@dataclass(frozen=True, kw_only=True)
class Line:
    """Amplitudes of a sidescan's line, and how they came about."""

    name: str
    sides: tuple[np.ndarray, np.ndarray]  # (ping, sample), near range first
    spacing: float  # [m]: of samples
    about: str  # what is known of it


@dataclass(frozen=True, kw_only=True)
class Frames:
    """Amplitudes of an imaging sonar's frames."""

    name: str
    frames: np.ndarray  # (frame, beam, sample)
    about: str


@dataclass(frozen=True, kw_only=True)
class Items:
    """Items that clues are taken from."""

    names: tuple[str, ...]  # of clues, F
    clues: np.ndarray  # (n, F)
    runs: np.ndarray  # (n,): number of the run of pings, or of the sector of a fan; both sides share it
    sides: np.ndarray  # (n,): 0 port, 1 starboard; halves of a fan
    pictures: list  # n arrays (row, sample), to look at


def line(path: str) -> Line:
    """Read a line: XTF as recorded, NPZ with `port`, `starboard` and `spacing`, else what mitsonar.read opens."""
    if path.lower().endswith(".xtf"):
        record = read_amplitudes(path)
        amplitude = record["amplitude"].values.astype(float)
        return Line(name=Path(path).stem, sides=(amplitude[:, 0], amplitude[:, 1]), about="as recorded",
                    spacing=float(record["range"].diff("range").mean()))
    if path.lower().endswith(".npz"):
        with np.load(path) as file:
            _check_names(path, file, (*SIDES, "spacing"))
            return Line(name=Path(path).stem, sides=tuple(file[side].astype(float) for side in SIDES),
                        spacing=float(file["spacing"]), about="amplitudes of a file")
    image = mitsonar.read(path)
    if "side" not in image.dims:
        raise ValueError(f"{path} is a picture of {' x '.join(image.sizes)}, not of two sides; give a sidescan's, "
                         "or frames by --frames.")
    amplitude, about = _rendered(image)
    return Line(name=Path(path).stem, sides=tuple(amplitude.sel(side=side).values for side in SIDES),
                spacing=float(image.attrs["bin_width"]), about=about)


def frames(path: str) -> Frames:
    """Read frames: Oculus .raw, .aris, NPZ with `frames` (frame, range, beam), else what mitsonar.read opens."""
    readers = {".raw": _oculus, ".aris": _aris, ".npz": _npz_frames}
    reader = readers.get(Path(path).suffix.lower())
    if reader:
        return Frames(name=Path(path).stem, frames=reader(path).transpose(0, 2, 1).astype(float), about="as recorded")
    image = mitsonar.read(path)
    if not {"ping", "beam", "range"} <= set(image["level"].dims):
        raise ValueError(f"{path} is a picture of {' x '.join(image.sizes)}, not of beams by range; give a "
                         "forward-looking sonar's.")
    amplitude, about = _rendered(image)
    return Frames(name=Path(path).stem, frames=amplitude.transpose("ping", "beam", "range").values, about=about)


def _rendered(image):
    """Return amplitudes as a DataArray, and what they are."""
    given = " ".join(f"{name}={value}" for name, value in image.attrs.get("parameters", {}).items())
    scene = f"{image.attrs.get('file', 'scene')} {given}".strip()
    if "recorded" in image:
        return image["recorded"].astype(float), f"counts of its recorder; {scene}"
    distance = image["range"].astype(float)
    if "altitude" in image:
        distance = np.maximum(distance, float(image["altitude"].median()))
    level = image["level"].astype(float)
    gain = 30 * np.log10(np.maximum(distance, 1e-2)) + 2 * image.attrs.get("absorption_db", 0.0) * distance
    amplitude = (10 ** ((level + gain - 120) / 20)).where(level > -190, 0.0)
    return amplitude.transpose(*level.dims), f"levels, no recorder; {scene}"


def _check_names(path, file, wanted):
    missing = [name for name in wanted if name not in file]
    if missing:
        raise ValueError(f"{path} lacks {' and '.join(missing)}; it has {', '.join(file)}.")


def _npz_frames(path):
    with np.load(path) as file:
        _check_names(path, file, ("frames",))
        return file["frames"]


def _oculus(path):
    """Read simple ping results of version 1 of the Oculus protocol, 8 bits, as (frame, range, beam)."""
    data, at, read = Path(path).read_bytes(), 0, []
    while at + 122 <= len(data) and data[at:at + 2] == b"SO":
        ranges, beams = np.frombuffer(data, "<u2", 2, at + 106)
        offset, size, length = np.frombuffer(data, "<u4", 3, at + 110)
        if data[at + 6:at + 8] != b"#\0" or size != int(ranges) * int(beams) or at + offset + size > len(data):
            raise ValueError(f"cannot read {path}: byte {at} starts no ping of 8 bits of the first version; give "
                             "frames as NPZ.")
        read.append(np.frombuffer(data, np.uint8, size, at + offset).reshape(ranges, beams))
        at += int(length)
    return _stacked(path, read)


def _aris(path):
    """Read frames of an ARIS file of version 5 as (frame, range, beam): each behind a header of 1024 bytes."""
    data = Path(path).read_bytes()
    if data[:4] != b"DDF\x05":
        raise ValueError(f"cannot read {path}: it is no ARIS file of version 5.")
    count, beams, ranges = (int(np.frombuffer(data, "<u4", 1, at)[0]) for at in (4, 16, 24))
    starts = 2048 + np.arange(count) * (1024 + beams * ranges)
    return _stacked(path, [np.frombuffer(data, np.uint8, beams * ranges, start).reshape(ranges, beams)
                           for start in starts if start + beams * ranges <= len(data)])


def _stacked(path, read):
    if not read or len({frame.shape for frame in read}) != 1:
        raise ValueError(f"cannot read {path}: it has no frames, or frames of several sizes.")
    return np.stack(read)


def bed_items(record: Line) -> Items:
    """Cut patches of bed, RUN pings by RUN samples, over the median of their range."""
    patches, runs, sides = [], [], []
    for number, amplitude in enumerate(record.sides):
        first = first_return(amplitude, record.spacing)
        count = amplitude.shape[1]
        bed = np.ma.array(amplitude, mask=np.arange(count) < first[:, None] + 3)
        middle = np.maximum(ndimage.gaussian_filter1d(np.ma.median(bed, 0).filled(1.0), 6), 1e-9)
        for run, start in enumerate(range(0, len(amplitude) - RUN + 1, RUN)):
            near = int(first[start:start + RUN].max() + NEAR / record.spacing)
            for place in np.linspace(near, .97 * count - RUN, PATCHES).astype(int) if near < .97 * count - RUN else ():
                patch = amplitude[start:start + RUN, place:place + RUN] / middle[place:place + RUN]
                if patch.mean() >= DARK:
                    patches.append(patch)
                    runs.append(run)
                    sides.append(number)
    return _items(record, patches, patch_clues, runs, sides)


def run_items(record: Line) -> Items:
    """Take runs of RUN pings of a side as a whole."""
    pictures, runs, sides, clues = [], [], [], []
    for number, amplitude in enumerate(record.sides):
        first, other = first_return(amplitude, record.spacing), record.sides[1 - number]
        for run, start in enumerate(range(0, len(amplitude) - RUN + 1, RUN)):
            part = slice(start, start + RUN)
            clues.append(run_clues(amplitude[part], other[part], first[part], record.spacing))
            pictures.append(amplitude[part])
            runs.append(run)
            sides.append(number)
    names = tuple(dict.fromkeys(name for one in clues for name in one))
    return _items(record, pictures, None, runs, sides, names,
                  np.array([[one.get(name, np.nan) for name in names] for one in clues]))


def frame_items(record: Frames) -> Items:
    """Cut patches of ensonified bed out of frames, FRAME_PATCH beams by samples, over their local mean."""
    patches, sectors, halves = [], [], []
    for frame in record.frames:
        local = np.maximum(ndimage.gaussian_filter(frame, (12, 25)), 1e-3 * frame.max() + 1e-12)
        bright = np.quantile(local, .6)
        beams, samples = frame.shape
        for beam in range(0, beams - FRAME_PATCH + 1, FRAME_STEP):
            for sample in range(40, samples - FRAME_PATCH, FRAME_STEP):
                part = np.s_[beam:beam + FRAME_PATCH, sample:sample + FRAME_PATCH]
                if local[part].mean() >= bright:
                    patches.append(frame[part] / local[part])
                    sectors.append(beam // SECTOR)
                    halves.append(int(beam >= beams // 2))
    return _items(record, patches, lambda stack: patch_clues(stack, "beam"), sectors, halves)


def _items(record, pictures, clues_of, runs, sides, names=(), clues=None):
    if len(pictures) < 8:
        raise ValueError(f"{record.name} has {len(pictures)} items to compare; at least 8 are needed: give more pings, "
                         "or a longer range.")
    if clues_of:
        found = clues_of(np.stack(pictures))
        names, clues = tuple(found), np.stack(list(found.values()), 1)
    return Items(names=tuple(names), clues=clues, runs=np.array(runs), sides=np.array(sides), pictures=pictures)
