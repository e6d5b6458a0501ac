"""Lines of soundings as points in space, by depth, error and backscatter, and their water column ping by ping."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib import colormaps

from mitsonar.imaging.gain import Tvg
from mitsonar.plots.lines.column_plot import soundings_of
from mitsonar.plots.lines.line_sheet import CAUSES, sounded
from mitsonar.plots.lines.water_column import ColumnFan, column_window, fan_of_ping, has_column

from .view_log import ViewLog

MOST_POINTS = 1_000_000            # of a line; of more, some are left out evenly
MOST_PINGS = 200                   # whose water column is shown
SHARE = 2                          # pixels of the plot's fan to one of the page's, each way
OUTER = 98.0                       # percentile of the errors, or of both ends, at the ends of the colours
PING, SOUNDING = (255, 255, 255), (90, 220, 255)
RADIUS = 2.0                       # [pixels] of a point
# variable -> entity, colours, whether these lie around 0; the first that the line has is shown
COLOURED = {"error": ("by_error", "coolwarm", True), "depth": ("by_depth", "viridis_r", False),
            **{name: (name.replace("error_", "by_error_of_"), "coolwarm", True) for name in CAUSES if name != "error"},
            "backscatter_db": ("by_backscatter", "gray", False), "uncertainty": ("by_uncertainty", "viridis", False)}


def log_line(log: ViewLog, name: str, line: xr.Dataset, tvg: Tvg) -> None:
    """Log a line of soundings."""
    there = sounded(line)
    _log_points(log, name, line, there)
    time = line["ping_time"].values
    for ping in range(line.sizes["ping"]):
        log.at(ping, float(time[ping]))
        log.place(f"{name}/ping", log.rr.Points3D(_places(line.isel(ping=ping), there[ping]), colors=[PING],
                                                  radii=log.rr.Radius.ui_points(1.5 * RADIUS)))
    if has_column(line):
        _log_column(log, name, line, tvg)


def _places(line: xr.Dataset, there: np.ndarray, depth: str = "depth") -> np.ndarray:
    """Return the places (N, 3) [m] of soundings."""
    return np.column_stack([line["x"].values[there], line["y"].values[there], -line[depth].values[there]])


def _log_points(log: ViewLog, name: str, line: xr.Dataset, there: np.ndarray) -> None:
    """Log all soundings in the colours of their variables, and the bed below them."""
    rr = log.rr
    kept = np.zeros(there.size, bool)
    kept[np.flatnonzero(there)[::there.sum() // MOST_POINTS + 1]] = True
    kept = kept.reshape(there.shape)
    variables = {variable: line[variable].values[kept] for variable in COLOURED if variable in line}
    values = {variable: rr.AnyValues(**{variable: column.astype(np.float32)}) for variable, column in variables.items()}
    shown = next(variable for variable in COLOURED if variable in line)
    for variable, column in variables.items():
        entity, colours, around_zero = COLOURED[variable]
        log.place(f"{name}/soundings/{entity}",
                  rr.Points3D(_places(line, kept), colors=_colours(column, colours, around_zero),
                              radii=rr.Radius.ui_points(RADIUS)), *values.values(), still=True,
                  shown=variable == shown)
    if "true_depth" in line:
        log.place(f"{name}/soundings/true", rr.Points3D(_places(line, kept, "true_depth"), colors=[(160, 160, 160)],
                                                        radii=rr.Radius.ui_points(RADIUS)), still=True, shown=False)


def _colours(values: np.ndarray, name: str, around_zero: bool) -> np.ndarray:
    """Return colours (N, 3) of values, of which some may be missing."""
    known = values[np.isfinite(values)]
    if not known.size:
        return np.full((values.size, 3), 128, np.uint8)
    most = max(float(np.percentile(np.abs(known), OUTER)), 1e-6)
    low, high = (-most, most) if around_zero else np.percentile(known, [100 - OUTER, OUTER])
    share = (np.nan_to_num(values, nan=float(low)) - low) / max(float(high - low), 1e-6)
    return (255 * colormaps[name](np.clip(share, 0, 1))[:, :3]).astype(np.uint8)


def _log_column(log: ViewLog, name: str, line: xr.Dataset, tvg: Tvg) -> None:
    """Log the water column of pings as pictures across the track, with their soundings."""
    pings = np.unique(np.linspace(0, line.sizes["ping"] - 1, MOST_PINGS).round().astype(int))
    sample = [fan for ping in (pings[0], pings[len(pings) // 2], pings[-1])
              if (fan := _column(line, int(ping), tvg)) is not None]
    if not sample:
        return
    # the largest box, and its colours, hold for all
    box = (min(fan.box[0] for fan in sample), max(fan.box[1] for fan in sample), max(fan.box[2] for fan in sample))
    limits, origin = column_window(*(fan.image for fan in sample)), f"{name}/column"
    for ping in pings:
        fan = _column(line, int(ping), tvg, box)
        if fan is None:
            continue
        log.at(int(ping), float(line["ping_time"].values[ping]))
        log.shade(f"{origin}/level", fan.image[::SHARE, ::SHARE], limits, "inferno")
        across, depth, valid, _ = soundings_of(line, int(ping))
        left, right, bottom, top = fan.extent
        rows, columns = fan.image[::SHARE, ::SHARE].shape
        places = np.column_stack([(across - left) / (right - left) * columns, (depth - top) / (bottom - top) * rows])
        log.log(f"{origin}/soundings", log.rr.Points2D(places[valid], colors=[SOUNDING],
                                                       radii=log.rr.Radius.ui_points(1.0)))
    log.view(origin, f"{name}: water column, level{sample[0].gain} [dB]")


def _column(line: xr.Dataset, ping: int, tvg: Tvg, box: tuple[float, float, float] | None = None) -> ColumnFan | None:
    """Return the fan of a ping; None if it has too few beams."""
    try:
        return fan_of_ping(line, ping, tvg=tvg, box=box)
    except ValueError:
        return None
