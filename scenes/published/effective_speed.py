"""The law of effective speed, in text, numbers and a figure; `mitsonar.validation.published` has its equations."""
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsonar.propagation.numpy_rays.paper_approximation import COEFFICIENT
from mitsonar.validation.published import KINDS, effective_speed as compute

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["compute", "plot", "rows", "table"]


def table(dataset: xr.Dataset) -> str:
    """Say the coefficients in text."""
    lines = [f"{'':36}gradient  coefficient           off the line   largest error of the time [ns]",
             f"{'water':36}{'[1/s]':>8}{'fitted':>9}{'expected':>10}{'[m/s]':>13}{'law':>14}{'no correction':>17}"]
    for name in dataset.water.values:
        one = {key: float(value) for key, value in dataset.sel(water=name).drop_vars(
            ("effective_speed", "kind", "water", "height_change")).items()}
        lines.append(f"{name:36}{one['gradient']:8.3f}{one['coefficient']:9.4f}{one['expected']:10.4f}"
                     f"{one['curvature']:13.4f}{1e9 * one['law_error']:14.1f}{1e9 * one['no_correction_error']:17.1f}")
    return "\n".join([*lines, f"mean coefficient of the exaggerated waters, faster at the bed: "
                              f"{dataset.mean_coefficient:.4f}; published: {COEFFICIENT}"])


def rows(dataset: xr.Dataset) -> tuple[list[str], list[tuple]]:
    """Header and records of the figure as a table: one height a line."""
    records = [(str(name), f"{change:.3f}", f"{float(speed):.9f}", f"{float(one.coefficient):.6f}")
               for name, one in ((name, dataset.sel(water=name)) for name in dataset.water.values)
               for change, speed in zip(dataset.height_change.values, one.effective_speed.values)]
    return ["water", "height_change_m", "effective_speed_m_s", "coefficient"], records


def plot(dataset: xr.Dataset) -> "Figure":
    """Draw the change of effective speed against the change the gradient makes at the array."""
    from mitsonar.plots import canvas

    figure = canvas.sheet(1300, 560)
    still = int(np.argmin(np.abs(dataset.height_change.values)))
    titles = "one gradient: the law holds", "shaped like casts: it does not"
    for axes, kinds, title in zip(figure.subplots(1, 2), (KINDS[:2], KINDS[2:]), titles):
        for name in dataset.water.values[np.isin(dataset.kind.values, kinds)]:
            one = dataset.sel(water=name)
            axes.plot(float(one.gradient) * one.height_change,
                      one.effective_speed - one.effective_speed[still], linewidth=1.4,
                      label=f"{name}: {float(one.coefficient):.4f}")
        reach = np.array(axes.get_xlim())
        axes.plot(reach, COEFFICIENT * reach, color="black", linestyle=":", label=f"law: {COEFFICIENT}")
        axes.set(xlabel="gradient times change of height [m/s]", ylabel="change of effective speed [m/s]", title=title)
        axes.legend(fontsize=8)
        axes.grid(alpha=0.25)
    figure.suptitle("Effective speed against height: coefficient by regression", fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure
