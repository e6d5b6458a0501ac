"""Routes as a scene describes them, laid over its seabed."""
import logging
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mitsonar.io.tracks.navigation import Frame, Navigation, Waypoints
from mitsonar.io.tracks.tides import Tide
from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.motion.motion import RandomMotion
from mitsonar.sonar.motion.riding import Riding
from mitsonar.sonar.motion.stepping import SteppedPing, Stepping, voyage_of
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Circled, Lead, Recorded, Sailed, SmoothCurve, Trajectory, Voyage
from mitsonar.sonar.motion.waypoints import Course

from . import placement

ALTITUDE = 20.0                    # [m] of a straight line over the seabed, unless the scene writes one
MOST_PINGS = 1_000_000             # more than a day at ten pings a second; laying such a track takes ten seconds

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Passage:
    """Route laid over a scene.

    For a sonar that is stepped, it is the plan from which everything follows that all pings share.
    """

    voyage: Voyage  # pings' track, and the trajectory it lies on
    depth_below: np.ndarray  # (P,) [m]: seabed below the sonar
    depth: np.ndarray  # (P,) [m]: of the sonar on the route, below the water level, without `Route.position_error`
    interval: float = 0.0  # [s]: between pings
    stepping: Stepping | None = None  # of a sonar that is stepped
    of_ping: Callable[[SteppedPing], Voyage] = voyage_of  # makes this sonar's voyage of a stepped ping
    frame: Frame | None = None  # place of the scene on Earth, if only the track has it
    sailed: float | None = None  # [m]: length of the course or recorded track that the pings cover
    platform: Voyage | None = None  # of the platform, where `voyage` is that of a head that turns on it
    planned: float | None = None  # [m]: full length of the course or recorded track
    tide: SmoothCurve | None = None  # [m]: height of the water level above z = 0, by the clock of the track

    def level(self, times: np.ndarray) -> np.ndarray:
        """Return the height of the water level above z = 0 [m] at times (...) [s]."""
        return np.zeros(np.shape(times)) if self.tide is None else self.tide.at(np.asarray(times, float))

    @property
    def latest(self) -> SteppedPing | None:
        """Return the latest ping of a sonar that is stepped; None before the first one, and along a planned route."""
        return None if self.stepping is None else self.stepping.latest

    @property
    def now(self) -> Voyage:
        """Return the voyage of the pings: that of the latest stepped ping, or the planned one."""
        return self.voyage if self.latest is None else self.latest.voyage(self.of_ping)

    @property
    def below(self) -> np.ndarray:
        """Return the seabed's depth below the sonar at the pings, (P,) [m]: at the latest step, or as planned."""
        latest = self.latest
        return self.depth_below if latest is None else np.broadcast_to(latest.depth_below, latest.ping + 1)


@dataclass(frozen=True, kw_only=True)
class Route:
    """Route of a sonar as the scene describes it."""

    pings: int
    bounded: bool  # True if the scene writes the number of pings
    ping_rate: float | None  # [Hz]: None for the highest that the film's range allows
    speed: float  # [m/s]
    start: np.ndarray | None  # (3,) [m]: of a straight track, z up
    heading: float | None  # [rad]: of a straight track
    altitude: float  # [m]: above the seabed
    depth: float | None  # [m]: below the surface
    georeferenced: bool  # True if positions are eastings and northings
    turn_radius: float  # [m]: of the arcs between the legs of a course
    origin: np.ndarray | None  # (2,) [degrees]: latitude and longitude of x = y = 0, if the scene writes it
    offset: np.ndarray  # (3,) [m]: of the sonar from the track
    random_motion: RandomMotion
    record: Navigation | Waypoints | None  # recorded track or course; None for a straight line
    frame: Frame | None  # origin from a record in degrees, for a scene without one of its own
    interval: float | None = None  # [s]: between pings, if another sonar on the same track sets it
    hull: tuple[float, float] | None = None  # [m]: length and beam of a hull that rides on the waves
    tide: Tide | None = None  # of the water; None: the water level is z = 0
    circle: float | None = None  # [m]: radius of a circle about the start, sailed in place of a straight track
    position_error: np.ndarray | None = None  # (P, 3) [m]
    attitude_error: np.ndarray | None = None  # (P, 3) [rad]

    def lay(self, geometry: Geometry, shortest: float) -> Passage:
        """Return the route laid over a scene, with pings at least `shortest` [s] apart."""
        interval = self._interval(shortest)
        if self.circle is not None:
            voyage, lengths = self._circled(self.circle, interval), (None, None)
        elif self.record is None:
            voyage, lengths = self._straight(geometry, interval), (None, None)
        elif isinstance(self.record, Waypoints):
            voyage, lengths = self._sailed(self.record, geometry, interval)
        else:
            voyage, lengths = self._recorded(self.record, geometry, interval)
        time = voyage.track.time
        tide = None if self.tide is None else self.tide.over(float(time[0]), float(time[-1]))
        riding = tide if self.keeps_depth else None
        if self.random_motion.moves or np.any(self.offset) or riding is not None or self.hull is not None:
            trajectory = Trajectory(lead=self._ridden(voyage.trajectory.lead, geometry), motion=self.random_motion,
                                    offset=self.offset, tide=riding)
            voyage = Voyage.of(trajectory, voyage.track.time)
        depth = -voyage.track.position[:, 2]
        if tide is not None:
            depth = depth + tide.at(time)
        if self.position_error is not None or self.attitude_error is not None:
            errors = (np.zeros((1, 3)) if error is None else error for error in (self.position_error,
                                                                                 self.attitude_error))
            voyage = Voyage(track=voyage.track.moved(*errors), trajectory=voyage.trajectory)
        passage = Passage(voyage=voyage, depth_below=depth, depth=depth, interval=interval, frame=self.frame,
                          sailed=lengths[0], planned=lengths[1], tide=tide)
        below = placement.check(geometry, voyage.track, level=passage.level(voyage.track.time))
        return replace(passage, depth_below=below)

    @property
    def keeps_depth(self) -> bool:
        """Return True if the sonar keeps its depth below the water level, not its height above the bed."""
        return self.start is not None or self.depth is not None or (self.record is not None and not self.altitude)

    def _ridden(self, course: Lead, geometry: Geometry) -> Lead:
        """Return a course with the motion of the waves, if a hull rides on them."""
        if self.hull is None:
            return course
        if geometry.sea is None:
            raise ValueError("ride_waves is given, and the scene has no waves; give its sea_surface waves, or leave "
                             "ride_waves out")
        return Riding(course=course, waves=geometry.sea.waves, length=self.hull[0], beam=self.hull[1])

    def _straight(self, geometry, interval):
        if self.start is not None:
            track = Track.straight(start=self.start, heading=self.heading or 0.0, speed=self.speed, interval=interval,
                                   pings=self.pings)
        else:
            altitude = 0.0 if self.depth is not None else self.altitude or ALTITUDE
            track = placement.lines_up(geometry, heading=self.heading, altitude=altitude, pings=self.pings,
                                       interval=interval, speed=self.speed)
        if self.depth is not None:
            track = replace(track, position=np.column_stack([track.position[:, :2], np.full(track.pings, -self.depth)]))
        if track.pings > 1:
            lead = Recorded.through(track)
        else:
            # a single ping moves like one of many
            course = self.speed * np.array([np.sin(track.heading[0]), np.cos(track.heading[0]), 0.0])
            lead = Recorded.through(replace(
                track, time=track.time[0] + np.arange(2.0), position=track.position + np.outer(np.arange(2.0), course),
                **{name: np.repeat(getattr(track, name), 2) for name in ("roll", "pitch", "heading")}))
        return Voyage(track=track, trajectory=Trajectory(lead=lead))

    def _circled(self, radius: float, interval: float) -> Voyage:
        turn = 2 * np.pi * radius / self.speed
        pings = self.pings if self.bounded else min(max(int(np.ceil(turn / interval - 1e-9)), 1), MOST_PINGS)
        middle = np.array(self.start, float)
        if self.depth is not None:
            middle[2] = -self.depth
        trajectory = Trajectory(lead=Circled(middle=middle, radius=radius, speed=self.speed))
        return Voyage.of(trajectory, interval * np.arange(pings))

    def _sailed(self, record, geometry, interval):
        frame = self._frame(geometry)
        places = record.placed(frame)
        _refuse_far(geometry, places, frame)
        course = Course(places, self.turn_radius)
        pings = self._count(course.length / self.speed, interval, "the way points take")
        time = interval * np.arange(pings)
        z = np.full(pings, -(self.depth or 0.0)) if record.z is None else np.interp(
            self.speed * time, course.marks, record.z)

        def sailed(z: np.ndarray) -> Trajectory:
            return Trajectory(lead=Sailed(course=course, speed=self.speed, height=SmoothCurve(time, z)))

        length = self.speed * time[-1]
        _warn_of_cut("course", length, course.length, course.length / self.speed, interval, pings)
        trajectory = sailed(z)
        if self.altitude:
            trajectory = sailed(placement.heights_over(geometry, trajectory.track(time), self.altitude))
        return Voyage.of(trajectory, time), (float(length), float(course.length))

    def _recorded(self, record, geometry, interval):
        frame = self._frame(geometry)
        recorded = record.placed(frame, self.depth or 0.0)
        _refuse_far(geometry, recorded.position, frame)
        lasting = recorded.time[-1] - recorded.time[0]
        pings = self._count(lasting, interval, "the track lasts") if recorded.pings > 1 else 1
        time = np.minimum(recorded.time[0] + interval * np.arange(pings), recorded.time[-1])
        trajectory = Trajectory(lead=Recorded.through(recorded))
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(recorded.position[:, :2], axis=0).T))])
        sailed = planned = None
        if recorded.pings > 1:
            sailed, planned = float(np.interp(time[-1], recorded.time, along)), float(along[-1])
            _warn_of_cut("track", sailed, planned, lasting, interval, pings)
        if self.altitude:
            # the sonar follows the seabed instead of the recorded z, and heaves as recorded
            z = placement.heights_over(geometry, trajectory.track(time), self.altitude)
            trajectory = Trajectory(lead=Recorded.through(recorded, height=SmoothCurve(time, z),
                                                          heave=SmoothCurve(record.time, record.heave)))
        return Voyage.of(trajectory, time), (sailed, planned)

    def _count(self, lasting, interval, what):
        """Return the number of pings in a time [s]; `what` begins the error message."""
        fitting = lasting / interval + 1e-9
        pings = self.pings if self.bounded and self.pings <= fitting else int(min(fitting, MOST_PINGS)) + 1
        if pings > MOST_PINGS:
            raise ValueError(f"{what} {lasting:.3g} s, which is more than {MOST_PINGS} pings {interval:.4f} s apart; "
                             "check its times and places, or set the number of pings")
        return pings

    def _interval(self, shortest):
        """Return the time between pings [s]; the last echo of a ping must arrive before the next ping."""
        if self.interval is not None:
            return self.interval
        if self.ping_rate is None:
            return shortest
        if 1 / self.ping_rate < shortest * (1 - 1e-9):
            raise ValueError(f"ping_rate_hz is {self.ping_rate}, but echoes from the range of the film take "
                             f"{shortest:.4f} s; use at most {1 / shortest:.3f} Hz or a shorter range")
        return 1 / self.ping_rate

    def _frame(self, geometry):
        """Return the `Frame` of the record's coordinates, None if they are those of the scene."""
        if self.frame is not None and geometry.local_origin is None:
            _log.info("x and y are metres in %s", self.frame.crs)
            return self.frame
        if self.origin is not None:
            raise ValueError("origin is given, but the bathymetry of the scene has a geographic origin already; remove "
                             "the attribute")
        geographic = self.record is not None and self.record.geographic
        if not (geographic or self.georeferenced):
            return None
        if geometry.local_origin is None:
            raise ValueError("georeferenced is true, but no bathymetry of the scene has a geographic origin; "
                             "set it false, or use a bathymetry with a coordinate system")
        easting, northing = geometry.local_origin[:2]
        return Frame(crs=geometry.crs or "", origin=(float(easting), float(northing)))


def _warn_of_cut(what, sailed, planned, lasting, interval, pings):
    """Warn if the number of pings ends a course or a track before its end; lengths [m] and times [s]."""
    full = int(lasting / interval + 1e-9) + 1
    if pings < full:
        warnings.warn(f"the {what} is cut by pings, {pings}: {sailed:.0f} of {planned:.0f} m are sailed; "
                      f"{full} pings are all of it", stacklevel=4)


def _refuse_far(geometry, position, frame):
    """Refuse a track far from the scene, with an error that names the likely mistake."""
    if frame is not None:
        placement.check_near(geometry, position[:, :2], frame.crs)
    else:
        placement.check_local(geometry, position[:, :2])
