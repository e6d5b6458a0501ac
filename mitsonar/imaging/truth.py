"""The truth of every bin of a picture: whose echo it is, and which echoes are missing because something is in the way.

    share_l = k_j E_jl + C_j P_jl / Σ_l P_jl,   over their sum                           of each instance l
    hidden = Σ_l k_j H_jl / (Σ_l k_j H_jl + k_j B_j)                                     of the seabed's echo

E_jl echo intensity of instance l in bin j and k_j what the picture makes of it: the pulse's gate of a sidescan, the
beams and the resolution of an array (``shown``); C coherent intensity, which is shared out as the powers P of the
instances' own sums, for what they interfere belongs to none; B what the seabed
sends directly, H what it would send from where instance l stands in front of it.
"""
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

HALF = 0.5


@dataclass(frozen=True, kw_only=True)
class BinTruth:
    """Ground truth of bins."""

    label: np.ndarray  # (..., bins)
    share: np.ndarray  # (..., L, bins): of every instance in the bin's energy, as the picture shows it
    hidden: np.ndarray  # (..., bins): share of the seabed's echo that objects hide
    object_shadow: np.ndarray  # (..., bins): number of the instance in whose shadow the bin lies, else 0
    layover: np.ndarray  # (..., bins): separate places that share the bin
    seabed_place: np.ndarray  # (..., bins, 3) [m]: x, y and depth of the seabed that the main lobe sees there


def shares(intensity: np.ndarray, shown: Callable[[np.ndarray], np.ndarray],
           coherent_power: np.ndarray | None = None, coherent_intensity: np.ndarray | None = None) -> np.ndarray:
    """Share of every instance in the bins' energy."""
    # intensity (..., L, bins) [µPa²]; coherent_power (..., L, bins); coherent_intensity (..., bins) [µPa²] -> (..., L,
    # bins)
    total = shown(np.asarray(intensity, float))
    if coherent_power is not None and coherent_intensity is not None:
        power, coherent = shown(np.asarray(coherent_power, float)), coherent_intensity[..., None, :]
        # an echo near the edge of its bin lasts into the next, where its power is not counted
        power = power + np.where(power.sum(-2, keepdims=True) < HALF * coherent, _beside(power), 0)
        whole = power.sum(-2, keepdims=True)
        total = total + np.where(whole > 0, power / np.where(whole > 0, whole, 1), 0) * coherent
    whole = total.sum(-2, keepdims=True)
    return np.where(whole > 0, total / np.where(whole > 0, whole, 1), 0).astype(np.float32)


def _beside(values: np.ndarray) -> np.ndarray:
    """Sums of both neighbours along the last axis."""
    out = np.zeros_like(values)
    out[..., 1:] = values[..., :-1]
    out[..., :-1] += values[..., 1:]
    return out


def shadows(hidden_intensity: np.ndarray, seabed_intensity: np.ndarray, intensity: np.ndarray,
            shown: Callable[[np.ndarray], np.ndarray],
            coherent_intensity: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Share of the seabed's echo that objects hide, and whose shadow a bin lies in."""
    # hidden_intensity (..., L, bins) [µPa²]; seabed_intensity (..., bins) [µPa²]; intensity (..., bins) [µPa²];
    # coherent_intensity (..., bins) [µPa²] -> hidden (..., bins), object_shadow (..., bins)
    by_object = shown(np.asarray(hidden_intensity, float))
    lost = by_object.sum(-2)
    total = lost + shown(np.asarray(seabed_intensity, float))
    hidden = np.where(total > 0, lost / np.where(total > 0, total, 1), 0).astype(np.float32)
    dark = (hidden > HALF) & (shown(np.asarray(intensity, float)) + coherent_intensity < HALF * total)
    return hidden, np.where(dark, by_object.argmax(-2) + 1, 0).astype(np.uint32)


def variables(known: BinTruth, label: np.ndarray, class_of: Mapping[int, int], dims: tuple[str, ...]) -> dict:
    """Return what is known of the bins as variables of a dataset."""
    # label (...); class_of [int, int]
    def entry(values, units, long_name, dims=dims):
        return dims, values, {"units": units, "long_name": long_name}

    return {
        "label": entry(label, "1", "shape that brings most of the echo, objects by the main lobe"),
        "class": entry(np.array([0, *class_of.values()], np.uint32)[label], "1", "class of that shape"),
        "share": entry(np.moveaxis(known.share, -2, 0), "1", "share of each shape in the echo", ("shape", *dims)),
        "hidden": entry(known.hidden, "1", "share of the seabed's echo that objects hide"),
        "object_shadow": entry(known.object_shadow, "1", "object in whose shadow the bin lies; 0: none"),
        "layover": entry(known.layover, "1", "separate places that share the bin"),
        **{f"seabed_{name}": entry(np.ascontiguousarray(known.seabed_place[..., k]), "m",
                                   f"mean {words} of the seabed seen")
           for k, (name, words) in enumerate((("x", "place east"), ("y", "place north"), ("depth", "depth")))}}
