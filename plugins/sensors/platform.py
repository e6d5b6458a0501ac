"""Platform of a sonar: its course, its depth and its motion.

The course is one of these:

- ``track``: a recorded track (see `mitsonar.io.tracks.tracks`), resampled at the ping rate, to its end or for ``pings``
  if that is written; a CSV file without times holds way points
- ``waypoints``: way points, sailed to the end or for ``pings`` if that is written
- ``start`` and ``heading_deg``: a straight, level track
- ``start`` and ``circle_radius``: a circle about the start, once round unless ``pings`` is written
- none of these: a straight track over the middle of the surveyed area, along its longer axis unless ``heading_deg`` is
  written.

The depth is the z of the track, the way points or the start. If these have no z, it is set by ``depth`` or
``altitude``. ``altitude`` also replaces a recorded z, as does the ``draft`` of a vessel. Depths are below the water
level, which a ``tide`` of the water moves; altitudes are not.

x and y of files and way points are those of the scene. With ``georeferenced`` they are eastings and northings as in the
bathymetry's file. Degrees are projected to the bathymetry's coordinate system or, in a scene without one, to metres
about ``origin``.

A recorded track has its own motion. On other tracks the motion is random, for the kind of platform that ``motion``
names; ``roll_deg``, ``pitch_deg``, ``yaw_deg``, ``heave``, ``surge`` and ``sway`` are root mean squares. The cable of a
tow may strum, in a narrow band about ``strum_hz``; strum is also added to a recorded track.
"""
from dataclasses import replace

from mitsonar.io.tracks import tracks
from mitsonar.io.tracks.navigation import Frame, Waypoints, middle
from mitsonar.sonar.motion.motion import RandomMotion, strum_frequency
from mitsonar.sonar.preset_tables import motions
from mitsonar.survey.voyage import MOST_PINGS, Route
from mitsonar.units import metres_per_second_from_knots

from ..attributes import (
    Angle,
    Attributes,
    Boolean,
    Choice,
    File,
    FromTable,
    Group,
    Integer,
    Number,
    Numbers,
    Point,
    Text,
)

TURN_RADIUS = 10.0                 # [m]
MOTION = FromTable(table=motions(), by="motion")
PERIODS = "roll_period", "pitch_period", "yaw_period", "heave_period", "sway_period"

ROUTE = Group(title="Track and motion", module="sensors.platform", attributes=(
    Number("ping_rate_hz", default=None, above=0, unit="Hz", otherwise="as the range allows", text="pings a second"),
    Number("speed_knots", default=4.0, minimum=0, unit="knots", text="speed on a straight track or along way points"),
    Point("start", default=None,
          text="place of the first ping, z up; without it the track is laid over the middle of the seabed"),
    Angle("heading_deg", default=None, otherwise="0 from `start`, else the longer axis",
          text="heading of a straight track, clockwise from north"),
    Number("circle_radius", default=None, above=0, maximum=1e5, unit="m",
           text="radius of a circle about `start`, sailed clockwise: starboard looks inwards"),
    Number("altitude", default=0.0, minimum=0, unit="m", otherwise="20, of a recorded track 0",
           text="height above the seabed (smoothed over 20 m); 0: keep the recorded z; not with `start`"),
    Number("depth", default=None, minimum=0, unit="m",
           text="depth below the surface, used where `track`, `waypoints`, `start` and `altitude` leave it open"),
    Number("draft", default=None, minimum=0, unit="m",
           text="depth of a vessel's reference point below the waterline: as `depth`, but it also replaces the z of a "
                "`track`, whose heave stays; `offset` leads from there to the array"),
    File("track", default=None,
         text="CSV, XTF, SBET or POS MV file, resampled to the ping rate; not with `start`, `heading_deg`, "
              "`speed_knots`; a CSV file without `time` holds way points"),
    Text("track_date", default="",
         text="any date of the week of a `track` that counts seconds of a week, as SBET does; without it, times have "
              "no date"),
    Text("waypoints", default="",
         text='way points such as "0 0, 80 0, 80 60" [m] or "37.75N 122.38W, 37.76N 122.38W"; a third number is z '
              '(up); the heading follows the course'),
    Integer("line", default=0, minimum=0,
            text="number of the survey line to sail: of the column `line` of a `track`, or of the parts of `waypoints` "
                 "between signs |; 0: all of them, one after the other"),
    Number("turn_radius", default=TURN_RADIUS, minimum=0, unit="m",
           text="radius of the arcs between legs, which begin and end within a second; 0: corners, turns left out"),
    Boolean("georeferenced", default=False,
            text="true: x and y of the track are eastings and northings as in the bathymetry's file"),
    Numbers("origin", default=None, count=2, unit="degrees", otherwise="middle of the track",
            text='"latitude, longitude" of x = y = 0, for a track in degrees over a seabed without a coordinate '
                 'system'),
    Choice("motion", default="none", choices=tuple(motions()),
           text="kind of platform that sets the defaults marked *motion*, on a straight track or way points: `tow` "
                "for a fish on a cable, `auv` for a vehicle, `hull` for a launch; a recorded track has its own "
                "motion"),
    Angle("roll_deg", default=MOTION, minimum=0, maximum=30,
          text="rms random roll; like all random motion but strum, not with a recorded track"),
    Angle("pitch_deg", default=MOTION, minimum=0, maximum=30, text="rms random pitch"),
    Angle("yaw_deg", default=MOTION, minimum=0, maximum=30, text="rms random yaw"),
    Number("heave", default=MOTION, minimum=0, unit="m", text="rms random heave"),
    Number("surge", default=MOTION, minimum=0, unit="m", text="rms random surge; forward while heave rises"),
    Number("sway", default=MOTION, minimum=0, unit="m", text="rms random sway, positive to starboard"),
    Number("motion_period", default=None, above=0, unit="s", otherwise="those below",
           text="one period for all random motion"),
    *(Number(name, default=MOTION, above=0, unit="s", text=f"period of the random {name.partition('_')[0]}"
             + (" and surge" if name == "heave_period" else "")) for name in PERIODS),
    Number("strum_heave", default=0.0, minimum=0, maximum=0.1, unit="m",
           text="rms heave of the cable's strum; usual: up to 0.003"),
    Angle("strum_pitch_deg", default=0.0, minimum=0, maximum=5,
          text="rms pitch of the cable's strum; usual: up to 0.2"),
    Number("strum_hz", default=None, above=0, unit="Hz", otherwise="0.2 speed / `cable_diameter`",
           text="centre frequency of the strum; a cable may swing twice during the reception of a ping"),
    Number("cable_diameter", default=0.02, above=0, unit="m", text="diameter of the bare cable; usual: 0.008 to 0.025"),
    Integer("motion_seed", default=0, minimum=0, text="seed of the random motion"),
    Numbers("ride_waves", default=None, count=2, unit="m",
            text='"length, beam" of the waterline of a hull that rises, pitches and rolls with the waves of the '
                 'scene\'s `sea_surface`; not with a recorded track'),
    Numbers("offset", default=(0.0, 0.0, 0.0), count=3, unit="m",
            text='"forward, starboard, down" of the sonar from the reference point of the track, turned by the '
                 'attitude'),
))
OF_THE_TRACK = ("pings", *(one.name for one in ROUTE.attributes if one.name != "offset"))      # not of the lever arm


def pings(usual: int) -> Integer:
    """Declare the number of pings; `usual` is its default."""
    return Integer("pings", default=usual, minimum=1, maximum=MOST_PINGS,
                   text="number of pings; for a recorded track or way points, the greatest number if written")


def read_route(attributes: Attributes) -> Route:
    """Return the route of a sonar."""
    path, text, origin = attributes.track, attributes.waypoints.strip(), attributes.origin
    try:
        record = (tracks.load(path, attributes.line, attributes.track_date or None) if path is not None else
                  tracks.waypoints(_of_line(text, attributes.line)) if text else None)
    except ValueError as error:
        raise attributes.error(error) from None
    speed = float(metres_per_second_from_knots(attributes.speed_knots))
    recorded = record is not None and not isinstance(record, Waypoints)
    attributes.only_one("depth", "draft")
    if record is not None and attributes.draft is not None:
        record = replace(record, z=None)
    random_motion = RandomMotion(**{} if recorded else _rocking(attributes), **_strum(attributes, speed, recorded),
                                 seed=attributes.motion_seed)
    route = Route(
        pings=attributes.pings, bounded=bool(attributes.given("pings")), ping_rate=attributes.ping_rate_hz,
        speed=speed, start=attributes.start, hull=_hull(attributes, recorded),
        heading=attributes.heading_deg, altitude=attributes.altitude,
        depth=attributes.depth if attributes.draft is None else attributes.draft,
        georeferenced=attributes.georeferenced, turn_radius=attributes.turn_radius, origin=origin,
        offset=attributes.offset, random_motion=random_motion, record=record, frame=None,
        circle=attributes.circle_radius)
    _check(attributes, route, path, text)
    if record is not None and record.geographic:
        route = replace(route, frame=middle(record) if origin is None else Frame.about(*origin))
    return route


def _of_line(text: str, line: int) -> str:
    """Return the way points of a line, or of all lines."""
    lines = [part.strip() for part in text.split("|")]
    if not line:
        return ", ".join(part.rstrip(",; ") for part in lines if part)
    if line > len(lines) or not lines[line - 1]:
        known = [number for number, part in enumerate(lines, 1) if part]
        raise ValueError(f"line is {line}, and the way points are those of {len(known)} lines, of which the last is "
                         f"number {known[-1] if known else 0}; give the number of one of them, or 0 for all.")
    return lines[line - 1]


def _rocking(attributes):
    """Return the root mean squares and periods of random motion, by the names of `RandomMotion`."""
    one = {} if attributes.motion_period is None else {
        name: attributes.motion_period for name in PERIODS if not attributes.given(name)}
    return {"roll": attributes.roll_deg, "pitch": attributes.pitch_deg, "yaw": attributes.yaw_deg,
            "heave": attributes.heave, "surge": attributes.surge, "sway": attributes.sway,
            **{name: getattr(attributes, name) for name in PERIODS}, **one}


def _hull(attributes, recorded):
    """Return length and beam of a hull that rides on waves; None without one."""
    hull = attributes.ride_waves
    if hull is None:
        return None
    if recorded:
        raise attributes.error("ride_waves and a recorded track are both given; a recorded track has its own motion, "
                               "leave ride_waves out.")
    if not min(hull) > 0:
        raise attributes.error(f"ride_waves is {hull[0]:g}, {hull[1]:g}; give length and beam of the hull above 0 m.")
    return float(hull[0]), float(hull[1])


def _strum(attributes, speed, recorded):
    """Return the strum of a cable, likewise; `speed` [m/s] of the water along it, unless the track is recorded."""
    if not attributes.strum_heave + attributes.strum_pitch_deg:
        if written := attributes.given("strum_hz", "cable_diameter"):
            raise attributes.error(f"{written[0]} is given without strum_heave or strum_pitch_deg; give one of them "
                                   "too, or leave it out.")
        return {}
    attributes.only_one("strum_hz", "cable_diameter")
    frequency = attributes.strum_hz
    if frequency is None:
        if recorded or not speed:
            raise attributes.error("a strum's frequency follows from speed_knots, which "
                                   f"{'a recorded track does not take' if recorded else 'is 0'}; give strum_hz.")
        frequency = strum_frequency(speed, attributes.cable_diameter)
    return {"strum_heave": attributes.strum_heave, "strum_pitch": attributes.strum_pitch_deg,
            "strum_frequency": frequency}


def _check(attributes, route, path, text):
    """Refuse attributes that contradict each other or would have no effect."""
    record, sailed = route.record, isinstance(route.record, Waypoints)
    if attributes.line and record is None:
        raise attributes.error("line is given, but neither track nor waypoints have lines; leave it out.")
    if path is not None and text:
        raise attributes.error("track and waypoints are both given; leave one of them out.")
    written = attributes.given("start", "heading_deg", *() if sailed else ("speed_knots",))
    if record is not None and written:
        raise attributes.error(f"{', '.join(written)} and a {'course' if sailed else 'recorded track'} are both "
                               "given; leave one of them out.")
    if route.circle is not None:
        if route.start is None or record is not None or route.heading is not None or not route.speed:
            raise attributes.error("circle_radius is given, and a circle is sailed about `start` at a speed above 0; "
                                   "give start, and leave heading_deg, track and waypoints out.")
    if route.start is not None and route.altitude > 0:
        raise attributes.error("start and altitude are both given; start says the depth already, leave one out.")
    if route.depth is not None:
        if route.altitude > 0 or route.start is not None or (record is not None and record.z is not None):
            written = attributes.given("depth", "draft")[0]
            raise attributes.error(f"{written} is given, but altitude, start or the track says how deep the sonar is; "
                                   "leave one out.")
    elif record is not None and record.z is None and not route.altitude:
        raise attributes.error(f"the {'way points do' if sailed else 'track does'} not say how deep the sonar is; "
                               "give depth [m] below the surface or altitude [m] above the seabed.")
    if not sailed and route.turn_radius != TURN_RADIUS:
        raise attributes.error("turn_radius is given, but only a course through way points has turns; leave it "
                               "out.")
    if sailed and not route.speed:
        raise attributes.error("speed_knots is 0, but there are way points to reach; give a speed above 0.")
    if record is not None and not sailed:
        motion = attributes.given("roll_deg", "pitch_deg", "yaw_deg", "heave", "surge", "sway", "motion_period",
                                  *PERIODS, *() if route.random_motion.strums else ("motion_seed",))
        if motion:
            raise attributes.error(f"{', '.join(motion)} and a recorded track are both given; a recorded track has "
                                   "its own motion, leave them out.")
    in_degrees = record is not None and record.geographic
    if in_degrees and route.georeferenced:
        raise attributes.error("georeferenced is true, but the track is in latitude and longitude, which are "
                               "projected in any case; leave it out.")
    if route.origin is not None and not in_degrees:
        raise attributes.error("origin is given, but only a track in latitude and longitude needs it; leave it "
                               "out.")
    if route.origin is not None and not (abs(route.origin[0]) <= 90 and abs(route.origin[1]) <= 360):
        raise attributes.error(f"origin is {route.origin[0]:g}, {route.origin[1]:g}; give latitude (within +-90) and "
                               "longitude [degrees], in this order.")
