"""Small scenes for tests, as Mitsuba dictionaries: those of `mitsonar validate`, and of the other kinds of sonar.

    scene = multibeam({"bed": bed(40.0), "ball": point_target([30.0, 0.0, -38.0])}, film={"range": 60.0})

The builders of sonars take shapes by their ids, ``depth`` [m] of the sonar, and attributes of ``sensor``, ``water``,
``film`` and ``integrator`` that are added or replaced.
"""
from mitsonar.validation.scenes import (
    FLAWLESS,
    array_sonar,
    at_rest,
    bed,
    buried_bed,
    lambert,
    loaded,
    point_target,
    sediment,
    sidescan,
    water_of,
)

__all__ = ["FLAWLESS", "array_sonar", "bed", "buried_bed", "echo_sounder", "forward_looking", "interferometric",
           "lambert", "multibeam", "point_target", "sector_scan", "sediment", "sidescan", "synthetic_aperture",
           "water_of"]


def forward_looking(shapes, *, depth=10.0, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of a forward-looking sonar, by default of 720 kHz to 20 m."""
    return loaded(shapes, {"type": "forward_looking", "preset": "multibeam_720khz"}, at_rest(depth), sensor, water,
                  {"range": 20.0, **(film or {})}, integrator or {})


def multibeam(shapes, *, depth=10.0, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of a multibeam echo sounder, by default of 400 kHz to 60 m."""
    return loaded(shapes, {"type": "multibeam", "preset": "shallow_400khz", "pings": 1}, at_rest(depth), sensor, water,
                  {"range": 60.0, **(film or {})}, integrator or {})


def synthetic_aperture(shapes, *, depth=10.0, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of a synthetic aperture, by default of 300 kHz, 8 receivers, from 20 to 30 m."""
    return loaded(shapes, {"type": "synthetic_aperture", "preset": "minehunting_300khz", "receivers": 8, "banks": 1,
                           "pulse_ms": 1.0, "pings": 4, "noise": False}, {**at_rest(depth), "speed_knots": 3.0}, sensor,
                  water, {"range_min": 20.0, "range": 30.0, **(film or {})}, integrator or {"cell": 0.25})


def interferometric(shapes, *, depth=10.0, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of an interferometric sidescan, by default of 250 kHz and 500 bins to 50 m."""
    return loaded(shapes, {"type": "interferometric", "preset": "four_rows_250khz", "pings": 1}, at_rest(depth), sensor,
                  water, {"range": 50.0, "bins": 500, **(film or {})}, integrator or {})


def echo_sounder(shapes, *, depth=2.0, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of an echo sounder, by default of 120 kHz, split beam, with bins of 10 cm to 60 m."""
    return loaded(shapes, {"type": "echo_sounder", "preset": "scientific_120khz", "pings": 1}, at_rest(depth), sensor,
                  water, {"range": 60.0, "bins": 600, **(film or {})}, integrator or {})


def sector_scan(shapes, *, depth=10.0, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of a rotating head, by default of 750 kHz and 400 bins to 20 m."""
    return loaded(shapes, {"type": "sector_scan", "preset": "head_750khz"}, at_rest(depth), sensor, water,
                  {"range": 20.0, "bins": 400, **(film or {})}, integrator or {})
