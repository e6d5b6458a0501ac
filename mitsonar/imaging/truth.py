"""Ground truth of every bin of an image: the instances that return its echo, and the seabed echo that objects hide.

    share_l = k_j E_jl + C_j P_jl / Σ_l P_jl,   over their sum                           of each instance l
    hidden = Σ_l k_j H_jl / (Σ_l k_j H_jl + k_j B_j)                                     of the seabed's echo

E_jl is the echo intensity of instance l in bin j, and k_j the response of the image (``shown``): the pulse's gate of a
sidescan, or the beams and resolution of an array. C is the coherent intensity, divided in proportion to the powers P of
the instances' own sums, since their interference belongs to no single instance. B is the direct echo of the seabed, and
H_l the echo that instance l hides.
"""
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

HALF = 0.5


@dataclass(frozen=True, kw_only=True)
class BinTruth:
    """Ground truth of bins."""

    label: np.ndarray  # (..., bins)
    share: np.ndarray  # (..., L, bins): of every instance in the energy of the bin, as imaged
    hidden: np.ndarray  # (..., bins): share of the seabed's echo that objects hide
    object_shadow: np.ndarray  # (..., bins): number of the instance whose shadow covers the bin, else 0
    layover: np.ndarray  # (..., bins): separate places that share the bin
    seabed_place: np.ndarray  # (..., bins, 3) [m]: x, y and depth of the seabed in the main lobe


def shares(intensity: np.ndarray, shown: Callable[[np.ndarray], np.ndarray],
           coherent_power: np.ndarray | None = None, coherent_intensity: np.ndarray | None = None) -> np.ndarray:
    """Return the share (..., L, bins) of every instance in the energy of the bins.

    Intensities [µPa²]: of instances (..., L, bins), incoherent and coherent; of all coherent echoes (..., bins).
    """
    there, part = _present(intensity, coherent_power), np.zeros(intensity.shape, np.float32)
    total = shown(np.asarray(intensity[..., there, :], float))
    if coherent_power is not None and coherent_intensity is not None:
        power, coherent = shown(np.asarray(coherent_power[..., there, :], float)), coherent_intensity[..., None, :]
        # an echo near the edge of its bin extends into the next, where its power is not counted
        power = power + np.where(power.sum(-2, keepdims=True) < HALF * coherent, _beside(power), 0)
        total = total + _shared(power) * coherent
    part[..., there, :] = _shared(total)
    return part


def _present(*powers: np.ndarray | None) -> np.ndarray:
    """Return the numbers of the instances with any power (..., L, bins): a few pings see few of a scene's objects."""
    seen = [power.any(axis=(*range(power.ndim - 2), -1)) for power in powers if power is not None]
    return np.flatnonzero(np.any(seen, axis=0))


def _shared(power: np.ndarray) -> np.ndarray:
    """Return the shares of powers (..., L, bins) in their sum over L, 0 where the sum is 0."""
    total = power.sum(-2, keepdims=True)
    return power / np.where(total > 0, total, np.inf)


def _beside(values: np.ndarray) -> np.ndarray:
    """Return the sum of both neighbours along the last axis."""
    out = np.zeros_like(values)
    out[..., 1:] = values[..., :-1]
    out[..., :-1] += values[..., 1:]
    return out


def shadows(hidden_intensity: np.ndarray, seabed_intensity: np.ndarray, intensity: np.ndarray,
            shown: Callable[[np.ndarray], np.ndarray],
            coherent_intensity: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the hidden share of the seabed's echo, and the number of the hiding instance, both (..., bins).

    Intensities [µPa²]: hidden by each instance (..., L, bins); of the seabed, all and coherent echoes (..., bins).
    """
    there = _present(hidden_intensity)
    by_object = shown(np.asarray(hidden_intensity[..., there, :], float))
    lost = by_object.sum(-2)
    total = lost + shown(np.asarray(seabed_intensity, float))
    hidden = np.where(total > 0, lost / np.where(total > 0, total, 1), 0).astype(np.float32)
    dark = (hidden > HALF) & (shown(np.asarray(intensity, float)) + coherent_intensity < HALF * total)
    number = there[by_object.argmax(-2)] + 1 if there.size else np.zeros(hidden.shape)
    return hidden, np.where(dark, number, 0).astype(np.uint32)


def variables(known: BinTruth, label: np.ndarray, class_of: Mapping[int, int], dims: tuple[str, ...]) -> dict:
    """Return the truth of the bins as variables of a dataset."""
    def entry(values: np.ndarray, units: str, long_name: str,
              dims: tuple[str, ...] = dims) -> tuple[tuple[str, ...], np.ndarray, dict[str, str]]:
        return dims, values, {"units": units, "long_name": long_name}

    return {
        "label": entry(label, "1", "shape with most of the echo, objects only in the main lobe"),
        "class": entry(np.array([0, *class_of.values()], np.uint32)[label], "1", "class of that shape"),
        "share": entry(np.moveaxis(known.share, -2, 0), "1", "share of each shape in the echo", ("shape", *dims)),
        "hidden": entry(known.hidden, "1", "share of the seabed's echo that objects hide"),
        "object_shadow": entry(known.object_shadow, "1", "object whose shadow covers the bin; 0: none"),
        "layover": entry(known.layover, "1", "number of separate places in the bin"),
        **{f"seabed_{name}": entry(np.ascontiguousarray(known.seabed_place[..., k]), "m",
                                   f"mean {words} of the seabed seen")
           for k, (name, words) in enumerate((("x", "place east"), ("y", "place north"), ("depth", "depth")))}}
