"""The speckle of a sidescan's pings: gates, main lobe and way that `echoes.ground_speckle` works with.

At a range r a face receives from the direction u, against a point in its middle,

    b(u, r) = ∫ w(x) exp(ik (x²/2r - u x)) dx,        w(x) = ∫ p(u) exp(ik u x) du

in Fresnel's approximation: near the sonar its beam is as wide as the face, far from it the pattern p -> `Aperture`
without what errors of the face add, and along an even face w is constant.
"""
from __future__ import annotations

import numpy as np

from ..echoes.ground_speckle import LATTICES, GroundSpeckle, SpeckleBeam, SpeckleWay
from ..imaging.sidescan import speckle_gates
from ..sonar.directivity import Aperture
from ..sonar.sidescan import Sidescan
from .sidescan_survey import SidescanSurvey

__all__ = ["main_lobe", "side_speckle"]

WIDEST = 0.2                       # cosine beyond which no lobe is followed: pings are no nearer than such beams tell
LOBE_END = 1e-3                    # two-way intensity at which the main lobe ends (-30 dB)
SEARCHED, NODES = 192, 64          # cosines that its end is sought at, and of its table
POINTS = 64                        # of a face, at least
PER_OCTAVE = 6.0                   # ranges that the beam is tabulated at
LOBES = 8                          # of a beam that its face is found from
NEAREST = 0.5                      # [m]
LEVEL_OVER = 20.0                  # [m] of the track over which the bed's depth is averaged
ALONG = 0.75                       # of the lattices' spacing: a course that strays further takes another lattice
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
    # beyond, all ranges are alike
    far = min(max(farthest, NEAREST), max(8 * length ** 2 / wavelength, NEAREST))
    range_ = np.geomspace(NEAREST, far, 1 + int(np.ceil(PER_OCTAVE * np.log2(far / NEAREST))))
    far_lobe = 2 * wavelength / max(length, 1e-6)
    edge, pressure = np.empty(len(range_)), np.empty((len(range_), NODES), complex)
    for number, r in enumerate(range_):
        searched = np.linspace(0, min(far_lobe + length / r, WIDEST), SEARCHED)
        power = np.abs(_two_way(sonar, searched, r)) ** 2
        edge[number] = searched[min(np.flatnonzero(power > LOBE_END * power.max())[-1] + 1, SEARCHED - 1)]
        pressure[number] = _two_way(sonar, np.linspace(0, edge[number], NODES), r)
    return SpeckleBeam(ranges=range_, edge=edge, pressure=pressure / np.abs(pressure).max(1, keepdims=True))


def _two_way(sonar, u, r):
    transmit, receive = (_pressure(face, u, r, sonar.wavelength) for face in (sonar.transmit, sonar.receive))
    return transmit * receive


def _pressure(face: Aperture, u: np.ndarray, r: float, wavelength: float) -> np.ndarray:
    """Pressure b (U,) of a face at cosines (U,) and a range [m], by the midpoint rule."""
    length = face.length
    if not length:
        return np.ones(len(u))
    points = POINTS + int(8 * length / wavelength * (abs(u[-1]) + length / (4 * r)))
    even = face.along_shape.table is None
    # a beam that was measured may be that of a face longer than the even one of its width
    x = ((np.arange(points) + 0.5) / points - 0.5) * (length if even else 2 * length)
    weight = np.ones(points) if even else _weights(face, x, wavelength)
    return np.exp(2j * np.pi / wavelength * (x * x / (2 * r) - u[:, None] * x)) @ weight / weight.sum()


def _weights(face: Aperture, x: np.ndarray, wavelength: float) -> np.ndarray:
    """Weights w (X,) along a face, from the lobes of its beam next to the axis."""
    u = np.linspace(0, min(LOBES * wavelength / face.length, 1.0), 64 * LOBES)
    pattern = face.along_shape.lobes(u, face.length / wavelength)
    pattern[0] *= 0.5
    return np.cos(2 * np.pi / wavelength * x[:, None] * u) @ pattern


def _way(survey):
    """Phase centres and axes of all pings, as quadratics through three moments of the record."""
    track, duration = survey.track, max(survey.window[1], 1e-6)
    times = track.time[:, None] + duration * TIMES
    position, _ = survey.voyage.trajectory.pose(times, track.time[:, None])
    forward = survey.voyage.trajectory.rotation(times)[..., 0]
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
        first = np.round(course[start] / spacing)
        away = np.angle(np.exp(1j * (course[start:] - first * spacing)))
        strays = np.flatnonzero(np.abs(away) > ALONG * spacing)
        stop = start + (int(strays[0]) if strays.size else len(away))
        number[start:stop] = int(np.round((first * spacing + away[:stop - start].mean()) / spacing)) % LATTICES
        start = stop
    return number
