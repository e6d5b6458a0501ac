"""Real and rendered lines and frames as amplitudes, and patches of frames that clues are taken from.

Lines, and what of them clues are taken from, are those of `mitsonar.comparison.sidescan_amplitudes`.
"""
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

import mitsonar
from mitsonar.comparison.clue_features import patch_clues
from mitsonar.comparison.sidescan_amplitudes import (
    SIDES,
    ClueItems,
    SidescanAmplitudes,
    amplitudes_of,
    items_of,
    rendered_amplitudes,
)

FRAME_PATCH, FRAME_STEP = 32, 16   # samples and beams
SECTOR = 64                        # beams that are left out together


@dataclass(frozen=True, kw_only=True)
class Frames:
    """Amplitudes of an imaging sonar's frames."""

    name: str
    frames: np.ndarray  # (frame, beam, sample)
    about: str


def line(path: str) -> SidescanAmplitudes:
    """Read a line: NPZ with `port`, `starboard` and `spacing`, else what mitsonar.read opens."""
    if path.lower().endswith(".npz"):
        with np.load(path) as file:
            _check_names(path, file, (*SIDES, "spacing"))
            return SidescanAmplitudes(name=Path(path).stem, sides=tuple(file[side].astype(float) for side in SIDES),
                                      spacing=float(file["spacing"]), about="amplitudes of a file")
    return amplitudes_of(mitsonar.read(path), Path(path).stem)


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
    amplitude, about = rendered_amplitudes(image)
    return Frames(name=Path(path).stem, frames=amplitude.transpose("ping", "beam", "range").values, about=about)


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


def frame_items(record: Frames) -> ClueItems:
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
    return items_of(record.name, patches, lambda stack: patch_clues(stack, "beam"), sectors, halves)
