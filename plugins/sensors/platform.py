"""What carries a sonar, as the sensors' shared attributes say it: a straight line or a recorded track, ping by ping.

- ``pings`` [400], ``ping_rate_hz`` (default: as fast as the range allows, c / 2 range), ``speed_knots`` [4]
- ``track``: CSV file with time, x, y, z, roll, pitch, heading; resampled at the ping rate, at most ``pings`` of it if
  that is written. ``georeferenced`` [false]: x, y are eastings and northings, as the bathymetry's file has them.
  ``altitude`` [m]: fly its x, y this far above the seabed instead of at its z; 0, the default, keeps z.
- or ``start`` (point, z up) and ``heading_deg``: a straight, level track
- or neither: straight over the middle of the surveyed area, ``altitude`` [m, 20] above the seabed, along its longer
  axis unless ``heading_deg`` is written.
"""
from dataclasses import dataclass

import numpy as np

from mitsonar.io import tracks
from mitsonar.sonar import Array, Pulse, Track
from mitsonar.units import metres_per_second_from_knots

from . import placement

ALTITUDE = 20.0                    # [m] of a straight line laid over the seabed, where none is written


@dataclass(frozen=True, kw_only=True)
class ArrayPlan:
    """What a sensor with arrays is going to do over a scene.

    Attributes
    ----------
    track : Track
    velocity, turn_rate : (P, 3) [m/s], [rad/s]
        Scene frame.
    depth_below : (P,) [m]
        Seabed below the sonar.
    sound_speed : float [m/s]
        At the arrays.
    transmit, receive : Array
    pulse : Pulse
    source_level_db : float [dB re 1 µPa @ 1 m]
        Of all transmit elements together, if their echoes add up.
    bins_are_samples : bool
        The film's bins, or its rate, are those of the signals; else they are a picture's and the pulse sets the rate.
    """

    track: Track
    velocity: np.ndarray
    turn_rate: np.ndarray
    depth_below: np.ndarray
    sound_speed: float
    transmit: Array
    receive: Array
    pulse: Pulse
    source_level_db: float
    bins_are_samples: bool


class Platform:
    """Read a sensor's attributes about where it goes, and lay the track over a scene.

    Parameters
    ----------
    attributes : Attributes
    pings : int
        How many, where the scene does not say.
    """

    def __init__(self, attributes, pings=400):
        self.pings = attributes.integer("pings", pings, minimum=1, maximum=10_000_000)
        self.ping_rate = attributes.number("ping_rate_hz", None, above=0, unit="Hz")
        self.speed = float(metres_per_second_from_knots(attributes.number("speed_knots", 4.0, minimum=0, unit="knots")))
        self.start = attributes.point("start", None)
        self.heading = attributes.angle("heading_deg", None)
        self.altitude = attributes.number("altitude", 0.0, minimum=0, unit="m")
        path = attributes.file("track", None)
        self.georeferenced = attributes.boolean("georeferenced", False)
        self._bounded = bool(attributes.given("pings"))
        written = attributes.given("start", "heading_deg", "speed_knots")
        if path is not None and written:
            raise attributes.error(f"{', '.join(written)} and a recorded track are both given; leave one of them out.")
        if self.start is not None and self.altitude > 0:
            raise attributes.error("start and altitude are both given; start says the depth already, leave one out.")
        try:
            self.recorded = None if path is None else tracks.read(path)
        except ValueError as error:
            raise attributes.error(str(error)) from None

    def plan(self, geometry, shortest, origin=None):
        """Lay the track over a scene.

        Parameters
        ----------
        geometry : trace.Geometry
        shortest : float [s]
            Time a ping needs until its last echo is in.
        origin : (2,) [m] or None
            Easting and northing of the scene's origin.

        Returns
        -------
        track : Track
        depth_below : (P,) [m]
            Seabed below the sonar.

        Raises
        ------
        ValueError
            If the track leaves the seabed, the water, or the recorded span, or pings come too fast.
        """
        interval = self._interval(shortest)
        if self.recorded is not None:
            track = self._resampled(interval, origin)
            if self.altitude:
                track = placement.lifted(geometry, track, self.altitude)
        elif self.start is not None:
            track = Track.straight(start=self.start, heading=self.heading or 0.0, speed=self.speed, interval=interval,
                                   pings=self.pings)
        else:
            track = placement.lines_up(geometry, heading=self.heading, altitude=self.altitude or ALTITUDE,
                                       pings=self.pings, interval=interval, speed=self.speed)
        return track, placement.check(geometry, track)

    def motion(self, track):
        """Velocity [m/s] and rate of turn [rad/s] at every ping of the track laid, (P, 3) each, scene frame."""
        if self.recorded is not None and self.recorded.pings > 1:
            moving = self.recorded
            velocity, turn_rate = (np.stack([np.interp(track.time, moving.time, axis) for axis in rate.T], -1)
                                   for rate in moving.motion())
            if self.altitude:
                # it follows the seabed, not the z that was recorded
                velocity[:, 2] = track.motion()[0][:, 2] if track.pings > 1 else 0
            return velocity, turn_rate
        if track.pings > 1:
            return track.motion()
        speed = 0.0 if self.recorded is not None else self.speed
        heading = track.heading[0]
        return speed * np.array([[np.sin(heading), np.cos(heading), 0.0]]), np.zeros((1, 3))

    def _interval(self, shortest):
        """Time between pings [s]; the last echo of one must be in before the next."""
        if self.ping_rate is None:
            return shortest
        if 1 / self.ping_rate < shortest * (1 - 1e-9):
            raise ValueError(f"ping_rate_hz is {self.ping_rate}, but echoes from the range of the film take "
                             f"{shortest:.4f} s; use at most {1 / shortest:.3f} Hz or a shorter range")
        return 1 / self.ping_rate

    def _resampled(self, interval, origin):
        recorded = self.recorded
        if self.georeferenced:
            if origin is None:
                raise ValueError("georeferenced is true, but no bathymetry of the scene has a geographic origin; "
                                 "set it false, or use a bathymetry with a coordinate system")
            position = recorded.position - np.array([*origin, 0.0])
            recorded = Track(time=recorded.time, position=position, roll=recorded.roll, pitch=recorded.pitch,
                             heading=recorded.heading)
        if recorded.pings == 1:
            return recorded
        lasting = int((recorded.time[-1] - recorded.time[0]) / interval + 1e-9) + 1
        pings = min(self.pings, lasting) if self._bounded else lasting
        return recorded.at(recorded.time[0] + interval * np.arange(pings))
