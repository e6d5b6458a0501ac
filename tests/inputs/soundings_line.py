"""A small line of soundings that holds together: a plane bed seen by two arrays of a ship that rolls and heaves.

In water of one speed everything is exact: times, angles and places of a sounding belong to one point, at the arrays'
own places when its sector sends and when the echo returns. The point lies ``error_detection`` below the bed.
"""
from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED, variable

SPEED = 1500.0                                         # m/s
ORIGIN = (448_000.0, 5_955_000.0)                      # of UTM 32 N: in the North Sea
TILTS = np.radians([-2.0, 1.0, 3.0])                   # of the sectors, port to starboard
FREQUENCIES = (300e3, 320e3, 290e3)
TRANSMIT, RECEIVE = np.array([1.2, 0.3, 0.9]), np.array([1.0, 0.1, 0.95])
SPREAD = np.radians(60)


def soundings_line(pings: int = 4, beams: int = 24, *, sectors: int = 3, depth: float = 50.0, slope: float = 0.02,
                   column: bool = True, snippets: bool = True, crs: str | None = "EPSG:32632",
                   speeds: tuple[float, float, float] = (SPEED, SPEED, SPEED), seed: int = 1) -> xr.Dataset:
    """Make the line.

    Parameters
    ----------
    depth : float [m]
        Of the bed under x = 0.
    slope : float [-]
        Of the bed, down towards the east.
    speeds : three floats [m/s]
        Of the cast, at 0, 20 and 200 m. Rays stay straight and as fast as `SPEED`: others are only of use to files.

    Notes
    -----
    Beam 3 of every ping and the last of ping 0 have no sounding; the last of ping 1 is padding: it has no angle either.
    """
    chance = np.random.default_rng(seed)
    time = 1.0 + 0.4 * np.arange(pings)
    motion = np.arange(0.0, time[-1] + 1.0, 0.02)
    delay = np.broadcast_to(0.0004 * np.arange(sectors), (pings, sectors))
    number = np.broadcast_to(np.arange(beams) * sectors // beams, (pings, beams))
    noise = 0.01 * chance.standard_normal((pings, beams))
    sent = time[:, None] + np.take_along_axis(delay, number, axis=1)
    tilt = np.broadcast_to(TILTS[:sectors], (pings, sectors))
    points = _points(sent, np.linspace(-SPREAD, SPREAD, beams), np.take_along_axis(tilt, number, axis=1), depth, slope,
                     noise)
    travel, transmit_angle, angle = _echoes(points, sent)
    valid = np.ones((pings, beams), bool)
    valid[:, 3] = valid[0, -1] = valid[min(1, pings - 1), -1] = False
    padded = np.zeros_like(valid)
    padded[min(1, pings - 1), -1] = True
    place, heading = _place(time), _attitude(time)[2]
    forward = np.stack([np.sin(heading), np.cos(heading)])[:, :, None]
    level = points[..., :2] - place[:, None, :2]
    kept = {"travel_time": travel, "depth": points[..., 2], "x": points[..., 0], "y": points[..., 1],
            "along_track": level[..., 0] * forward[0] + level[..., 1] * forward[1],
            "across_track": level[..., 0] * forward[1] - level[..., 1] * forward[0],
            "true_depth": points[..., 2] - noise, "error": noise, "error_detection": noise,
            "error_refraction": 0 * noise, "error_motion": 0 * noise}
    grazing = np.broadcast_to(np.pi / 2 - np.abs(np.linspace(-SPREAD, SPREAD, beams)), (pings, beams))
    strength = -14 + 10 * np.log10(np.sin(grazing) ** 2) + chance.standard_normal((pings, beams))
    kept |= {"backscatter_db": strength, "grazing": grazing, "true_backscatter_db": strength.round(),
             "quality": 2.5 + 0 * noise, "uncertainty": 0.02 + 0 * noise, "horizontal_uncertainty": 0.05 + 0 * noise,
             "footprint_across": 0.02 * points[..., 2], "footprint_along": 0.01 * points[..., 2]}
    values = {name: np.where(valid, value, np.nan) for name, value in kept.items()}
    values |= {"angle": np.where(padded, np.nan, angle), "transmit_angle": np.where(padded, np.nan, transmit_angle),
               "valid": valid, "sector": np.where(padded, 0, number), "label": np.where(valid, 1 + number % 2, 0)}
    values["detection"] = np.where(valid, np.where(np.abs(angle) < 0.3, BY_AMPLITUDE, BY_PHASE), NOT_DETECTED)
    values |= {"sector_delay": delay, "sector_angle": tilt}
    values |= {name: np.broadcast_to(np.asarray(one[:sectors], float), (pings, sectors)) for name, one in {
        "sector_frequency": FREQUENCIES, "sector_pulse_length": (1e-4, 1.2e-4, 1.5e-4),
        "sector_bandwidth": (1.5e4, 1.6e4, 1.2e4), "sector_source_level_db": (208.0, 210.0, 209.0),
        "sector_absorption_db": (0.07, 0.075, 0.068)}.items()}
    values |= _line(time, motion, speeds)
    if snippets:
        values |= _snippets(strength, travel, valid, chance)
    if column:
        values |= _column(pings, depth, sectors, chance)
    attrs = {"sonar": "multibeam", "title": "a plane bed", "start": "2026-05-01T10:00:00Z", "crs": crs,
             "preset": "none", "profile": "the true one", "backscatter": "spreading, absorption and beams; area"}
    if crs is not None:
        attrs["origin"] = list(ORIGIN)
    return xr.Dataset({name: variable(name, value) for name, value in values.items()}, attrs=attrs)


def blocks_of(line: xr.Dataset, most: int = 2) -> Iterator[xr.Dataset]:
    """Return the line's pings block by block, as a survey makes them."""
    for start in range(0, line.sizes["ping"], most):
        yield line.isel(ping=slice(start, start + most))


def _place(time):
    """Easting, northing and depth of the reference point at a time."""
    return np.stack([2.0 * time, 3.0 * time, 1.5 + 0.2 * np.sin(2 * np.pi * time / 6)], -1)


def _attitude(time):
    return (np.radians(4) * np.sin(2 * np.pi * time / 5), np.radians(2) * np.sin(2 * np.pi * time / 7 + 1),
            np.arctan2(2.0, 3.0) + np.radians(1) * np.sin(2 * np.pi * time / 9))


def _axes(time):
    """Forward, starboard and down of the body as east, north, down."""
    roll, pitch, heading = _attitude(time)
    sr, cr, sp, cp, sh, ch = (turn(one) for one in (roll, pitch, heading) for turn in (np.sin, np.cos))
    forward = np.stack([sh * cp, ch * cp, -sp], -1)
    starboard = np.stack([sh * sp * sr + ch * cr, ch * sp * sr - sh * cr, cp * sr], -1)
    down = np.stack([sh * sp * cr - ch * sr, ch * sp * cr + sh * sr, cp * cr], -1)
    return np.stack([forward, starboard, down], -2)


def _points(sent, steering, tilt, depth, slope, noise):
    """Meeting points of the beams with the bed, in the ping's level frame."""
    place, (_, _, heading) = _place(sent), _attitude(sent)
    below = depth - place[..., 2]
    across, along = below * np.tan(steering), below / np.cos(steering) * np.tan(tilt)
    x = place[..., 0] + along * np.sin(heading) + across * np.cos(heading)
    y = place[..., 1] + along * np.cos(heading) - across * np.sin(heading)
    return np.stack([x, y, depth + slope * x + noise], -1)


def _echoes(points, sent):
    """Two-way times and both angles, the ship moving on while the echo is under way."""
    axes = _axes(sent)
    away = points - (_place(sent) + np.einsum("a,...ab->...b", TRANSMIT, axes))
    out = np.linalg.norm(away, axis=-1)
    transmit_angle = np.arcsin(np.einsum("...b,...b->...", axes[..., 0, :], away) / out)
    travel = 2 * out / SPEED
    for _ in range(8):                                 # its error shrinks a thousandfold each time
        axes = _axes(sent + travel)
        away = points - (_place(sent + travel) + np.einsum("a,...ab->...b", RECEIVE, axes))
        back = np.linalg.norm(away, axis=-1)
        travel = (out + back) / SPEED
    return travel, transmit_angle, np.arcsin(np.einsum("...b,...b->...", axes[..., 1, :], away) / back)


def _line(time, motion, speeds):
    values: dict[str, np.ndarray] = {}
    for prefix, when in (("ping", time), ("motion", motion)):
        names = ("x", "y", "depth", "roll", "pitch", "heading")
        values |= {f"{prefix}_{name}": one for name, one in zip(names, [*_place(when).T, *_attitude(when)])}
        values[f"{prefix}_time"] = when
    flat = np.zeros(3)
    return values | {"cast_depth": np.array([0.0, 20.0, 200.0]), "cast_sound_speed": np.array(speeds),
                     "transmit_offset": TRANSMIT, "receive_offset": RECEIVE, "transmit_mounting": flat,
                     "receive_mounting": flat, "head_sound_speed": np.full(time.size, SPEED)}


def _snippets(strength, travel, valid, chance):
    samples = 9
    count = np.where(valid, 3 + np.arange(valid.shape[1]) % (samples - 2), 0)[..., None]
    speckle = strength[..., None] + 5 * chance.standard_normal((*strength.shape, samples))
    return {"snippet_rate": np.full(len(strength), 20e3), "snippet_start": np.where(valid, travel - 2e-4, np.nan),
            "snippet_db": np.where(np.arange(samples) < count, speckle, np.nan)}


def _column(pings, depth, sectors, chance):
    beams, samples, rate = 16, 240, 1500.0
    angle = np.linspace(-SPREAD, SPREAD, beams)
    bed = 2 * (depth - 2.5) / np.cos(angle) / SPEED * rate             # the arrays lie some 2.5 m deep
    level = 70 + 3 * chance.standard_normal((pings, beams, samples))
    sample = np.arange(samples)
    level += 60 * np.exp(-((sample - bed[:, None]) / 2.0) ** 2)
    level[..., sample > bed[:, None] + 12] = np.nan
    number = np.arange(beams) * sectors // beams
    return {"column_angle": np.broadcast_to(angle, (pings, beams)), "column_level_db": level,
            "column_sector": np.broadcast_to(number, (pings, beams)),
            "column_start": np.full((pings, beams), 2e-4), "column_rate": np.full((pings, beams), rate)}
