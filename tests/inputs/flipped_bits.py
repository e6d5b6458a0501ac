"""Copies of a file with flipped bits, each of which has to be read or refused in a sentence."""
import warnings
from collections.abc import Callable
from pathlib import Path

COPIES = 200


def refusals(path: Path, read: Callable[[Path], object], begins: str, flipped: Callable[[int], object], rng) -> int:
    """Return how many of `COPIES` copies are refused; ``flipped(length)`` gives the bytes of which a bit is flipped."""
    raw, bad, refused = path.read_bytes(), path.with_name(f"bad{path.suffix}"), 0
    for _ in range(COPIES):
        content = bytearray(raw)
        for at in flipped(len(raw)):
            content[at] ^= 1 << int(rng.integers(8))
        bad.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            warnings.simplefilter("error", RuntimeWarning)
            try:
                read(bad)
            except ValueError as error:
                assert str(error).startswith(begins) and "\n" not in str(error)
                refused += 1
    return refused
