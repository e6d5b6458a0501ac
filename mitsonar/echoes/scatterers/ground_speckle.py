"""Speckle of a sidescan that is fixed to the ground: the sum over the scatterers of each resolution cell.

    g(p, j) = Σ_c b(u_c) a_c exp(2ik R_c) / √(Σ_c b²(u_c)),        r_j <= R_c < r_j + Δr,   c on this side

for ping p and the gate j that begins at r_j: unit variance, circular Gaussian. a_c is the complex Gaussian amplitude of
scatterer c, hashed from its place. R_c is its distance from the phase centre, half-way between the places of
transmission and reception. u_c is the cosine of its direction along the platform, half-way between both attitudes. b is
the complex two-way pressure of both faces at that range (`SpeckleBeam`). k -> ``wavenumber``, Δr -> ``gate``.

Gates share no scatterers, so their values are independent. Pings share the scatterers that lie in the gate for both.
Phases are relative to the sonar, not to the gate: a pulse several gates long sums the same ground, wherever it begins.
Hence

    <g(p) g*(q)> = ∫ a(x) a*(x - Δ) exp(2ik δ x) dx / ∫ |a|² dx

for phase centres Δ apart along the platform and a yaw of δ: the autocorrelation of the two-way aperture a, the same at
all ranges (the theorem of Van Cittert and Zernike; e.g. Goodman 2007, Speckle phenomena in optics, ch. 4).

Scatterers lie on a level plane under the sonar, at places hashed in the cells of lattices that are fixed to the scene.
A lattice has cells 2^n m long and one gate wide. There is one lattice for each of `LATTICES` orientations, the same for
both ways along a line. A ping uses the lattice of its course, along which its footprints are long. Echoes from nearer
than the plane, from the water, use lattices of their own. Each gate of a ping is one thread, which visits the cells
that it crosses, so results depend on nothing but the ping.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, looped, upload
from mitsonar.device.chance import Salt, gaussian, hashed, hashed_pair
from mitsonar.device.types import Float, UInt32

LATTICES = 16                      # orientations over half a turn
PER_BEAM = 5.0                     # least number of scatterers along the equivalent width of a footprint
COLUMNS = 256                      # greatest length of a gate's footprint, in cells
FLOOR = 1e-4                       # power of a scatterer that each gate has of its own, in case it contains no other
OWN = float(np.sqrt(FLOOR))        # amplitude of that scatterer
COEFFICIENTS = 20                  # numbers of a ping's way: six quadratics in time, two to fill up rows of four


@dataclass(frozen=True, kw_only=True)
class SpeckleBeam:
    """The main lobe along the platform, tabulated at some ranges."""

    ranges: np.ndarray  # (K,) [m]: ascending
    edge: np.ndarray  # (K,) [-]: cosine u at the edge of the lobe
    pressure: np.ndarray  # (K, N) [-]

    @property
    def width(self) -> np.ndarray:
        """Return the equivalent two-way widths ∫ |b|² du (K,) [-]."""
        power = np.abs(self.pressure) ** 2
        return 2 * self.edge / (power.shape[1] - 1) * (power.sum(1) - 0.5 * (power[:, 0] + power[:, -1]))

    def nearest(self, distance: np.ndarray) -> np.ndarray:
        """Return the index of the range (...) whose ratio to a distance (...) [m] is nearest to 1."""
        if len(self.ranges) == 1:
            return np.zeros(np.shape(distance), int)
        return np.searchsorted(np.sqrt(self.ranges[1:] * self.ranges[:-1]), distance)


@dataclass(frozen=True, kw_only=True)
class SpeckleWay:
    """Place and axis of pings, as quadratics c_0 + c_1 t + c_2 t² of the time t since transmission."""

    centre: np.ndarray  # (P, 3, 3) [m, m/s, m/s²]: phase centre
    axis: np.ndarray  # (P, 3, 3) [-, 1/s, 1/s²]: forward direction half-way between the attitudes
    lattice: np.ndarray  # (P,): number of the ping's lattice orientation


class GroundSpeckle:
    """Speckle of a survey's pings; wavenumber [rad/m], start and gate [m], sound speed [m/s]."""

    def __init__(self, *, way: SpeckleWay, beam: SpeckleBeam, wavenumber: float, start: float, gate: float, gates: int,
                 sound_speed: float, seed: int):
        self._lib, self._way, self._gates, self._gate = arrays_of(mi.Float), way, gates, gate
        self._start, self._length, self._speed, self._twice = (
            dr.opaque(mi.Float, value) for value in (start, gate, sound_speed, 2 * wavenumber))
        self._seed = dr.opaque(mi.UInt32, int(seed) & 0xFFFFFFFF)
        # exp(2ik r_j): in double precision, as r_j is many wavelengths
        begin = np.maximum(start + np.arange(gates) * gate, 0)
        self._begin = np.exp(2j * wavenumber * begin).astype(np.complex64)
        nodes = beam.pressure.shape[1]
        steps = np.diff(beam.pressure, axis=1, append=beam.pressure[:, -1:])
        table = np.stack([np.real(beam.pressure), np.imag(beam.pressure), np.real(steps), np.imag(steps)], -1)
        self._beam, self._edge = (upload(mi.Float, values.astype(np.float32)) for values in (table, beam.edge))
        self._nodes, self._count = dr.opaque(mi.UInt32, nodes), dr.opaque(mi.UInt32, gates)
        range_ = np.maximum(start + (np.arange(gates) + 0.5) * gate, gate)
        nearest = beam.nearest(range_)
        level = np.floor(np.log2(range_ * beam.width[nearest] / PER_BEAM)).astype(int)
        self._coarsest = int(level.max())
        self._longest = dr.opaque(mi.Float, 2.0 ** self._coarsest)
        # for each gate: by which power of two its lattice is finer than the coarsest, and the index of its beam
        self._of_gate = upload(mi.UInt32, np.c_[self._coarsest - level, nearest].astype(np.uint32))
        dr.eval(self._beam, self._edge, self._of_gate)

    def of(self, ping: np.ndarray) -> np.ndarray:
        """Return the speckle of pings (B,) as complex128 (B, 2, gates): port, starboard."""
        thread = dr.arange(mi.UInt32, 2 * len(ping) * self._gates)
        table, place = self._pings(ping)
        real, imaginary = self._speckle(thread, table, place)
        dr.eval(real, imaginary)
        return (real.numpy() + np.complex64(1j) * imaginary.numpy()).reshape(len(ping), 2, self._gates) * self._begin

    def _pings(self, ping):
        """Return the ways of pings in their lattices' frames, from an anchor nearby, and the anchors' cells."""
        way, turn = self._way, self._way.lattice[ping] * (np.pi / LATTICES)
        cosine, sine = np.cos(turn), np.sin(turn)
        into = np.stack([np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)], -2)           # (B, 2, 2)
        centre, axis = way.centre[ping].copy(), way.axis[ping].copy()
        for vectors in (centre, axis):
            vectors[..., :2] = np.einsum("pij,pkj->pki", into, vectors[..., :2])
        size = np.array([2.0 ** self._coarsest, self._gate])
        anchor = np.floor(centre[:, 0, :2] / size)
        centre[:, 0, :2] -= anchor * size
        rows = np.zeros((len(ping), COEFFICIENTS), np.float32)
        rows[:, :18] = np.stack([centre, axis], 1).reshape(len(ping), 18)
        number = np.zeros((len(ping), 4), np.uint32)             # four wide, so that a ping's row is one aligned packet
        number[:, :2], number[:, 2] = anchor.astype(np.int64) & 0xFFFFFFFF, way.lattice[ping]
        return upload(mi.Float, rows), upload(mi.UInt32, number)

    def _speckle(self, thread, table, place):
        """Return the real and imaginary part of g exp(-2ik r_j), Float64 (T,)."""
        lib, U = self._lib, mi.UInt32
        row = thread // self._count
        gate = thread - row * self._count
        words = dr.gather(lib.Array4u, place, row >> 1)
        of_gate = dr.gather(lib.Array2u, self._of_gate, gate)
        footprint, water = self._footprint(row, gate, table, of_gate.y)
        cells = _SpeckleCells(
            length=self._longest / mi.Float(U(1) << of_gate.x), width=self._length,
            first=words.x << of_gate.x, second=words.y,
            key=hashed(lib, self._seed ^ U(Salt.GROUND_SPECKLE), words.z + LATTICES * U(water) + (of_gate.x << 8)))
        real, imaginary, weight = self._summed(footprint, cells, of_gate.y)
        own = gaussian(lib, *hashed_pair(lib, cells.key, words.x, words.y, row & 1, gate))
        scale = dr.rsqrt(weight + FLOOR)
        wide = lib.Float64
        return tuple((wide(part) + OWN * wide(chance)) * wide(scale) for part, chance in zip((real, imaginary), own))

    def _footprint(self, row, gate, table, beam):
        """Return the footprints of gates, and True where they lie in the water."""
        near = dr.maximum(self._start + mi.Float(gate) * self._length, 0)
        far = near + self._length
        rows = [dr.gather(self._lib.Array4f, table, (row >> 1) * (COEFFICIENTS // 4) + k)
                for k in range(COEFFICIENTS // 4)]
        flat, time = [part for four in rows for part in four], (near + far) / self._speed
        x, y, height, ahead_x, ahead_y, ahead_z = (flat[k] + (flat[k + 3] + flat[k + 6] * time) * time
                                                   for k in (0, 1, 2, 9, 10, 11))
        water = far <= height
        height = dr.select(water, 0, height)
        level = dr.maximum(dr.hypot(ahead_x, ahead_y), 1e-3)
        return _Footprint(
            x=x, y=y, height=height, along_x=ahead_x / level, along_y=ahead_y / level, level=level, steep=ahead_z,
            side=mi.Float(row & 1) * 2 - 1, near=near, far=far, edge=dr.gather(mi.Float, self._edge, beam)), water

    def _summed(self, footprint, cells, beam):
        """Return Σ b a exp(2ik (R - r)) over a footprint's scatterers, as real and imaginary part, and Σ |b|²."""
        first, last = footprint.extent()
        begin = dr.floor((footprint.x + first) / cells.length)
        end = dr.minimum(dr.floor((footprint.x + last) / cells.length), begin + COLUMNS)

        def add_cell(column: Float, line: Float, real: Float, imaginary: Float, weight: Float) -> tuple[Float, ...]:
            b_real, b_imaginary, a_real, a_imaginary = self._scatterer(footprint, cells, beam, column, line)
            return (real + (b_real * a_real - b_imaginary * a_imaginary),
                    imaginary + (b_real * a_imaginary + b_imaginary * a_real),
                    weight + dr.square(b_real) + dr.square(b_imaginary))

        def add_column(column: Float, end: Float, *sums: Float) -> tuple[Float, ...]:
            low, high = footprint.lines(column * cells.length - footprint.x, cells.length)
            line, stop = (dr.floor((footprint.y + y) / cells.width) for y in (low, high))
            added = looped((line, stop, *sums), lambda line, stop, *_: line <= stop,
                           lambda line, stop, *sums: (line + 1, stop, *add_cell(column, line, *sums)),
                           "cells of a column")
            return column + 1, end, *added[2:]

        return looped((begin, end, *(mi.Float(0) for _ in range(3))), lambda column, end, *_: column <= end, add_column,
                      "columns of a footprint")[2:]

    def _scatterer(self, footprint, cells, beam, column, line):
        """Return b and a exp(2ik (R - r)) of a cell's scatterer, each in two parts; b is 0 outside the footprint."""
        lib = self._lib
        spot = hashed(lib, lib.UInt32(lib.Int32(column)) + cells.first, lib.UInt32(lib.Int32(line)) + cells.second,
                      cells.key)
        x = (column + mi.Float(spot >> 16) * 2.0 ** -16) * cells.length - footprint.x
        y = (line + mi.Float(spot & 0xFFFF) * 2.0 ** -16) * cells.width - footprint.y
        squared = dr.square(x) + dr.square(y)
        distance = dr.sqrt(squared + dr.square(footprint.height))
        u = abs((x * footprint.along_x + y * footprint.along_y) * footprint.level
                - footprint.height * footprint.steep) / distance
        inside = ((squared >= footprint.inner) & (squared < footprint.outer) & (u < footprint.edge)
                  & (footprint.side * (x * footprint.along_y - y * footprint.along_x) > 0))
        last = mi.Float(self._nodes - 1)
        node = held(u * (last / footprint.edge), 0, last)
        part = node - dr.floor(node)
        four = dr.gather(lib.Array4f, self._beam, beam * self._nodes + mi.UInt32(node), inside)
        b_real, b_imaginary = (dr.select(inside, four[k] + part * four[k + 2], 0) for k in (0, 1))
        # R - r without a difference of large numbers
        later = (squared - footprint.inner) / dr.maximum(distance + footprint.near, 1e-6)
        return b_real, b_imaginary, *gaussian(lib, *hashed_pair(lib, spot), self._twice * later)


@dataclass(frozen=True, kw_only=True)
class _SpeckleCells:
    """Cells of a lattice: length along x and width along y [m], the numbers of the anchor's cell, and the hash key."""

    length: Float
    width: Float
    first: UInt32
    second: UInt32
    key: UInt32


@dataclass(frozen=True, kw_only=True)
class _Footprint:
    """Footprints of gates, each a part of a ring, in the frames of their lattices."""

    x: Float  # [m]: phase centre, from the lattice's anchor
    y: Float
    height: Float  # [m]: of the phase centre above the plane
    along_x: Float  # horizontal forward direction, of unit length
    along_y: Float
    level: Float  # horizontal and vertical part of the forward direction
    steep: Float
    side: Float  # -1 port, 1 starboard
    near: Float  # [m]: limits of the gate
    far: Float
    edge: Float  # of the main lobe

    @property
    def inner(self) -> Float:
        """Return the square of the inner radius [m²]; negative where the gate begins above the plane."""
        return dr.square(self.near) - dr.square(self.height)

    @property
    def outer(self) -> Float:
        """Return the square of the outer radius [m²]."""
        return dr.maximum(dr.square(self.far) - dr.square(self.height), 0)

    def extent(self) -> tuple[Float, Float]:
        """Return the least and the largest x of the corners, from the phase centre [m]."""
        reach, middle = dr.sqrt(self.outer), self.height * self.steep / self.level
        half = self.edge * self.far / self.level
        corners = []
        for end in (middle - half, middle + half):
            s = dr.clip(end, -reach, reach)
            corners += [s * self.along_x + self.side * self.along_y * dr.sqrt(dr.maximum(squared - dr.square(s), 0))
                        for squared in (self.inner, self.outer)]
        return (dr.minimum(dr.minimum(*corners[:2]), dr.minimum(*corners[2:])),
                dr.maximum(dr.maximum(*corners[:2]), dr.maximum(*corners[2:])))

    def lines(self, begin: Float, length: Float) -> tuple[Float, Float]:
        """Return the least and largest y [m] of the ring, from the phase centre, in columns from x = `begin` on.

        Where a column misses the ring, the least y exceeds the largest.
        """
        end = begin + length
        farthest = dr.square(dr.maximum(abs(begin), abs(end)))
        nearest = dr.select(begin * end < 0, 0, dr.square(dr.minimum(abs(begin), abs(end))))
        low = dr.sqrt(dr.maximum(self.inner - farthest, 0))
        high = dr.select(self.outer > nearest, dr.sqrt(dr.maximum(self.outer - nearest, 0)), low - 1e3)
        starboard = self.side * self.along_x < 0
        return dr.select(starboard, low, -high), dr.select(starboard, high, -low)
