"""Subsets for training, validation and test that share no seabed.

Images of one seabed are nearly copies of each other, so groups are assigned rather than images: in an order hashed from
seed and group, each group goes to the subset that lacks most images. A sweep's plan may have assigned them before
(`mitsonar.sweep.drawing.splits`); then its subsets are taken.
"""
import hashlib
import math
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence

from mitsonar.sweep.manifest import SUBSETS


def read_shares(text: str) -> dict[str, float]:
    """Read shares such as "train=0.8,val=0.1,test=0.1".

    Parameters
    ----------
    text : str
        Subsets and shares.

    Returns
    -------
    dict of str, float
        Share of each subset.

    Raises
    ------
    ValueError
        If the text has another form, or the shares do not add up to 1.
    """
    shares = {}
    for part in text.split(","):
        name, equals, value = (word.strip() for word in part.partition("="))
        try:
            share = float(value)
        except ValueError:
            share = math.nan
        if name not in SUBSETS or not equals or name in shares or not 0 < share <= 1:
            raise ValueError(f"the split has {part.strip()!r}; give each of {', '.join(SUBSETS)} at most once with a "
                             "share above 0, as in train=0.8,val=0.1,test=0.1.")
        shares[name] = share
    if abs(sum(shares.values()) - 1) > 1e-6:
        raise ValueError(f"the shares of the split {text} add up to {sum(shares.values()):g}; they must add up to 1.")
    return shares


def deal(groups: Sequence[str], shares: Mapping[str, float], seed: int = 0, noun: str = "seabed") -> list[str]:
    """Assign images to subsets, group by group.

    Parameters
    ----------
    groups : list of str
        Group of every image; images of one group stay in one subset.
    shares : dict of str, float
        Share of every subset; they add up to 1.
    seed : int
        Seed of the order of groups; the same seed gives the same result.
    noun : str
        Noun for the groups in the error.

    Returns
    -------
    list of str
        Subset of every image. Every subset has at least one group.

    Raises
    ------
    ValueError
        If there are fewer groups than subsets.
    """
    sizes = Counter(groups)
    if len(sizes) < len(shares):
        raise ValueError(f"the images cannot be split into {len(shares)} subsets ({', '.join(shares)}): "
                         f"{len(groups)} image{'s' * (len(groups) != 1)} with {len(sizes)} different "
                         f"{noun}{'s' * (len(sizes) != 1)}, which cannot be shared; add images with others"
                         + (", or split by a parameter of the scene." if noun == "seabed" else "."))
    lacking = {name: share * len(groups) for name, share in shares.items()}
    empty, home = set(shares), {}
    order = sorted(sizes, key=lambda group: hashlib.sha256(f"{seed}:{group}".encode()).digest())
    for left, group in zip(range(len(order), 0, -1), order, strict=True):
        # the last groups are reserved for empty subsets
        allowed = [name for name in shares if name in empty or left > len(empty)]
        home[group] = max(allowed, key=lacking.__getitem__)
        lacking[home[group]] -= sizes[group]
        empty.discard(home[group])
    return [home[group] for group in groups]


def planned(subsets: Sequence[str | None], seabeds: Sequence[str | None]) -> list[str]:
    """Return the subsets that plans gave to images; none if they gave none.

    Parameters
    ----------
    subsets : list of str or None
        Subset of every image by its plan.
    seabeds : list of str or None
        Hash of the seabed of every image.

    Returns
    -------
    list of str
        Subset of every image, or an empty list.

    Raises
    ------
    ValueError
        If only some images have a subset.

    Warns
    -----
    UserWarning
        If a seabed is in two subsets, since the plan's group does not name what makes it.
    """
    given = [subset for subset in subsets if subset is not None]
    if given and len(given) < len(subsets):
        raise ValueError(f"{len(given)} of {len(subsets)} images have a subset from the split of their plan, and the "
                         "others have none; give shares of a split, or only images of such plans.")
    homes: dict[str, str] = {}
    shared = {seabed for seabed, subset in zip(seabeds, given) if seabed and homes.setdefault(seabed, subset) != subset}
    if shared:
        are = "seabeds are" if len(shared) > 1 else "seabed is"
        warnings.warn(f"{len(shared)} {are} in several subsets of the plan; let group in its [split] name the "
                      "parameters that make a seabed", stacklevel=3)
    return given


def shares_of(subsets: Sequence[str]) -> dict[str, float]:
    """Return the shares that subsets have."""
    counts = Counter(subsets)
    return {name: counts[name] / len(subsets) for name in SUBSETS if counts[name]}
