"""The speckle of a sidescan's pings: gates, main lobe and way that `echoes.ground_speckle` works with."""
from __future__ import annotations

import numpy as np

from mitsonar.echoes.scatterers.ground_speckle import LATTICES, GroundSpeckle, SpeckleBeam, SpeckleWay
from mitsonar.imaging.sidescan import speckle_gates
from mitsonar.sonar.faces.near_field import near_pressure
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.sonar.motion.track import rotation_matrix

from .sidescan_survey import SidescanSurvey

__all__ = ["main_lobe", "side_speckle"]

WIDEST = 0.2                       # cosine beyond which no lobe is followed: pings are no nearer than such beams tell
LOBE_END = 1e-3                    # two-way intensity at which the main lobe ends (-30 dB)
STEP = 1 / 32                      # of cosines, in wavelengths over the face's length
NODES = 64                         # of a lobe's table
PER_OCTAVE = 6.0                   # ranges that the beam is tabulated at
NEAREST, NEAREST_LENGTHS = 0.5, 0.5      # [m], and in lengths of the face: where its beam is looked at first
LEVEL_OVER = 20.0                  # [m] of the track over which the bed's depth is averaged
ALONG = 0.75                       # of the lattices' spacing: a course that strays further takes another lattice
STRETCH = 64                       # pings that the end of a stretch is first looked for in
TIMES = np.array([0.0, 0.5, 1.0])


def side_speckle(survey: SidescanSurvey, seed: int) -> GroundSpeckle:
    """Make the source of a survey's speckle."""
    sonar, (start, end) = survey.sonar, survey.window
    gates = survey.bins * speckle_gates(survey.bin_length, sonar.pulse_length)
    to_range = 0.5 * sonar.sound_speed
    return GroundSpeckle(
        way=_way(survey), beam=main_lobe(sonar, to_range * end), wavenumber=2 * np.pi / sonar.wavelength,
        start=to_range * start, gate=to_range * (end - start) / gates, gates=gates, sound_speed=sonar.sound_speed,
        seed=seed)


def main_lobe(sonar: Sidescan, farthest: float) -> SpeckleBeam:
    """Give the two-way main lobe along the platform, down to -30 dB, up to a range [m]."""
    wavelength, length = sonar.wavelength, max(sonar.transmit.length, sonar.receive.length)
    nearest = max(NEAREST, NEAREST_LENGTHS * length)
    # beyond, all ranges are alike
    far = max(nearest, min(farthest, 8 * length ** 2 / wavelength))
    ranges = np.geomspace(nearest, far, 1 + int(np.ceil(PER_OCTAVE * np.log2(far / nearest))))
    widest, step = WIDEST, WIDEST / NODES
    if length:
        widest, step = min(2 * wavelength / length + length / nearest, WIDEST), STEP * wavelength / length
    u = np.linspace(0, widest, NODES + int(widest / step))
    pressure = near_pressure(sonar.transmit, u, ranges, wavelength)
    pressure = pressure * (pressure if sonar.one_face else near_pressure(sonar.receive, u, ranges, wavelength))
    pressure /= np.abs(pressure).max(1, keepdims=True)
    edge, table = np.empty(len(ranges)), np.empty((len(ranges), NODES), complex)
    for number, lobe in enumerate(pressure):
        edge[number] = u[min(np.flatnonzero(np.abs(lobe) ** 2 > LOBE_END)[-1] + 1, len(u) - 1)]
        table[number] = np.interp(np.linspace(0, edge[number], NODES), u, lobe)
    return SpeckleBeam(ranges=ranges, edge=edge, pressure=table)


def _way(survey):
    """Phase centres and axes of all pings, as quadratics through three moments of the record."""
    track, duration = survey.track, max(survey.window[1], 1e-6)
    times = track.time[:, None] + duration * TIMES
    position, attitude = survey.voyage.trajectory.pose(times, track.time[:, None])
    forward = rotation_matrix(*np.moveaxis(attitude, -1, 0))[..., 0]
    centre, axis = 0.5 * (position[:, :1] + position), 0.5 * (forward[:, :1] + forward)
    centre[..., 2] -= (track.position[:, 2] - _levelled(track.position, survey.depth_below))[:, None]
    fit = np.linalg.inv((duration * TIMES)[:, None] ** np.arange(3))
    course = np.arctan2(axis[:, 0, 1], axis[:, 0, 0])
    return SpeckleWay(centre=np.einsum("kt,ptx->pkx", fit, centre), axis=np.einsum("kt,ptx->pkx", fit, axis),
                      lattice=_lattices(course))


def _levelled(position: np.ndarray, depth_below: np.ndarray) -> np.ndarray:
    """Height above the bed (P,) [m], with the bed's depth averaged along the track: ripples do not move scatterers."""
    bed = position[:, 2] - depth_below
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(position[:, :2], axis=0).T)))
    if way[-1] == 0:
        return position[:, 2] - bed.mean()
    total = np.append(0.0, np.cumsum(np.diff(way) * 0.5 * (bed[1:] + bed[:-1])))
    ends = [np.clip(way + end, 0, way[-1]) for end in (-0.5 * LEVEL_OVER, 0.5 * LEVEL_OVER)]
    # the integral is quadratic between pings, but the bed is not better known than so
    mean = (np.interp(ends[1], way, total) - np.interp(ends[0], way, total)) / (ends[1] - ends[0])
    return position[:, 2] - mean


def _lattices(course: np.ndarray) -> np.ndarray:
    """Numbers (P,) of the lattices that pings of a course [rad], from x to y, take: one for each straight stretch."""
    spacing = np.pi / LATTICES
    number, start = np.empty(len(course), int), 0
    while start < len(course):
        first, ahead = np.round(course[start] / spacing) * spacing, STRETCH
        while True:                            # a stretch is looked for no further than twice its length
            away = np.angle(np.exp(1j * (course[start:start + ahead] - first)))
            strays = np.flatnonzero(np.abs(away) > ALONG * spacing)
            if strays.size or start + ahead >= len(course):
                break
            ahead *= 2
        stop = start + (int(strays[0]) if strays.size else len(away))
        number[start:stop] = int(np.round((first + away[:stop - start].mean()) / spacing)) % LATTICES
        start = stop
    return number
