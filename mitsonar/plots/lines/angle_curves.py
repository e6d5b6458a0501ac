"""Curves over the angle from the vertical: means and spread in bins of equal width."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mitsonar.hydrography.reduction.ray_paths import head_of, refraction_error, used_profile, water_profile
from mitsonar.hydrography.survey_orders import vertical_orders
from mitsonar.hydrography.vertical_angles import vertical_angle
from mitsonar.units import db_from_power, power_from_db

from .line_sheet import CAUSES, METHODS, curve_axes, key_above, sounded

WIDTHS = (0.5, 1.0, 2.0, 5.0, 10.0)            # of bins [deg]
MOST, FULL = 90, 0.8               # most bins, and most bins per beam, so that few bins are empty
LEAST_SHARE = 1e-3                 # of the largest error: smaller errors are not drawn
ORDER_GAP = 0.07                   # share of the axes' height between the names of orders
ANGLE = "port   ←   angle from the vertical [deg]   →   starboard"


@dataclass(frozen=True, kw_only=True)
class Bins:
    """Soundings in bins of angle."""

    angle: np.ndarray  # (B,) [deg]: mean angle of the soundings in each bin, increasing
    width: float  # [deg]
    of: np.ndarray  # (N,): bin of every sounding used
    where: np.ndarray  # (ping, beam) bool: soundings used

    def values(self, array: np.ndarray) -> np.ndarray:
        """Return the values (N,) of the soundings used, from an array (ping, beam)."""
        return np.asarray(array, float)[self.where]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the means of finite values (N,) in bins (B,)."""
        known = np.isfinite(values)
        count = np.bincount(self.of[known], minlength=self.angle.size)
        with np.errstate(invalid="ignore"):
            return np.bincount(self.of[known], values[known], self.angle.size) / count

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return the standard deviations of values (N,) in bins (B,)."""
        return np.sqrt(self.mean((values - self.mean(values)[self.of])**2))

    def percentile(self, values: np.ndarray, share: float) -> np.ndarray:
        """Return a percentile of values (N,) in bins (B,)."""
        order = np.argsort(self.of, kind="stable")
        parts = np.split(values[order], np.cumsum(np.bincount(self.of, minlength=self.angle.size))[:-1])
        return np.array([np.percentile(part[np.isfinite(part)], share) if np.isfinite(part).any() else np.nan
                         for part in parts])


def angle_bins(line: xr.Dataset, where: np.ndarray | None = None) -> Bins:
    """Return soundings sorted into bins of angle; by default all soundings with a place."""
    angle = np.rad2deg(vertical_angle(line))
    where = (sounded(line) if where is None else where) & np.isfinite(angle)
    angle = angle[where]
    if not angle.size:
        raise ValueError("no sounding has an angle, so there is no curve over it.")
    most = min(MOST, FULL * line.sizes["beam"])
    width = next((width for width in WIDTHS if np.ptp(angle) < most * width), WIDTHS[-1])
    number = np.floor(angle / width).astype(int)
    of = np.unique(number, return_inverse=True)[1]
    return Bins(angle=np.bincount(of, angle) / np.bincount(of), width=width, of=of, where=where)


def _known(line: xr.Dataset, *names: str) -> list[str]:
    """Return the variables with a finite value at any sounding; raise `ValueError` without any."""
    there = sounded(line)
    known = [name for name in names if name in line and np.isfinite(line[name].values[there]).any()]
    if not known:
        raise ValueError(f"no valid sounding has a finite {names[0]}, so there is no curve of it to draw.")
    return known


def draw_smile(axes: Axes, line: xr.Dataset, theory: tuple[np.ndarray, np.ndarray] | None = None) -> None:
    """Draw the mean error of soundings by its causes, with its standard deviation, over the angle."""
    bins = angle_bins(line)
    for name in _known(line, *CAUSES):
        words, colour, style = CAUSES[name]
        values = bins.values(line[name].values)
        mean, spread = bins.mean(values), bins.spread(values)
        axes.fill_between(bins.angle, mean - spread, mean + spread, color=colour, alpha=0.13, linewidth=0)
        axes.plot(bins.angle, mean, color=colour, linestyle=style, linewidth=1.6, label=words,
                  marker="o" if bins.angle.size == 1 else None)
    theory = _ray_theory(line, bins) if theory is None else theory
    if theory is not None:
        axes.plot(np.rad2deg(theory[0]), theory[1], color="#cc79a7", linewidth=3.5, alpha=0.55, zorder=1,
                  label="ray theory, level bed")
    axes.axhline(0, color="#777777", linewidth=0.8)
    curve_axes(axes, ANGLE, "depth - true depth [m]\nmean ± standard deviation")
    key_above(axes)


def _ray_theory(line: xr.Dataset, bins: Bins) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the errors by the water's own profile, about the line's middle ping."""
    water = water_profile(line)
    if water is None:
        return None
    depth = bins.values(line["true_depth"].values if "true_depth" in line else line["depth"].values)
    head = head_of(line, line.sizes["ping"] // 2)
    bed = float(np.nanmedian(depth))
    if not bed > head.depth:
        return None
    angle = np.deg2rad(np.linspace(bins.angle[0], bins.angle[-1], 181))
    return angle, refraction_error(used_profile(line, head), water, head, bed, angle)


def draw_exceeded(axes: Axes, line: xr.Dataset) -> None:
    """Draw the 95 % limits of errors by cause against the angle, beside the limits of the orders of S-44."""
    bins = angle_bins(line)
    for name in _known(line, *CAUSES):
        within = bins.percentile(np.abs(bins.values(line[name].values)), 95)
        axes.plot(bins.angle, np.where(within > 0, within, np.nan), color=CAUSES[name][1], linestyle=CAUSES[name][2],
                  linewidth=1.6, marker="o" if bins.angle.size == 1 else None)
    depth = bins.mean(bins.values(line["depth"].values))
    orders, ends = vertical_orders(), []
    for order in orders.values():
        allowed = order.vertical(depth)
        axes.plot(bins.angle, allowed, color="#777777", linewidth=1, linestyle=(0, (6, 3)),
                  marker="_" if bins.angle.size == 1 else None)
        ends.append(allowed[-1])
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    low = max(low, LEAST_SHARE * high)
    axes.set_ylim(low, high)
    for order, up in zip(orders, _apart(np.log(np.array(ends) / low) / np.log(high / low), ORDER_GAP), strict=True):
        axes.text(1.01, up, f"S-44 {order}", transform=axes.transAxes, fontsize=9, va="center", color="#555555")
    curve_axes(axes, ANGLE, "|error| [m]\n95 % of soundings")


def _apart(places: np.ndarray, gap: float) -> np.ndarray:
    """Return rising places moved apart to a least gap, with the same mean."""
    moved = np.maximum.accumulate(places - gap * np.arange(places.size)) + gap * np.arange(places.size)
    return moved - (moved - places).mean()


def draw_response(axes: Axes, line: xr.Dataset) -> None:
    """Draw the mean backscattering strength against the angle, and that of the seabed's law if it is known."""
    bins = angle_bins(line)
    known = _known(line, "backscatter_db", "true_backscatter_db")
    measured = bins.values(line["backscatter_db"].values)
    axes.fill_between(bins.angle, bins.percentile(measured, 10), bins.percentile(measured, 90), color="#0072b2",
                      alpha=0.15, linewidth=0, label="10 to 90 % of soundings")
    marker = "o" if bins.angle.size == 1 else None
    axes.plot(bins.angle, db_from_power(bins.mean(power_from_db(measured))), color="#0072b2", linewidth=1.6,
              marker=marker, label="mean intensity of soundings")
    if "true_backscatter_db" in known:
        law = db_from_power(bins.mean(power_from_db(bins.values(line["true_backscatter_db"].values))))
        axes.plot(bins.angle, law, color="#d55e00", linestyle="--", linewidth=1.6, marker=marker, label="seabed's law")
    curve_axes(axes, ANGLE, "backscattering strength [dB]")
    key_above(axes)


def draw_uncertainty(axes: Axes, line: xr.Dataset) -> None:
    """Draw the stated uncertainty of the soundings against the angle, beside the actual spread of their errors."""
    bins = angle_bins(line)
    marker = "o" if bins.angle.size == 1 else None
    known = _known(line, "uncertainty", "horizontal_uncertainty")
    for name, words, colour, style in (("uncertainty", "stated: of depth", "#0072b2", "-"),
                                       ("horizontal_uncertainty", "stated: of place", "#009e73", ":")):
        if name in known:
            values = np.sqrt(bins.mean(bins.values(line[name].values)**2))
            axes.plot(bins.angle, values, color=colour, linestyle=style, linewidth=1.6, label=words, marker=marker)
    if "error" in line:
        values = np.sqrt(bins.mean(bins.values(line["error"].values)**2))
        axes.plot(bins.angle, values, color="#000000", linestyle="--", linewidth=1.4, marker=marker,
                  label="error of depth, rms")
    curve_axes(axes, ANGLE, "uncertainty, one\nstandard deviation [m]")
    axes.set_ylim(bottom=0)
    key_above(axes)


def draw_quality(axes: Axes, line: xr.Dataset) -> None:
    """Draw the quality of soundings over the angle, by method of detection."""
    there = sounded(line)
    _known(line, "quality")
    method = line["detection"].values if "detection" in line else None
    groups = {"all soundings": ("#000000", "o", there)} if method is None else {
        words: (colour, marker, there & (method == number))
        for number, (words, colour, marker) in METHODS.items() if (there & (method == number)).any()}
    bins = angle_bins(line, there)
    for words, (colour, marker, where) in groups.items():
        values = bins.values(np.where(where, line["quality"].values, np.nan))
        axes.plot(bins.angle, bins.mean(values), color=colour, marker=marker, markersize=4, linewidth=1.2, label=words)
        axes.fill_between(bins.angle, bins.percentile(values, 10), bins.percentile(values, 90), color=colour,
                          alpha=0.13, linewidth=0)
    curve_axes(axes, ANGLE, "quality, log10(depth / spread)\nmean, 10 to 90 %")
    key_above(axes)


def draw_methods(axes: Axes, line: xr.Dataset) -> None:
    """Draw the shares of the methods of detection over the angle."""
    sounded(line)
    bins = angle_bins(line, np.isfinite(vertical_angle(line)))
    method = np.where(line["valid"].values.astype(bool), line["detection"].values, 0)[bins.where]
    middle, below = (np.floor(bins.angle / bins.width) + 0.5) * bins.width, np.zeros(bins.angle.size)
    for number, (words, colour, _) in METHODS.items():
        share = 100 * bins.mean((method == number).astype(float))
        axes.bar(middle, share, bins.width, below, color=colour, alpha=0.75, label=words)
        below += share
    curve_axes(axes, ANGLE, "share of beams [%]")
    axes.set_ylim(0, 100)
    key_above(axes)
