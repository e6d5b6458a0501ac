"""What carries a sonar, as the sensors' shared attributes say it, ping by ping.

- ``pings`` [400], ``ping_rate_hz`` (default: as fast as the range allows, c / 2 range), ``speed_knots`` [4]

Where it goes, one of these:

- ``track``: a recorded track (CSV or XTF, see `mitsonar.io.tracks`), resampled at the ping rate, at most ``pings`` of
  it if that is written; a CSV file without times holds way points
- ``waypoints``: "0 0, 50 0, 50 30" [m] or "37.75N 122.38W, 37.76N 122.38W", sailed to the end or for ``pings`` if that
  is written; ``turn_radius`` [m, 10] of the arcs between the legs, 0: corners, where the heading jumps
- ``start`` (point, z up) and ``heading_deg``: a straight, level track
- or none: straight over the middle of the surveyed area along its longer axis unless ``heading_deg`` is written.

How deep: at the z of the track, the way points or the start; where these have none, ``depth`` [m] below the surface, or
``altitude`` [m] above the seabed (20 for the line over the middle), which also goes before a recorded z.

Frames: x and y of files and way points are the scene's, or with ``georeferenced`` [false] eastings and northings as the
bathymetry's file has them; degrees are projected to the bathymetry's coordinate system or, where the scene has none, to
metres about ``origin``: "latitude, longitude" of x = y = 0, by default the middle of the track.

Motion: a recorded track has its own. Else ``roll_deg``, ``pitch_deg``, ``yaw_deg`` and ``heave`` [m] are root mean
squares [0] of random motion about ``motion_period`` [8 s], realised by ``motion_seed`` [0]. ``offset``: "forward,
starboard, down" [m] of the sonar from where the track leads, turned by the attitude.
"""
import logging
import warnings
from dataclasses import dataclass, replace

import numpy as np

from mitsonar.io import tracks
from mitsonar.io.navigation import Frame, Waypoints, middle
from mitsonar.sonar import Array, Pulse, Track
from mitsonar.sonar.motion import RandomMotion
from mitsonar.sonar.trajectory import Recorded, Sailed, Smooth, Trajectory, Voyage
from mitsonar.sonar.waypoints import Course
from mitsonar.units import metres_per_second_from_knots

from ...survey import placement

ALTITUDE = 20.0                    # [m] of a straight line laid over the seabed, where none is written
TURN_RADIUS = 10.0                 # [m]
MOST_PINGS = 10_000_000

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class ArrayPlan:
    """What a sensor with arrays is going to do over a scene.

    Attributes
    ----------
    voyage : Voyage
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

    voyage: Voyage
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

    Attributes
    ----------
    frame : Frame or None
        Where a track in degrees lays the origin of a scene that does not say it itself.
    way : (float, float) or None [m]
        Sailed and planned, of the course or recorded track that was laid last.
    """

    def __init__(self, attributes, pings=400):
        self.pings = attributes.integer("pings", pings, minimum=1, maximum=MOST_PINGS)
        self.ping_rate = attributes.number("ping_rate_hz", None, above=0, unit="Hz")
        self.speed = float(metres_per_second_from_knots(attributes.number("speed_knots", 4.0, minimum=0, unit="knots")))
        self.start = attributes.point("start", None)
        self.heading = attributes.angle("heading_deg", None)
        self.altitude = attributes.number("altitude", 0.0, minimum=0, unit="m")
        self.depth = attributes.number("depth", None, minimum=0, unit="m")
        self.georeferenced = attributes.boolean("georeferenced", False)
        self.turn_radius = attributes.number("turn_radius", TURN_RADIUS, minimum=0, unit="m")
        self.origin = attributes.numbers("origin", None, count=2, unit="degrees")
        self.offset = attributes.numbers("offset", np.zeros(3), count=3, unit="m")
        rocking = {name: attributes.angle(f"{name}_deg", 0.0, minimum=0, maximum=30)
                   for name in ("roll", "pitch", "yaw")}
        self.random_motion = RandomMotion(
            **rocking, heave=attributes.number("heave", 0.0, minimum=0, unit="m"),
            period=attributes.number("motion_period", 8.0, above=0, unit="s"),
            seed=attributes.integer("motion_seed", 0, minimum=0))
        self._bounded = bool(attributes.given("pings"))
        path, text = attributes.file("track", None), attributes.text("waypoints", "")
        try:
            self.record = tracks.load(path) if path is not None else tracks.waypoints(text) if text.strip() else None
        except ValueError as error:
            raise attributes.error(str(error)) from None
        self._check(attributes, path, text.strip())
        self.frame = self.way = None
        if self.record is not None and self.record.geographic:
            self.frame = middle(self.record) if self.origin is None else Frame.about(*self.origin)

    def _check(self, attributes, path, text):
        """Refuse attributes that contradict each other or would count for nothing."""
        record, sailed = self.record, isinstance(self.record, Waypoints)
        if path is not None and text:
            raise attributes.error("track and waypoints are both given; leave one of them out.")
        written = attributes.given("start", "heading_deg", *() if sailed else ("speed_knots",))
        if record is not None and written:
            raise attributes.error(f"{', '.join(written)} and a {'course' if sailed else 'recorded track'} are both "
                                   "given; leave one of them out.")
        if self.start is not None and self.altitude > 0:
            raise attributes.error("start and altitude are both given; start says the depth already, leave one out.")
        if self.depth is not None:
            if self.altitude > 0 or self.start is not None or (record is not None and record.z is not None):
                raise attributes.error("depth is given, but altitude, start or the track says how deep the sonar is; "
                                       "leave one out.")
        elif record is not None and record.z is None and not self.altitude:
            raise attributes.error(f"the {'way points do' if sailed else 'track does'} not say how deep the sonar is; "
                                   "give depth [m] below the surface or altitude [m] above the seabed.")
        if not sailed and self.turn_radius != TURN_RADIUS:
            raise attributes.error("turn_radius is given, but only a course through way points has turns; leave it "
                                   "out.")
        if sailed and not self.speed:
            raise attributes.error("speed_knots is 0, but there are way points to reach; give a speed above 0.")
        if record is not None and not sailed:
            motion = attributes.given("roll_deg", "pitch_deg", "yaw_deg", "heave", "motion_period", "motion_seed")
            if motion:
                raise attributes.error(f"{', '.join(motion)} and a recorded track are both given; a recorded track has "
                                       "its own motion, leave them out.")
        in_degrees = record is not None and record.geographic
        if in_degrees and self.georeferenced:
            raise attributes.error("georeferenced is true, but the track is in latitude and longitude, which are "
                                   "projected in any case; leave it out.")
        if self.origin is not None and not in_degrees:
            raise attributes.error("origin is given, but only a track in latitude and longitude needs it; leave it "
                                   "out.")
        if self.origin is not None and not (abs(self.origin[0]) <= 90 and abs(self.origin[1]) <= 360):
            raise attributes.error(f"origin is {self.origin[0]:g}, {self.origin[1]:g}; give latitude (within +-90) and "
                                   "longitude [degrees], in this order.")

    def plan(self, geometry, shortest, origin=None, crs=""):
        """Lay the track over a scene.

        Parameters
        ----------
        geometry : trace.Geometry
        shortest : float [s]
            Time a ping needs until its last echo is in.
        origin : (2,) [m] or None
            Easting and northing of the scene's origin.
        crs : str
            Coordinate system of the origin; empty where nobody knows.

        Returns
        -------
        voyage : Voyage
            The pings' track, and the trajectory it lies on.
        depth_below : (P,) [m]
            Seabed below the sonar.

        Raises
        ------
        ValueError
            If the track leaves the seabed, the water, or the recorded span, or pings come too fast.
        """
        interval = self._interval(shortest)
        if self.record is None:
            voyage = self._straight(geometry, interval)
        elif isinstance(self.record, Waypoints):
            voyage = self._sailed(geometry, interval, self._frame(origin, crs), origin)
        else:
            voyage = self._recorded(geometry, interval, self._frame(origin, crs), origin)
        if self.random_motion.moves or np.any(self.offset):
            trajectory = Trajectory(lead=voyage.trajectory.lead, motion=self.random_motion, offset=self.offset)
            voyage = Voyage.of(trajectory, voyage.track.time)
        return voyage, placement.check(geometry, voyage.track)

    def _straight(self, geometry, interval):
        if self.start is not None:
            track = Track.straight(start=self.start, heading=self.heading or 0.0, speed=self.speed, interval=interval,
                                   pings=self.pings)
        else:
            altitude = 0.0 if self.depth is not None else self.altitude or ALTITUDE
            track = placement.lines_up(geometry, heading=self.heading, altitude=altitude, pings=self.pings,
                                       interval=interval, speed=self.speed)
        if self.depth is not None:
            track = _at_height(track, np.full(track.pings, -self.depth))
        if track.pings > 1:
            lead = Recorded.through(track)
        else:
            # one ping alone moves on as many would
            course = self.speed * np.array([np.sin(track.heading[0]), np.cos(track.heading[0]), 0.0])
            lead = Recorded.through(replace(
                track, time=track.time[0] + np.arange(2.0), position=track.position + np.outer(np.arange(2.0), course),
                **{name: np.repeat(getattr(track, name), 2) for name in ("roll", "pitch", "heading")}))
        return Voyage(track=track, trajectory=Trajectory(lead=lead))

    def _sailed(self, geometry, interval, frame, origin):
        places = self.record.placed(frame)
        _refuse_far(geometry, places, frame, origin)
        course = Course(places, self.turn_radius)
        pings = self._count(course.length / self.speed, interval, "the way points take")
        time = interval * np.arange(pings)
        self._tell_cut("course", self.speed * time[-1], course.length, course.length / self.speed, interval, pings)
        z = np.full(pings, -(self.depth or 0.0)) if self.record.z is None else np.interp(
            self.speed * time, course.marks, self.record.z)

        def sailed(z):
            return Trajectory(lead=Sailed(course=course, speed=self.speed, height=Smooth(time, z)))

        trajectory = sailed(z)
        if self.altitude:
            trajectory = sailed(placement.lifted(geometry, trajectory.track(time), self.altitude).position[:, 2])
        return Voyage.of(trajectory, time)

    def _recorded(self, geometry, interval, frame, origin):
        recorded = self.record.placed(frame, self.depth or 0.0)
        _refuse_far(geometry, recorded.position, frame, origin)
        lasting = recorded.time[-1] - recorded.time[0]
        pings = self._count(lasting, interval, "the track lasts") if recorded.pings > 1 else 1
        time = np.minimum(recorded.time[0] + interval * np.arange(pings), recorded.time[-1])
        trajectory = Trajectory(lead=Recorded.through(recorded))
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(recorded.position[:, :2], axis=0).T))])
        if recorded.pings > 1:
            self._tell_cut("track", np.interp(time[-1], recorded.time, along), along[-1], lasting, interval, pings)
        if self.altitude:
            # it follows the seabed, not the z that was recorded, and heaves as recorded
            lifted = placement.lifted(geometry, trajectory.track(time), self.altitude)
            trajectory = Trajectory(lead=Recorded.through(
                recorded, height=Smooth(time, lifted.position[:, 2]),
                heave=Smooth(self.record.time, self.record.heave)))
        return Voyage.of(trajectory, time)

    def _count(self, lasting, interval, what):
        """How many pings fit into a time [s]."""
        fitting = lasting / interval + 1e-9
        pings = self.pings if self._bounded and self.pings <= fitting else int(min(fitting, MOST_PINGS)) + 1
        if pings > MOST_PINGS:
            raise ValueError(f"{what} {lasting:.3g} s, which is more than {MOST_PINGS} pings {interval:.4f} s apart; "
                             "check its times and places, or say how many pings")
        return pings

    def _tell_cut(self, what, sailed, planned, lasting, interval, pings):
        """Keep how far [m] it goes, and tell if that is not all because of ``pings``."""
        self.way = float(sailed), float(planned)
        whole = int(lasting / interval + 1e-9) + 1
        if pings < whole:
            warnings.warn(f"the {what} is cut by pings, {pings}: {sailed:.0f} of {planned:.0f} m are sailed; "
                          f"{whole} pings are all of it", stacklevel=2)

    def _interval(self, shortest):
        """Time between pings [s]; the last echo of one must be in before the next."""
        if self.ping_rate is None:
            return shortest
        if 1 / self.ping_rate < shortest * (1 - 1e-9):
            raise ValueError(f"ping_rate_hz is {self.ping_rate}, but echoes from the range of the film take "
                             f"{shortest:.4f} s; use at most {1 / shortest:.3f} Hz or a shorter range")
        return 1 / self.ping_rate

    def _frame(self, origin, crs):
        """Where the record's coordinates meet the scene's: a `Frame`, or None if they are the same."""
        if self.frame is not None and origin is None:
            _log.info("x and y are metres in %s", self.frame.crs)
            return self.frame
        if self.origin is not None:
            raise ValueError("origin is given, but the bathymetry of the scene says already where it lies; leave it "
                             "out")
        if not (self.record.geographic or self.georeferenced):
            return None
        if origin is None:
            raise ValueError("georeferenced is true, but no bathymetry of the scene has a geographic origin; "
                             "set it false, or use a bathymetry with a coordinate system")
        return Frame(crs=crs, origin=tuple(float(value) for value in origin))


def _at_height(track, z):
    return replace(track, position=np.column_stack([track.position[:, :2], z]))


def _refuse_far(geometry, position, frame, origin):
    """Refuse a track from another part of the world by what may be wrong with it."""
    if frame is not None:
        placement.check_near(geometry, position[:, :2], frame.crs)
    else:
        placement.check_local(geometry, position[:, :2], origin)
