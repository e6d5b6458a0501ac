"""Quality of scores: how well they part objects from the rest, and how to make them probabilities.

    AUC  = P(s+ > s-) + P(s+ = s-) / 2                 scores of objects and of the rest; by chance 0.5
    AP   = mean over objects of the precision down to their score              by chance their share
    ECE  = sum over classes of |sum (p - y)| / N       p in classes of a tenth, y 1 for objects, else 0
    p    = 1 / (1 + exp(-(a s + b)))                   a, b of the greatest likelihood

s -> ``scores``, p -> ``probability``, y -> ``wanted``. ECE is the expected calibration error of Naeini et al. (2015), p
the sigmoid of Platt (1999).
"""
from collections.abc import Callable

import numpy as np

CLASSES = 10                       # of probability


def auc(scores: np.ndarray, wanted: np.ndarray) -> float:
    """Return the area under the curve of detections over false alarms.

    Parameters
    ----------
    scores : (N,)
        Higher scores for objects.
    wanted : (N,) bool
        Whether each item is an object.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If shapes differ, scores are not finite, or objects or the rest are missing.
    """
    from scipy import stats

    scores, wanted = _checked(scores, wanted)
    objects = np.count_nonzero(wanted)
    ranks = stats.rankdata(scores)[wanted].sum() - objects * (objects + 1) / 2
    return float(ranks / (objects * (wanted.size - objects)))


def average_precision(scores: np.ndarray, wanted: np.ndarray) -> float:
    """Return the area under the curve of precision over recall; for arguments and errors see `auc`."""
    scores, wanted = _checked(scores, wanted)
    order = np.argsort(-scores, kind="stable")
    scores, wanted = scores[order], wanted[order]
    right = np.cumsum(wanted)
    # equal scores are found together
    last = np.searchsorted(-scores, -scores, side="right") - 1
    return float((right[last] / (last + 1))[wanted].mean())


def calibration_error(probability: np.ndarray, wanted: np.ndarray) -> float:
    """Return the expected calibration error, 0 to 1, of probabilities (N,) in ten classes; for errors see `auc`."""
    probability, wanted = _checked(probability, wanted)
    if probability.min() < 0 or probability.max() > 1:
        raise ValueError(f"probabilities go from {probability.min():g} to {probability.max():g}; give 0 to 1.")
    number = np.minimum((CLASSES * probability).astype(int), CLASSES - 1)
    return float(np.abs(np.bincount(number, probability - wanted, CLASSES)).sum() / wanted.size)


def calibration(scores: np.ndarray, wanted: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the probability of an object as a function of scores, fitted to scores (N,) of known items.

    Objects must have the share among these items that they have elsewhere. For arguments and errors see `auc`.
    """
    from scipy import optimize, special

    scores, wanted = _checked(scores, wanted)
    middle, spread = scores.mean(), max(scores.std(), 1e-300)
    signed, sign = (scores - middle) / spread, np.where(wanted, -1.0, 1.0)

    def cost(numbers: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the mean of -log p of what is there, and its gradient."""
        against = sign * (numbers[0] * signed + numbers[1])
        slope = sign * special.expit(against)
        return float(np.logaddexp(0, against).mean()), np.array([(slope * signed).mean(), slope.mean()])

    a, b = optimize.minimize(cost, (1.0, 0.0), jac=True).x
    return lambda values: special.expit(a * (np.asarray(values, float) - middle) / spread + b)


def _checked(scores, wanted):
    scores, wanted = np.asarray(scores, float), np.asarray(wanted, bool)
    if scores.shape != wanted.shape or scores.ndim != 1 or not np.isfinite(scores).all():
        raise ValueError(f"scores have the shape {scores.shape} and labels {wanted.shape}; give one finite score for "
                         "each label.")
    if wanted.all() or not wanted.any():
        raise ValueError(f"{np.count_nonzero(wanted)} of {wanted.size} labels are objects; both kinds are needed.")
    return scores, wanted
