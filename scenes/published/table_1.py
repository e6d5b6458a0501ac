"""Table 1 of the published method, said in text, as numbers and as a figure; `mitsonar.validation.published` has it."""
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsonar.validation.published import BED_SPEED, GRADIENT, HEIGHTS, RANGE, table_1 as compute

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["compute", "plot", "rows", "table"]


def table(dataset: xr.Dataset) -> str:
    """Say the table in text."""
    lines = [f"transmission at {HEIGHTS[0]} m, reception at {HEIGHTS[1]} m, {RANGE} m away: displacement "
             f"{dataset.displacement:.10f} m",
             f"water of {GRADIENT:g} 1/s from {BED_SPEED:.6f} m/s at the bed; incident effective speed "
             f"{dataset.incident_speed:.6f} m/s",
             f"{'':22}effective speed [m/s]        return time [s]                   error",
             f"{'':22}{'here':>12}{'printed':>13}    {'here':>14}{'printed':>13}{'[ns]':>10}  [periods]"]
    exact = float(dataset.return_time.sel(found_by="traced"))
    for method in dataset.found_by.values:
        one = dataset.sel(found_by=method)
        printed = [f"{float(one.printed_speed):13.6f}", f"{float(one.printed_time):13.9f}"] if np.isfinite(
            one.printed_time) else [" " * 13] * 2
        error = float(one.return_time) - exact
        share = f"1/{1 / abs(error * dataset.frequency):.0f}" if abs(error) > 1e-12 else "0"
        lines.append(f"{method:22}{float(one.effective_speed):12.6f}{printed[0]}    {float(one.return_time):14.12f}"
                     f"{printed[1]}{1e9 * error:10.4f}  {share:>9}")
    return "\n".join([*lines, f"published: 23 ns, 1/87 of a period at {dataset.frequency / 1e3:g} kHz"])


def rows(dataset: xr.Dataset) -> tuple[list[str], list[tuple]]:
    """Header and records of the table."""
    columns = "effective_speed", "printed_speed", "return_time", "printed_time"
    return (["method", "effective_speed_m_s", "printed_speed_m_s", "return_time_s", "printed_time_s"],
            [(str(name), *(f"{value:.12g}" if np.isfinite(value) else "" for value in values)) for name, *values in
             zip(dataset.found_by.values, *(dataset[column].values for column in columns))])


def plot(dataset: xr.Dataset) -> "Figure":
    """Draw the reconstructed water and what each method errs by."""
    from mitsonar.plots import canvas

    figure = canvas.sheet(1150, 520)
    water, errors = figure.subplots(1, 2)
    water.plot(dataset.sound_speed, dataset.height, color="#1f4e79")
    for height, name in zip(HEIGHTS, ("transmission", "reception")):
        water.axhline(height, color="#b86f22", linewidth=0.8, linestyle="-" if name == "transmission" else ":",
                      label=f"{name}, {height} m")
    water.set(xlabel="sound speed [m/s]", ylabel="height above the bed [m]", title="reconstructed water")
    water.legend(fontsize=9)
    error = 1e9 * (dataset.return_time - dataset.return_time.sel(found_by="traced"))
    bars = errors.bar(dataset.found_by.values, error, color="#1f4e79")
    errors.bar_label(bars, [f"{value:.4f}" for value in error.values], padding=3)
    errors.set(ylabel="error of the return time [ns]", title="published: 23 ns", ylim=(0, 1.2 * float(error.max())))
    for axis in (water, errors):
        axis.grid(alpha=0.25)
    figure.suptitle("Table 1: one ray back to a receiver 0.12 m below its transmitter", fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure
