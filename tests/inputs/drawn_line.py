"""A line of soundings whose every number is known: a plane bed, straight rays, an upright ship, errors by formula."""
import numpy as np
import xarray as xr

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, variable

SPEED = 1500.0
HEAD = 2.0                         # [m] depth of the arrays


def smile(angle):
    """Error by refraction [m] at an angle from the vertical [rad]."""
    return 0.4 * np.tan(angle)**2


def line(pings=12, beams=41, depth=50.0, slope=0.0, *, column=0, truth=True, seed=0):
    """A line northwards at 2 m a ping, of fans over ±60 degrees.

    Parameters
    ----------
    pings, beams : int
    depth, slope : float
        Of the bed: depth + slope x.
    column : int
        Samples of the water column of 129 beams; 0: none.
    truth : bool
        Whether it is simulated.
    seed : int
        Of the noise of detection, 5 cm.
    """
    chance = np.random.default_rng(seed)
    angle = np.deg2rad(np.linspace(-60, 60, beams) if beams > 1 else [0.0])
    below = (depth - HEAD) / (1 - slope * np.tan(angle)) + 0 * chance.random((pings, 1))
    across, y = below * np.tan(angle), 2.0 * np.arange(pings)
    shape = below.shape
    errors = {"error_detection": 0.05 * chance.standard_normal(shape), "error_motion": np.full(shape, 0.01)}
    errors["error_refraction"] = np.broadcast_to(smile(angle), shape)
    error = sum(errors.values())
    time, zero = 0.5 * np.arange(pings), np.zeros(pings)
    motion = np.linspace(0, max(time[-1], 0.1), 20 * pings)
    beam = np.broadcast_to(angle, shape)
    steep = np.abs(beam) < np.deg2rad(25)
    values = {
        "cast_depth": [0.0, 100.0], "cast_sound_speed": [SPEED, SPEED], "transmit_offset": np.zeros(3),
        "receive_offset": np.zeros(3), "transmit_mounting": np.zeros(3), "receive_mounting": np.zeros(3),
        "motion_time": motion, "motion_x": 0 * motion, "motion_y": 4.0 * motion,
        "motion_depth": HEAD + 0.3 * np.sin(motion), "motion_roll": 0 * motion,
        "motion_pitch": 0 * motion, "motion_heading": 0 * motion,
        "ping_time": time, "ping_x": zero, "ping_y": y, "ping_depth": zero + HEAD, "ping_roll": zero,
        "ping_pitch": zero, "ping_heading": zero, "head_sound_speed": zero + SPEED,
        "sector_frequency": [[3e5, 4e5]] * pings, "sector_delay": [[0.0, 1e-4]] * pings,
        "sector_angle": [[0.0, 0.0]] * pings, "sector_pulse_length": [[1e-4, 1e-4]] * pings,
        "sector_bandwidth": [[1e4, 1e4]] * pings, "sector_source_level_db": [[210.0, 210.0]] * pings,
        "sector_absorption_db": [[0.06, 0.09]] * pings,
        "valid": np.ones(shape, bool), "travel_time": 2 * np.hypot(below, across) / SPEED, "angle": beam,
        "transmit_angle": np.zeros(shape), "sector": (beam > 0).astype(int), "depth": HEAD + below + truth * error,
        "x": across, "y": np.broadcast_to(y[:, None], shape), "across_track": across, "along_track": np.zeros(shape),
        "detection": np.where(steep, BY_AMPLITUDE, BY_PHASE), "quality": np.full(shape, 2.5),
        "uncertainty": 0.05 + 0.1 * np.abs(beam), "horizontal_uncertainty": np.full(shape, 0.3),
        "backscatter_db": -20 + 10 * np.log10(np.cos(beam)**2 * chance.exponential(1, shape)),
        "grazing": 0.5 * np.pi - np.abs(beam),
    }
    if truth:
        values |= {"true_depth": HEAD + below, "error": error, **errors,
                   "true_backscatter_db": -20 + 20 * np.log10(np.cos(beam))}
    if column:
        values |= _column(pings, column, depth)
    return xr.Dataset({name: variable(name, array) for name, array in values.items()},
                      attrs={"sonar": "multibeam", "title": "drawn line", "start": "2026-05-01T10:00:00Z",
                             "crs": "EPSG:32632", "origin": (500000.0, 5300000.0)})


def _column(pings, samples, depth):
    """Bed at 100 dB over noise of 40 dB, and a ring of side lobes of 65 dB at the first return's range."""
    angle = np.deg2rad(np.linspace(-62, 62, 129))
    rate = samples / (2 * 2.2 * (depth - HEAD) / SPEED)
    away = 0.5 * SPEED * np.arange(samples) / rate
    bed = (depth - HEAD) / np.cos(angle)
    level = np.full((129, samples), 40.0)
    level[:, np.abs(away - (depth - HEAD)) < 0.8] = 65
    level[np.abs(away - bed[:, None]) < 1.2] = 100
    shape = pings, 129
    return {"column_angle": np.broadcast_to(angle, shape), "column_sector": np.broadcast_to(angle > 0, shape),
            "column_start": np.zeros(shape), "column_rate": np.full(shape, rate),
            "column_level_db": np.broadcast_to(level, (*shape, samples))}
