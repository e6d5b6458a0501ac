"""Table 1 of the published method: effective speed and return time of one ray, traced and by equation 2.

    ev_r = ev_i + 0.503 g (h_r - h_i),    t_r = |F - I| / ev_r

Published are the heights of transmission 9.5 m and reception 9.382419 m over the bed, the horizontal range 11.494591 m
of the reception, a gradient of -5 1/s, two effective speeds and two times. The profile is not. Water of one gradient
dc/dh = -5 1/s all the way down reproduces both columns if its speed at the bed is 1499.346571 m/s, by

    cosh(g t) = 1 + g² D² / (2 c_I c_F)

and the hit then lies 11.369819 m from the transmission: the receiver is 0.125 m behind and 0.118 m below it, on a face
tilted by 47 degrees, which is "around 40" depressed. The second time is printed ...573 in the copy at hand; its speed
and the published difference of 23 ns, 1/87 of a period at 500 kHz, make it ...578.
"""
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from mitsonar.propagation.numpy_rays.return_times import return_time
from mitsonar.water.profile import SoundSpeedProfile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHTS = 9.5, 9.382419            # [m] of transmission and reception
RANGE = 11.494591                  # [m] of the reception
GRADIENT = -5.0                    # [1/s] dc/dh
BED_SPEED = 1499.346570536         # [m/s]
INCIDENT_RANGE = 11.36981948       # [m] of the transmission
FREQUENCY = 500e3                  # [Hz]
WATER_DEPTH = 10.0                 # [m]; the water above the sonar takes no part
METHODS: dict[str, Literal["eigenray", "paper", "vector"]] = {
    "traced": "eigenray", "equation 2": "paper", "vector approximation": "vector"}
PRINTED_SPEED = 1475.859495, 1475.856104, np.nan
PRINTED_TIME = 0.010053555, 0.010053578, np.nan


def compute() -> xr.Dataset:
    """Compute the table."""
    water = SoundSpeedProfile([0, WATER_DEPTH], [BED_SPEED + GRADIENT * WATER_DEPTH, BED_SPEED])
    origin = np.array([0, 0, HEIGHTS[0] - WATER_DEPTH])
    hit, element = [INCIDENT_RANGE, 0, -WATER_DEPTH], [INCIDENT_RANGE - RANGE, 0, HEIGHTS[1] - HEIGHTS[0]]
    times = np.array([return_time(water, origin, [hit], [element], method=method)[0, 0]
                      for method in METHODS.values()])
    incident = return_time(water, origin, [hit], [[0, 0, 0]], method="eigenray")[0, 0]
    height = np.linspace(0, WATER_DEPTH, 11)
    speed = {"units": "m/s"}
    return xr.Dataset(
        {"effective_speed": ("found_by", np.hypot(RANGE, HEIGHTS[1]) / times, speed),
         "return_time": ("found_by", times, {"units": "s"}),
         "printed_speed": ("found_by", np.array(PRINTED_SPEED), speed),
         "printed_time": ("found_by", np.array(PRINTED_TIME), {"units": "s"}),
         "sound_speed": ("height", water.at(WATER_DEPTH - height), speed)},
        coords={"found_by": list(METHODS), "height": ("height", height, {"units": "m"})},
        attrs={"incident_speed": float(np.hypot(INCIDENT_RANGE, HEIGHTS[0]) / incident), "frequency": FREQUENCY,
               "displacement": float(np.hypot(RANGE, HEIGHTS[1]))})


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
