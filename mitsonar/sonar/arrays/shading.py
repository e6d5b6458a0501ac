"""Windows over an array's elements, by name, as SciPy computes them.

A window is a name, ``"hann"``, or a name with its numbers, ``("chebwin", 30)`` or in one string ``"chebwin 30"``
(scipy.signal.windows; symmetric). Weights are scaled to a largest weight of 1, so that shading lowers the level of no
element above its own. The taper loss 10 log10 (Σw)²/(N Σw²) is the loss against noise that is independent from element
to element.
"""
from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.lazy import module_alone
from mitsonar.device.spelling import meant
from mitsonar.units import db_from_power

# name -> the numbers it takes; those with a default need not be written
WINDOWS = {
    "boxcar": (), "triang": (), "bartlett": (), "barthann": (), "parzen": (), "bohman": (), "hann": (), "hamming": (),
    "blackman": (), "nuttall": (), "blackmanharris": (), "flattop": (), "cosine": (), "lanczos": (),
    "chebwin": ("attenuation in dB",), "taylor": ("nbar = 4", "side lobes in dB = 30"), "kaiser": ("beta",),
    "gaussian": ("standard deviation in elements",), "tukey": ("tapered share = 0.5",), "general_hamming": ("alpha",),
    "general_gaussian": ("power", "standard deviation in elements"), "dpss": ("time half bandwidth",),
}
LARGEST = {"tukey": 1, "taylor": 1000}     # numbers of others are bounded by 0 alone; taylor sums nbar² terms


def window_weights(window: str | tuple, elements: int) -> np.ndarray:
    """Compute the weights of a window.

    Examples
    --------
    >>> window_weights(("chebwin", 30), 16)[:3].round(4)
    array([0.291 , 0.3173, 0.4557])
    """
    name, *numbers = (window.split() if isinstance(window, str) else window) or ("",)
    if name not in WINDOWS:
        raise ValueError(f'window is "{name}"{meant(name, WINDOWS)}; give one of {", ".join(WINDOWS)}.')
    get_window = module_alone("scipy.signal", "windows/_windows.py").get_window

    takes, said = WINDOWS[name], " ".join(map(str, (name, *numbers)))
    needs = f"the numbers ({', '.join(takes)})" if takes else "no numbers"
    if not sum("=" not in number for number in takes) <= len(numbers) <= len(takes):
        raise ValueError(f'window is "{said}", but {name} takes {needs}.')
    largest = LARGEST.get(name, np.inf)
    try:
        numbers = [int(value) if value.is_integer() else value for value in map(float, numbers)]
    except (ValueError, TypeError):
        raise ValueError(f'window is "{said}", but {name} takes {needs}.') from None
    if any(not 0 <= value <= largest for value in numbers):
        bound = "of 0 or more" if np.isinf(largest) else f"from 0 to {largest}"
        raise ValueError(f'window is "{said}", but {name} takes {needs}, {bound}.')
    try:
        with warnings.catch_warnings():
            # SciPy's advice on spectra below 45 dB of attenuation does not concern arrays.
            warnings.simplefilter("ignore")
            asked: Any = (name, *numbers) if numbers else name
            weights = get_window(asked, elements, fftbins=False)
    except (ValueError, TypeError, ArithmeticError):
        weights = np.full(elements, np.nan)
    if not (np.isfinite(weights).all() and np.max(weights) > 0):
        raise ValueError(f'window "{said}" leaves nothing of {elements} elements; {name} takes {needs}: change them '
                         "or take another window.")
    # Ends that SciPy gives as 1e-17 are elements that are off.
    return np.where(np.abs(weights) < 1e-12, 0.0, weights) / np.max(weights)


def taper_loss_db(weights: ArrayLike) -> float:
    """Return the loss [dB] of weights (E,) against independent noise: 0 for equal weights, negative for others."""
    weights = np.asarray(weights, dtype=np.float64)
    return float(db_from_power(weights.sum() ** 2 / (weights.size * (weights ** 2).sum())))
