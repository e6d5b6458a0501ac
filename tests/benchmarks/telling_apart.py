"""Measure how well two sets of items are told apart: by one clue, by all, and by what other lines taught.

    AUC = P(real > rendered) + P(real = rendered) / 2          one clue; 0.5: none, 0 and 1: always told apart

All clues together go to a forest (Breiman 2001: bootstraps, sqrt(F) clues a split, Gini impurity) and to a logistic
regression with a ridge. Both draw or weigh the two sets alike, so that unequal numbers teach nothing. A score is only
of items that were not learned from: whole runs of pings are left out together, because neighbours are alike.
"""
import numpy as np

TREES, LEAF = 80, 3
RIDGE = 3.0                        # of standardised clues, against a sum over items
FOLDS = 5


def folded(value):
    """Return an AUC without its sign, 0.5 to 1."""
    return max(value, 1 - value)


def logistic(clues, real):
    """Learn a logistic regression from clues (n, F) and `real` (n,) bool; return its scores as a function of clues."""
    filled, standard = _standardised(clues)
    design = np.column_stack((np.ones(len(real)), standard(filled(clues))))
    weight = np.where(real, .5 / real.mean(), .5 / (1 - real.mean()))
    ridge = np.diag(np.r_[0.0, np.full(clues.shape[1], RIDGE)])
    slopes = np.zeros(design.shape[1])
    for _ in range(25):                                               # Newton's method
        chance = 1 / (1 + np.exp(-np.clip(design @ slopes, -30, 30)))
        slope = design.T @ (weight * (real - chance)) - ridge @ slopes
        curvature = (design * (weight * chance * (1 - chance))[:, None]).T @ design + ridge
        step = np.linalg.solve(curvature + 1e-9 * np.eye(len(slopes)), slope)
        slopes = slopes + step
        if np.abs(step).max() < 1e-6:
            break
    return lambda other: standard(filled(other)) @ slopes[1:] + slopes[0]


def forest(clues, real, seed=0):
    """Learn a forest from clues (n, F) and `real` (n,) bool; return its scores as a function of clues."""
    rng = np.random.default_rng(seed)
    filled, _ = _standardised(clues)
    clues, sets = filled(clues), [np.flatnonzero(real), np.flatnonzero(~real)]
    size = int(np.mean([len(part) for part in sets]))
    trees = []
    for _ in range(TREES):
        drawn = np.concatenate([rng.choice(part, size) for part in sets])        # as many of either
        trees.append(_tree(clues[drawn], real[drawn].astype(float), rng))
    return lambda other: np.mean([_asked(tree, filled(other)) for tree in trees], 0)


def by_folds(learn, clues, real, runs):
    """Return scores (n,) of items, each by what was learned from the other runs (n,) alone."""
    scores = np.full(len(real), np.nan)
    names = np.unique(runs)
    order = np.random.default_rng(0).permutation(names.size)
    for fold in range(min(FOLDS, names.size)):
        left_out = np.isin(runs, names[order % FOLDS == fold] if names.size > FOLDS else names[order == fold])
        if left_out.any() and 0 < real[~left_out].mean() < 1:
            scores[left_out] = learn(clues[~left_out], real[~left_out])(clues[left_out])
    return scores


def _standardised(clues):
    """Return functions that fill missing values by means, and that scale to a mean of 0 and a deviation of 1."""
    known = np.isfinite(clues)
    mean = np.where(known, clues, 0).sum(0) / np.maximum(known.sum(0), 1)
    deviation = np.where(known, clues - mean, 0).std(0)
    scale = np.where(deviation > 1e-12, deviation, np.inf)            # what never differs takes no part
    return (lambda other: np.where(np.isfinite(other), other, mean),
            lambda other: np.clip((other - mean) / scale, -8, 8))


def _tree(clues, real, rng):
    """Grow one tree: rows of clue, threshold, child below (the one above follows it), and share of real items."""
    nodes, todo = [[0, 0.0, -1, real.mean()]], [(0, np.arange(len(real)))]
    tried = max(1, round(np.sqrt(clues.shape[1])))
    while todo:
        node, items = todo.pop()
        if len(items) < 2 * LEAF or real[items].min() == real[items].max():
            continue
        candidates = rng.choice(clues.shape[1], tried, replace=False)
        split = _best_split(clues[items[:, None], candidates], real[items])
        if split is None:
            continue
        clue, threshold = candidates[split[0]], split[1]
        below = clues[items, clue] <= threshold
        nodes[node][:3] = clue, threshold, len(nodes)
        for part in (items[below], items[~below]):
            todo.append((len(nodes), part))
            nodes.append([0, 0.0, -1, real[part].mean()])
    return np.array(nodes)


def _best_split(values, real):
    """Return column and threshold of the least Gini impurity of values (n, columns), or None."""
    order = values.argsort(0)
    ordered = np.take_along_axis(values, order, 0)
    count = np.arange(1, len(real))[:, None]
    below = real[order].cumsum(0)[:-1]
    above = real.sum() - below
    # Gini: the sum over both sides of n p (1 - p)
    impurity = below * (1 - below / count) + above * (1 - above / (len(real) - count))
    usable = (np.diff(ordered, axis=0) > 0) & (count >= LEAF) & (count <= len(real) - LEAF)
    impurity = np.where(usable, impurity, np.inf)
    place, column = np.unravel_index(impurity.argmin(), impurity.shape)
    if not usable[place, column]:
        return None
    lower, upper = ordered[place, column], ordered[place + 1, column]
    middle = (lower + upper) / 2
    return column, middle if lower <= middle < upper else lower


def _asked(tree, clues):
    """Return the shares (n,) of real items in the leaves that clues (n, F) fall in."""
    node = np.zeros(len(clues), int)
    while True:
        child = tree[node, 2].astype(int)
        inner = child >= 0
        if not inner.any():
            return tree[node, 3]
        above = clues[np.arange(len(clues)), tree[node, 0].astype(int)] > tree[node, 1]
        node = np.where(inner, child + above, node)
