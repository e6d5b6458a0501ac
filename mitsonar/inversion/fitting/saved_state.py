"""State of a fit in a file, written after every step, from which an interrupted fit resumes.

The file holds arrays (NumPy's .npz) and a fingerprint of the fit: its record, names, start and priors. The caller adds
the rest of the model, such as the scene, as ``about``.
"""
from __future__ import annotations

import hashlib
import zipfile

import numpy as np

from mitsonar.device.files import FilePath, check_readable, replacing

from .iteration import State
from .likelihood import Likelihood
from .unknowns import Unknowns

ARRAYS = "z", "deviance", "cost", "step", "radius", "stuck", "begins"
MOST_STEPS = 100_000
ROOM = 4096                        # bytes of an array's header


def fingerprint(unknowns: Unknowns, likelihood: Likelihood, about: str) -> str:
    """Return the digest of a fit's record, unknowns and priors."""
    digest = hashlib.sha256(about.encode())
    size = likelihood.counted.size
    probe = np.linspace(0.5, 1.5, unknowns.size)
    terms = likelihood.terms(np.ones(size))
    for array in (unknowns.deviation, probe, unknowns.flat(unknowns.values(probe)), unknowns.flat(unknowns.start),
                  likelihood.counted, terms.deviance, terms.weight):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update("\n".join(f"{name} {unknowns.bound[name].classes!r}" for name in unknowns.names).encode())
    return digest.hexdigest()


def save_state(path: FilePath, state: State, mark: str) -> None:
    """Write a state, whole or not at all."""
    arrays = {name: np.asarray(getattr(state, name)) for name in ARRAYS}
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, allow_pickle=False, mark=np.array(mark), **arrays)


def load_state(path: FilePath, mark: str, size: int, stages: int = 1) -> State:
    """Read a state of the same fit."""
    check_readable(path, "the fit's state", "a file that a fit left")
    wrong = f"cannot go on with {path}: it is no whole state of a fit; remove it, and begin anew"
    try:
        with zipfile.ZipFile(path) as archive:
            if max((one.file_size for one in archive.infolist()), default=0) > 8 * (size + MOST_STEPS) + ROOM:
                raise ValueError(wrong)
        with np.load(path, allow_pickle=False) as found:
            if str(found["mark"]) != mark:
                raise ValueError(f"cannot go on with {path}: it is the state of another fit, of another record, start "
                                 "or prior; remove it, or name another file")
            arrays = {name: found[name] for name in ARRAYS}
    except MemoryError:
        raise
    except Exception as error:                         # of many kinds, by where the archive is damaged
        if str(error).startswith("cannot go on"):
            raise
        raise ValueError(wrong) from None
    steps = arrays["cost"].shape
    if arrays["z"].shape != (size,) or len(steps) != 1 or not steps[0] or arrays["deviance"].shape != steps \
            or arrays["step"].shape != steps or not _begins(arrays["begins"], steps[0], stages) \
            or not all(arrays[name].dtype.kind in "fbi" and np.isfinite(arrays[name]).all() for name in ARRAYS):
        raise ValueError(wrong)
    return State(z=arrays["z"], deviance=arrays["deviance"], cost=arrays["cost"], step=arrays["step"],
                 radius=float(arrays["radius"]), stuck=bool(arrays["stuck"]),
                 begins=arrays["begins"])


def _begins(begins: np.ndarray, steps: int, stages: int) -> bool:
    """Return True if stages can have begun at these iterations."""
    return (begins.ndim == 1 and 0 < begins.size <= stages and begins.dtype.kind == "i" and begins[0] == 0
            and bool(np.all(np.diff(begins) >= 0)) and begins[-1] < steps)
