"""Shards: the samples of sweeps in a few large tars, mixed, as WebDataset and Hugging Face's datasets read them.

    SET/train-00000.tar, ...    samples, whole and mixed, about `size` bytes a shard
    SET/index.parquet           a row for every picture: shard, key, parameters, counts by class, size, seconds, hash
    SET/README.md               card, and croissant.json the same for machines

Which sample lies in which shard follows from samples, seed and size alone. A shard gets its name only when it is
complete, so that the same command goes on after an interruption and skips shards that are there.
"""
import hashlib
import json
import os
import tarfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mitsonar.device.files import FilePath, check_writable, clear_left, replacing
from mitsonar.sweep.manifest import Line, lines, sha256
from mitsonar.sweep.parts import manifests

from .card import check_words, write_card
from .index import write_index
from .split import deal, planned

SUFFIX, LAYOUT = ".tar", ".shards"
SMALLEST = 1_000_000               # bytes of a shard
BLOCK, RECORD = 512, 10_240        # bytes, of tars
LARGEST_JSON = 64_000_000          # bytes; those of mitsonar are far shorter
KEPT = ("width", "height", "seabed", "counts", "negatives", "negative_class", "meshes", "sonar", "frequency",
        "file")                    # of a picture's JSON


@dataclass(frozen=True, kw_only=True)
class SampleFile:
    """Finished sample of a sweep."""

    path: Path
    folder: Path  # of its sweep
    record: dict[str, Any]  # its line of the manifest
    pictures: tuple[dict[str, Any], ...]  # `KEPT` of every picture's JSON, with its ``key``
    size: int  # bytes in a shard

    @property
    def seabed(self) -> str:
        """Return the hash of the seabed."""
        return str(self.pictures[0].get("seabed"))


@dataclass(frozen=True, kw_only=True)
class Shard:
    """Samples of one tar."""

    name: str
    subset: str
    samples: tuple[SampleFile, ...]

    @property
    def bytes(self) -> int:
        """Return its size."""
        return -(-(sum(sample.size for sample in self.samples) + 2 * BLOCK) // RECORD) * RECORD


def write_shards(folders: Sequence[FilePath], folder: FilePath, *, size: int = 500_000_000,      # [bytes]
                 shares: Mapping[str, float] | None = None, seed: int = 0, by: str | None = None,
                 about: Mapping[str, Any] | None = None,
                 progress: Callable[[int, int], None] | None = None) -> list[Shard]:
    """Write the samples of sweeps as shards, with an index and a card.

    Parameters
    ----------
    folders : sequence of str or path
        Folders of sweeps whose outputs are samples (.tar).
    folder : str or path
        Folder of the set: new, empty, or of an interrupted run with the same arguments.
    size : int [bytes]
        Size at which a shard ends; samples are never parted.
    shares : dict of str, float, or None
        Shares of the subsets, from `read_shares`; None: the subsets of the plans, and without these all samples are for
        training.
    seed : int
        Seed of the split and of the order of samples.
    by : str or None
        Scene parameter whose values stay in one subset; None: the seabed.
    about : mapping or None
        Words of the card: ``title``, ``licence``, ``authors``, ``homepage``.
    progress : callable(done, total) or None
        Called after every shard.

    Returns
    -------
    list of Shard

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no sweep of samples, a sample is damaged or missing, two have one key, or they cannot be split.
    MissingExtra
        If PyArrow, which writes the index, is not installed.
    """
    if size < SMALLEST:
        raise ValueError(f"a shard of {size:,} bytes was asked for; give at least {SMALLEST:,}.")
    check_words(about or {})
    samples = [sample for place in folders for sample in _samples(Path(place)) if sample.pictures]
    if not samples:
        raise ValueError(f"the samples of {', '.join(map(str, folders))} hold no pictures; give sweeps with others.")
    _check_keys(samples)
    subsets = planned([sample.record.get("split") for sample in samples] if not shares else [],
                      [sample.pictures[0].get("seabed") for sample in samples]) or ["train"] * len(samples)
    if shares:
        subsets = deal([_group(sample, by) for sample in samples], shares, seed, by or "seabed")
    shards = list(_shards(samples, subsets, size, seed))
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"cannot make the folder {folder}: there is a file of that name; give another name.")
    folder.mkdir(parents=True, exist_ok=True)
    _check_layout(folder, shards)
    for done, shard in enumerate(shards):
        if not (path := folder / shard.name).exists() or path.stat().st_size != shard.bytes:
            clear_left(path)
            _write(shard, path)
        if progress is not None:
            progress(done + 1, len(shards))
    write_index(shards, folder / "index.parquet")
    write_card(shards, folder, about or {})
    return shards


def _samples(folder: Path) -> Iterator[SampleFile]:
    """Yield the finished samples of a sweep in the order of its plan."""
    last: dict[str, Line] = {line.output: line for name in manifests(os.fspath(folder))
                             for line in lines(folder / name) if line.entry is not None and line.entry.status == "ok"}
    if not last:
        raise ValueError(f"the folder {folder} is no sweep with finished samples; run a plan whose output ends in "
                         ".tar.")
    for line in sorted(last.values(), key=lambda line: (line.entry.index if line.entry else 0, line.output)):
        path = folder / line.output
        if path.suffix != SUFFIX:
            raise ValueError(f"{path} is no sample; shards are made of sweeps whose output ends in .tar.")
        if not path.is_file() or not path.resolve().is_relative_to(folder.resolve()):
            raise FileNotFoundError(f"{line.path} names {path}, which is not there; run the sweep again to make it.")
        yield _sample(path, line)


def _sample(path, line):
    record, pictures, size = line.record(), [], 0
    if path.stat().st_size != record["bytes"] or sha256(path) != record.get("sha256"):
        raise ValueError(f"{path} was altered after writing; run the sweep again with --verify.")
    try:
        with tarfile.open(path, "r:") as tar:
            for member in tar:
                if not member.isreg() or member.issparse() or "/" in member.name:
                    raise tarfile.ReadError("it holds more than files")
                size += BLOCK + -(-member.size // BLOCK) * BLOCK
                if member.name.endswith(".json"):
                    pictures.append({"key": member.name.removesuffix(".json"), **_about(tar, member)})
    except (tarfile.TarError, ValueError, OSError) as error:
        raise ValueError(f"cannot read the sample {path}: {error}") from None
    return SampleFile(path=path, folder=Path(line.folder), record=record, pictures=tuple(pictures), size=size)


def _about(tar, member):
    """Return `KEPT` of a picture's JSON."""
    wrong = tarfile.ReadError(f"{member.name} does not describe a picture")
    if member.size > LARGEST_JSON:
        raise wrong
    try:
        given = json.loads(tar.extractfile(member).read())
        kept = {name: given.get(name) for name in KEPT}
        json.dumps(kept, ensure_ascii=False).encode()  # raises `ValueError` for what is no text
        texts, frequency = [*map(kept.get, ("seabed", "sonar", "file", "negative_class"))], kept["frequency"]
        numbers = (kept["width"], kept["height"], *kept["counts"].values(), *(kept["negatives"] or {}).values())
    except (ValueError, AttributeError, RecursionError):
        raise wrong from None
    if not all(isinstance(text, str | None) for text in texts) or not _are_meshes(kept["meshes"]):
        raise wrong
    if frequency is not None and not (isinstance(frequency, (int, float)) and 0 <= frequency < 1e15):      # [Hz]
        raise wrong
    if not all(isinstance(number, int) and 0 <= number < 1 << 32 for number in numbers):
        raise wrong
    return kept


def _are_meshes(given):
    """Return True for entries of `sweep.meshes`, or None."""
    return given is None or isinstance(given, list) and all(
        isinstance(entry, dict) and set(entry) == {"mesh", "class", "licence", "author", "source", "sha256"}
        and all(isinstance(text, str) for text in entry.values()) for entry in given)


def _check_keys(samples):
    seen: dict[str, Path] = {}
    for sample in samples:
        for picture in sample.pictures:
            if (other := seen.setdefault(picture["key"], sample.path)) != sample.path:
                raise ValueError(f"{other} and {sample.path} both hold a picture named {picture['key']}; give their "
                                 "plans outputs with different names.")


def _group(sample, by):
    if by is None:
        return sample.seabed
    if by not in sample.record["parameters"]:
        raise ValueError(f"{sample.path} has no scene parameter {by}; it was given "
                         f"{', '.join(sorted(sample.record['parameters'])) or 'none'}.")
    return str(sample.record["parameters"][by])


def _shards(samples, subsets, size, seed) -> Iterator[Shard]:
    """Yield shards of mixed samples, subset by subset."""
    for subset in dict.fromkeys(subsets):
        mixed = sorted((sample for sample, home in zip(samples, subsets, strict=True)
                        if home == subset),
                       key=lambda sample: hashlib.sha256(f"{seed}:{sample.pictures[0]['key']}".encode()).digest())
        held: list[SampleFile] = []
        number = filled = 0
        for sample in mixed:
            if held and filled + sample.size > size:
                yield Shard(name=f"{subset}-{number:05}.tar", subset=subset, samples=tuple(held))
                held, number, filled = [], number + 1, 0
            held.append(sample)
            filled += sample.size
        if held:
            yield Shard(name=f"{subset}-{number:05}.tar", subset=subset, samples=tuple(held))


def _check_layout(folder, shards):
    """Raise `ValueError` if a folder holds shards of other samples or of another split."""
    layout = hashlib.sha256(json.dumps([[shard.name, [sample.record["sha256"] for sample in shard.samples]]
                                        for shard in shards]).encode()).hexdigest()
    known = folder / LAYOUT
    clear_left(known)
    if known.is_file():
        if known.read_text(encoding="utf-8").strip() == layout:
            return
        raise ValueError(f"{folder} holds shards of other samples, or of another split or size; give another folder.")
    if any(folder.iterdir()):
        raise ValueError(f"the folder {folder} is not empty; give another folder, or remove this one.")
    with replacing(check_writable(known)) as temporary:
        temporary.write_text(layout + "\n", encoding="utf-8")


def _write(shard, path):
    with replacing(path) as temporary, tarfile.open(temporary, "w", format=tarfile.USTAR_FORMAT) as tar:
        for sample in shard.samples:
            with tarfile.open(sample.path, "r:") as one:
                for member in one:
                    tar.addfile(member, one.extractfile(member))
