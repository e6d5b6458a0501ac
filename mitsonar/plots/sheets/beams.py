"""Plots of beam patterns: levels of all beams for a point target, beside the closed form of the array."""
from __future__ import annotations

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.axes import Axes

from mitsonar.device.files import FilePath
from mitsonar.units import db_from_power

from .. import canvas
from ..onto import moved, sheets_for

FLOOR_DB = -60.0                   # lowest level drawn
COMPARED_DB = -40.0                # lowest level of the closed form at which the difference is drawn


def beam_pattern(beams: xr.DataArray, path: FilePath | None = None, *, expected: npt.ArrayLike | None = None,
                 along: str = "azimuth", ping: int = 0, time: float | None = None, title: str = "",
                 axes: Axes | None = None) -> Axes:
    """Draw the levels of all beams at one time, relative to the highest.

    Parameters
    ----------
    beams : xarray.DataArray (ping, beam, sample)
        Output of a beamformer for a point target.
    path : str or path, optional
        File to write, ending in .png, .pdf or .svg.
    expected : array_like (beam,), optional
        Closed form: pressure in each beam, of any scale, such as from `mitsonar.sonar.beam_pattern`. Its difference
        from the beams is then drawn below, where the closed form is above -40 dB.
    along : str
        Coordinate of the beams [rad] along the horizontal axis: ``azimuth``, ``elevation`` or a fan's ``angle``.
    ping : int
        Index of the ping.
    time : float [s], optional
        Time whose nearest sample is drawn; by default that of the strongest echo.
    title : str
    axes : matplotlib.axes.Axes, optional
        As for `mitsonar.plots.plot`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the beams have other dimensions, lack the coordinate or are silent, ``expected`` does not fit them, or an
        argument is not as above.
    OSError
        If the file cannot be written.
    """
    canvas.check_path(path)
    angle, level, wanted = _levels(beams, expected, along, ping, time)
    words = title or f"beam pattern, {beams.attrs.get('beamformer', 'beams')}"
    with sheets_for(path, axes):
        return moved(canvas.saved(_figure(angle, level, wanted, along, words), path), axes)


def _figure(angle, level, wanted, along, title):
    """Draw levels over angles [deg], beside the expected levels, and return the sheet."""
    figure = canvas.sheet(1200, 720)
    rows = 1 if wanted is None else 2
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=(3, 1)[:rows])[:, 0]
    panels[0].plot(angle, level, color="#1f4e79", linewidth=1.2, label="beams")
    if wanted is not None:
        panels[0].plot(angle, wanted, color="#b86f22", linewidth=1.2, linestyle="--", label="closed form")
        panels[0].legend(loc="upper right", fontsize=10)
        difference = np.where(wanted > COMPARED_DB, level - wanted, np.nan)
        panels[1].plot(angle, difference, color="#1f4e79", linewidth=1.2)
        panels[1].set_ylabel("difference [dB]", fontsize=11)
    panels[0].set_ylim(FLOOR_DB, 3)
    panels[0].set_ylabel("level re highest beam [dB]", fontsize=11)
    panels[-1].set_xlabel(f"{along} [deg]", fontsize=11)
    for axes in panels:
        axes.set_xlim(angle[0], max(angle[-1], angle[0] + 1e-6))
        axes.tick_params(labelsize=10)
        axes.grid(alpha=0.25)
    figure.suptitle(title, fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure


def _levels(beams, expected, along, ping, time):
    """Return angles [deg] in rising order, the levels of the beams and the expected levels [dB]."""
    if set(beams.dims) != {"ping", "beam", "sample"} or not beams.size:
        raise ValueError(f"a beam pattern is drawn of beams (ping, beam, sample); these are {dict(beams.sizes)}.")
    if along not in beams.coords or beams[along].dims != ("beam",):
        raise ValueError(f"the beams have no coordinate {along!r}; choose one of "
                         f"{', '.join(str(name) for name, value in beams.coords.items() if value.dims == ('beam',))}.")
    canvas.check_ping(ping, beams.sizes["ping"])
    power = np.abs(beams.isel(ping=ping).transpose("beam", "sample").values.astype(complex)) ** 2
    sample = power.max(axis=0).argmax() if time is None else np.abs(beams["time"].values - time).argmin()
    power = power[:, sample]
    highest = power.argmax()
    if not power[highest] > 0:
        raise ValueError(f"all beams of ping {ping} are silent, so there is no pattern; check the signals.")
    order = np.argsort(beams[along].values, kind="stable")
    level = _db(power / power[highest])
    if expected is not None:
        expected = np.abs(np.asarray(expected)) ** 2
        if expected.shape != level.shape or not (np.isfinite(expected).all() and expected[highest] > 0):
            raise ValueError(f"the closed form has shape {expected.shape}; give {level.size} finite pressures, one per "
                             "beam, and not 0 in the highest beam.")
        expected = _db(expected / expected[highest])[order]
    return np.degrees(beams[along].values[order]), level[order], expected


def _db(power):
    return db_from_power(np.maximum(power, 1e-20))
