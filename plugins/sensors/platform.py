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
from dataclasses import replace

import numpy as np

from mitsonar.io import tracks
from mitsonar.io.navigation import Frame, Waypoints, middle
from mitsonar.plugins.attributes import Attributes
from mitsonar.sonar.motion import RandomMotion
from mitsonar.survey.voyage import MOST_PINGS, Route
from mitsonar.units import metres_per_second_from_knots

TURN_RADIUS = 10.0                 # [m]


def read_route(attributes: Attributes, pings: int) -> Route:
    """Read where a sonar goes.

    Parameters
    ----------
    attributes : Attributes
    pings : int
        How many, where the scene does not say.

    Raises
    ------
    ValueError
        If attributes contradict each other, or a file does not hold a track.
    """
    count = attributes.integer("pings", pings, minimum=1, maximum=MOST_PINGS)
    ping_rate = attributes.number("ping_rate_hz", None, above=0, unit="Hz")
    speed = float(metres_per_second_from_knots(attributes.number("speed_knots", 4.0, minimum=0, unit="knots")))
    start, heading = attributes.point("start", None), attributes.angle("heading_deg", None)
    altitude = attributes.number("altitude", 0.0, minimum=0, unit="m")
    depth = attributes.number("depth", None, minimum=0, unit="m")
    georeferenced = attributes.boolean("georeferenced", False)
    turn_radius = attributes.number("turn_radius", TURN_RADIUS, minimum=0, unit="m")
    origin = attributes.numbers("origin", None, count=2, unit="degrees")
    offset = attributes.numbers("offset", np.zeros(3), count=3, unit="m")
    rocking = {name: attributes.angle(f"{name}_deg", 0.0, minimum=0, maximum=30) for name in ("roll", "pitch", "yaw")}
    random_motion = RandomMotion(
        **rocking, heave=attributes.number("heave", 0.0, minimum=0, unit="m"),
        period=attributes.number("motion_period", 8.0, above=0, unit="s"),
        seed=attributes.integer("motion_seed", 0, minimum=0))
    path, text = attributes.file("track", None), attributes.text("waypoints", "")
    try:
        record = tracks.load(path) if path is not None else tracks.waypoints(text) if text.strip() else None
    except ValueError as error:
        raise attributes.error(str(error)) from None
    route = Route(pings=count, bounded=bool(attributes.given("pings")), ping_rate=ping_rate, speed=speed, start=start,
                  heading=heading, altitude=altitude, depth=depth, georeferenced=georeferenced,
                  turn_radius=turn_radius, origin=origin, offset=offset, random_motion=random_motion, record=record,
                  frame=None)
    _check(attributes, route, path, text.strip())
    if record is not None and record.geographic:
        route = replace(route, frame=middle(record) if origin is None else Frame.about(*origin))
    return route


def _check(attributes, route, path, text):
    """Refuse attributes that contradict each other or would count for nothing."""
    record, sailed = route.record, isinstance(route.record, Waypoints)
    if path is not None and text:
        raise attributes.error("track and waypoints are both given; leave one of them out.")
    written = attributes.given("start", "heading_deg", *() if sailed else ("speed_knots",))
    if record is not None and written:
        raise attributes.error(f"{', '.join(written)} and a {'course' if sailed else 'recorded track'} are both "
                               "given; leave one of them out.")
    if route.start is not None and route.altitude > 0:
        raise attributes.error("start and altitude are both given; start says the depth already, leave one out.")
    if route.depth is not None:
        if route.altitude > 0 or route.start is not None or (record is not None and record.z is not None):
            raise attributes.error("depth is given, but altitude, start or the track says how deep the sonar is; "
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
        motion = attributes.given("roll_deg", "pitch_deg", "yaw_deg", "heave", "motion_period", "motion_seed")
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
