"""Subsets for training, validation and test that share no seabed.

Images of one seabed are nearly copies of each other, so groups are assigned rather than images: in an order hashed from
seed and group, each group goes to the subset that lacks most images.
"""
import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence

SUBSETS = ("train", "val", "test")


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
