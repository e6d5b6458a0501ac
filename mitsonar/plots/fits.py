"""The picture of a fit with an answer in the plane: truth, start, answer, error and deviation."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .canvas import sheet

__all__ = ["fit_figure"]

ANSWERS = "height", "strength_db"
SHARE = 98                         # percentile of errors that colours span


def fit_figure(fit: xr.Dataset, truth: np.ndarray | None = None) -> Figure:
    """Draw an answer of `fit_heights` or `fit_sediment_map`.

    Parameters
    ----------
    fit : Dataset
    truth : array
        In the shape of the answer, where it is known; else the change since the start stands for the error.

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        If the dataset is no such answer, or the truth has another shape.
    """
    name = next((one for one in ANSWERS if one in fit), None)
    if name is None or not {"start", "deviation"} <= set(fit.variables):
        raise ValueError(f"the picture of a fit needs start, deviation and {' or '.join(ANSWERS)}; give what "
                         "fit_heights or fit_sediment_map makes")
    answer, start, deviation = (fit[one].values for one in (name, "start", "deviation"))
    if truth is not None and np.shape(truth) != answer.shape:
        raise ValueError(f"the truth has the shape {np.shape(truth)}, and the answer {answer.shape}")
    unit = fit[name].attrs["units"]
    shown = [("start", start), ("answer", answer)] if truth is None else [
        ("truth", truth), ("start", start), ("answer", answer)]
    low, high = np.percentile(np.concatenate([values.ravel() for _, values in shown]), (0.5, 99.5))
    off = answer - (start if truth is None else truth)
    most = max(float(np.percentile(np.abs(off), SHARE)), 1e-12)
    figure = sheet(360 * (len(shown) + 2), 330)
    axes = figure.subplots(1, len(shown) + 2, gridspec_kw={"wspace": 0.6})
    across = "x" in fit[name].dims
    extent = (float(fit.x[0]), float(fit.x[-1]), float(fit.y[0]), float(fit.y[-1])) if across else None
    for axis, (title, values, scale, colours) in zip(axes, [
            *((title, values, (low, high), "viridis") for title, values in shown),
            ("change" if truth is None else "error", off, (-most, most), "RdBu_r"),
            ("deviation", deviation, (0, float(deviation.max())), "magma")]):
        image = axis.imshow(values.T if across else values, origin="lower" if across else "upper", extent=extent,
                            vmin=scale[0], vmax=scale[1], cmap=colours)
        axis.set_title(f"{title} [{unit}]")
        axis.set_xlabel("x [m]" if across else "column")
        figure.colorbar(image, ax=axis, fraction=0.046)
    axes[0].set_ylabel("y [m]" if across else "row")
    return figure
