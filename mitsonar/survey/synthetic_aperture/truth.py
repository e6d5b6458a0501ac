"""Truth of a focused image, point by point: labels, shadows and places, in the image's own axes.

An aperture much longer than a range cell and much shorter than the range has the same truth as a sidescan with a very
narrow beam that passes along the straight mean line: in the image, an echo lies at the point that has the same two-way
time from abreast. The truth is therefore that of such a sidescan (`survey.energy`, `imaging.truth`), with one ping for
every row of points. Its bins are read at the two-way times of the points,

    t = 2 T(ρ, z)        ρ, z -> horizontal distance from the line, and depth, of the point; T the exact eigenray's time

Layover of surfaces above or below the grid is as in the image. A circular track has no abreast: its labels are those
seen from above. The rule of shadow (`imaging.shadows`) is for rows along time, which a circle lacks: its shadow is the
share of pings that do not see the bed at the point.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.imaging import sidescan as sidescan_image
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.scene.labels import classes_of
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Tracer, registry_index
from mitsonar.scene.world import World
from mitsonar.sonar.faces.directivity import Aperture
from mitsonar.sonar.faces.sidescan import SIDES, Sidescan
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Recorded, Trajectory, Voyage
from mitsonar.water.waters import Waters

from ..energy import energy
from ..energy.sides import Sides
from ..energy.sidescan_survey import SidescanSurvey
from ..survey import PerSurroundings
from ..voyage import Passage
from .plan import StripSurvey

STRAIGHT = np.deg2rad(30.0)        # largest spread of headings on a straight track
ROWS = 256                         # rows of points computed at once
RAYS_PER_BIN = 32
FEWEST_RAYS = 4096
BEYOND = 0.25                      # part of the image's time span by which the sidescan's window is longer
KEPT = ("label", "class", "share", "hidden", "object_shadow", "layover", "seabed_x", "seabed_y", "seabed_depth",
        "depth", "shadow")
WIDEST_ROW = 0.05                  # [m], width of the beam's footprint if there is only one row
LOOKS = 24                         # pings of a circle whose sight of the bed is tested


@dataclass(frozen=True, kw_only=True)
class MeanLine:
    """Mean straight line of a strip's pings."""

    middle: np.ndarray  # (3,) [m], scene frame
    heading: float  # [rad]

    @classmethod
    def of(cls, track: Track) -> MeanLine | None:
        """Return the mean line of a track; None if the track is not straight."""
        turns = np.angle(np.exp(1j * (track.heading - track.heading[0])))
        if np.ptp(turns) > STRAIGHT:
            return None
        middle, heading = track.position.mean(0), float(track.heading[0] + turns.mean())
        moved = track.position - middle
        if track.pings > 1 and np.ptp(moved[:, :2], axis=0).max() > 0:
            way = np.linalg.svd(moved[:, :2], full_matrices=False)[2][0]
            way = way * np.sign(way @ (track.position[-1] - track.position[0])[:2])
            heading = float(np.arctan2(way[0], way[1]))
        return cls(middle=middle, heading=heading)

    def feet(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the points (..., 3) [m] of the line that are abreast of points x, y (...) [m]."""
        ahead = np.array([np.sin(self.heading), np.cos(self.heading)])
        along = (x - self.middle[0]) * ahead[0] + (y - self.middle[1]) * ahead[1]
        return self.middle + along[..., None] * np.append(ahead, 0.0)


def strip_truth(survey: StripSurvey, x: np.ndarray, y: np.ndarray, depth: np.ndarray, seed: int = 0) -> xr.Dataset:
    """Return the truth of an image's points x, y, depth (A, C) [m]."""
    line = MeanLine.of(survey.track)
    if line is None:
        return _from_all_sides(survey, x, y)
    # rows that the aperture does not resolve share their truth
    resolved = 0.5 * max(survey.transmit.length, survey.receive.length)
    together = max(int(resolved / max(_spacing(x, y), 1e-9)), 1)
    rows = np.arange(len(x)) // together
    middle = np.minimum(np.arange(0, len(x), together) + together // 2, len(x) - 1)
    blocks = [middle[first:first + ROWS] for first in range(0, len(middle), ROWS)]
    parts = [_abreast(survey, line, x[block], y[block], depth[block], seed) for block in blocks]
    return xr.concat(parts, "along_track", combine_attrs="override").isel(along_track=rows)


def _spacing(x: np.ndarray, y: np.ndarray) -> float:
    """Return the distance between rows [m]."""
    return float(np.hypot(x[1, 0] - x[0, 0], y[1, 0] - y[0, 0])) if len(x) > 1 else np.inf


def _abreast(survey: StripSurvey, line: MeanLine, x: np.ndarray, y: np.ndarray, depth: np.ndarray,
             seed: int) -> xr.Dataset:
    """Return the truth of rows of points, from a sidescan along the mean line."""
    feet = line.feet(x, y)
    time = 2 * eigenray(survey.waters.first.profile, -feet[..., 2].ravel(), depth.ravel(),
                        np.hypot(x - feet[..., 0], y - feet[..., 1]).ravel()).travel_time.reshape(x.shape)
    finest = float(np.min(np.abs(np.diff(time, axis=1)), initial=np.inf)) if x.shape[1] > 1 else 0.0
    step = max(finest, 1 / survey.pulse.bandwidth)          # the pulse does not resolve finer bins
    # rays are sparse at the end of a window
    first, last = float(time.min()) - step, float(time.max()) + max(4 * step, BEYOND * float(np.ptp(time)))
    bins = max(int(np.ceil((last - first) / step)), 2)
    spacing = min(_spacing(x, y), WIDEST_ROW)
    sidescan = _sidescan(survey, line, feet[:, feet.shape[1] // 2], (first, last), bins, spacing)
    record = energy.record(sidescan, Sides(sidescan), seed)
    class_of = classes_of(survey.labels)[1]
    image = sidescan_image.image(
        record, sonar=sidescan.sonar, track=sidescan.track, depth_below=sidescan.depth_below, window=sidescan.window,
        labels=survey.labels, class_of=class_of, noise_db=None, speckle=None, seed=seed, absorption_db=0.0,
        paths=survey.paths.names)
    side = image[list(KEPT)].sel(side=SIDES[int(survey.look[1] > 0)], drop=True)
    bin = xr.DataArray(np.clip(((time - first) / (last - first) * bins).astype(int), 0, bins - 1),
                         dims=("along_track", "across_track"))
    rows = xr.DataArray(np.arange(len(x)), dims="along_track")
    chosen = side.isel(ping=rows, range=bin)
    return chosen.drop_vars([name for name in chosen.coords if name != "shape"])


def _sidescan(survey: StripSurvey, line: MeanLine, place: np.ndarray, window: tuple[float, float], bins: int,
              spacing: float) -> SidescanSurvey:
    """Return a sidescan along the line that has one ping at each place (A, 3) [m]."""
    level = np.zeros(len(place))
    track = Track(time=np.arange(len(place), dtype=float), position=place, roll=level, pitch=level,
                  heading=np.full(len(place), line.heading))
    water = survey.waters.first
    speed = float(water.profile.at(-line.middle[2]))
    range_ = 0.25 * speed * sum(window)
    face = Aperture(length=speed / survey.frequency * range_ / spacing, height=survey.transmit.height)
    sonar = Sidescan(frequency=survey.frequency, source_level_db=200.0, pulse_length=(window[1] - window[0]) / bins,
                     transmit=face, receive=face, sound_speed=speed,
                     depression_angle=float(np.arcsin(np.clip(survey.look[2], -1, 1))))
    passage = Passage(voyage=Voyage(track=track, trajectory=Trajectory(lead=Recorded.through(track))),
                      depth_below=np.full(len(place), float(np.mean(survey.depth_below))), depth=-place[:, 2])
    return SidescanSurvey(
        world=World(still=survey.world.still), waters=Waters.constant(replace(water, volume=None)), passage=passage,
        rays=2 * max(FEWEST_RAYS, RAYS_PER_BIN * bins), sonar=sonar, window=window, bins=bins, first_pass=0.15,
        per_cell=survey.per_cell)


def _from_all_sides(survey: StripSurvey, x: np.ndarray, y: np.ndarray) -> xr.Dataset:
    """Return the truth of points that the sonar sees from all sides."""
    geometry, lib = survey.world.still, arrays_of(mi.Float)
    top = geometry.depth_range[0] - 1.0
    east, north = (upload(mi.Float, np.ravel(values).astype(np.float32)) for values in (x, y))
    ray = mi.Ray3f(mi.Point3f(east, north, dr.opaque(mi.Float, -top)), mi.Vector3f(0, 0, -1))
    hit = geometry.scene.ray_intersect_preliminary(ray, coherent=mi.Bool(True))
    valid = hit.is_valid()
    label = dr.select(valid, dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(hit), valid), 0)
    depth = dr.select(valid, hit.t + dr.opaque(mi.Float, top), 0)
    point = lib.Array3f64(mi.Float64(east), mi.Float64(north), -mi.Float64(depth))
    dr.eval(label, depth, point, valid)
    paths, dark = PerSurroundings(survey, _direct_paths), dr.zeros(mi.Float, dr.width(label))
    looks = np.unique(np.linspace(0, survey.track.pings - 1, LOOKS).astype(int))
    for ping in looks:
        origin, (tracer, connector) = survey.track.position[ping], paths.at(ping)
        start = lib.Array3f64(*(dr.opaque(mi.Float64, float(part)) for part in origin))
        leg = connector.connect(tracer.sources([-origin[2]]), start, mi.UInt32(0), point, mi.Vector3f(0, 0, 0), valid,
                                short=0.01)
        dark += dr.select(leg.free, mi.Float(0), mi.Float(1))
        dr.eval(dark)
    labels, class_of = label.numpy().reshape(x.shape), classes_of(survey.labels)[1]
    dims = ("along_track", "across_track")
    return xr.Dataset({
        "label": (dims, labels, {"units": "1", "long_name": "shape seen from above"}),
        "class": (dims, np.array([0, *class_of.values()], np.uint32)[labels],
                  {"units": "1", "long_name": "class of that shape"}),
        "depth": (dims, depth.numpy().reshape(x.shape), {"units": "m", "long_name": "depth of that shape"}),
        "shadow": (dims, (dark.numpy() / len(looks)).reshape(x.shape).astype(np.float32),
                   {"units": "1", "long_name": "share of the pings that do not see the bed there"})})


def _direct_paths(survey: StripSurvey) -> tuple[Tracer, Connector]:
    """Return the tracer and the connector of a survey with the same surroundings at all pings."""
    geometry, water = survey.surroundings
    return Tracer(geometry, water, max_range=0.5 * survey.time[-1] * water.fastest), Connector(geometry, water)
