"""Speckle of a sidescan: the sum over the ground's scatterers in each resolution cell.

    g(row, j) = Σ_c w_c a_c e^(-i2πf τ_c) / √(Σ_c |w_c|²),      t_j <= τ_c < t_j + Δt,     w_c = b(u_c) √(σ_c A / m_c)

for a side of a ping (row) and the gate j that begins at t_j: unit variance, circular Gaussian if no bed has glints.
Scatterers c and their amplitudes a_c are those of all sonars (`echoes.scatterers.nested_points`), as dense as in the
beam domain: a facet of the area A has

    m = q A |n·(l × x)| / (ΔR R ψ)

of them, n its normal, l the unit vector of the way there, x the body's axis, R the distance, ΔR the length of a gate in
slant range, ψ the equivalent two-way width of the beam along the platform there, q -> 1.4 ``per_cell``. τ_c is the time
along the bent ray, out from the transmission and back to the place at the reception. u_c is the cosine of the direction
along the platform, half-way between both attitudes, and b the complex two-way pressure of both faces there
(`side_beam`). σ_c ~ (n·l)²: how strong the facets of one gate are against each other. The level of a gate, with
materials and shadows, is that of the rays' energies, which g multiplies.

Gates share no scatterers, so their values are independent. Pings share the scatterers that lie in the gate for both.
Hence

    <g(p) g*(q)> = ∫ a(x) a*(x - Δ) exp(2ik δ x) dx / ∫ |a|² dx

for phase centres Δ apart along the platform and a yaw of δ: the autocorrelation of the two-way aperture a (the theorem
of Van Cittert and Zernike; e.g. Goodman 2007, Speckle phenomena in optics, ch. 4). Faces that are not steady share less
(`jitter`).

Gates without ground have scatterers of the water (`water_speckle`).

Scatterers are found from coarse to fine: blocks of facets, facets, and the triangles of large facets that the main lobe
meets. Sums are integers, so they depend neither on the order of additions nor on the number of threads.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, give_back_memory, held, looped, upload
from mitsonar.device.chance import scrambled
from mitsonar.device.rotations import rotated
from mitsonar.device.types import UInt32
from mitsonar.echoes.scatterers.nested_points import LEVELS, MOST_OF_A_FACET, exists, place_of, triangle_of
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.echoes.scatterers.thinned_scatterers import ACROSS
from mitsonar.echoes.sights.eigenray_table import EigenrayTable
from mitsonar.echoes.sums.energy_sums import sum_size
from mitsonar.propagation.returns.moved_ends import detour
from mitsonar.scene.tracing.connection import Connector
from mitsonar.signal.gates import speckle_gates

from ..energy.sidescan_survey import SidescanSurvey
from ..motion.places import PingPoses
from ..motion.underway import PingMotion, Underway
from ..survey import PerSurroundings
from .jitter import STEADY, Jitter
from .side_beam import NEAREST, GateBeam, main_lobe
from .water_speckle import WaterCells

BLOCK = 64                         # facets that are tested together
MANY = 1 << 12                     # blocks of facets
TESTED = 1 << 23                   # blocks of facets tested at a time
THREADS_OWN = 1 << 20              # words of sums of which each thread has a copy; with more of them, sums are slower
FEW = 2.0                          # scatterers of a triangle that is not cut further
LEVEL_SEEN = 0.01                  # least |n·(l × x)| in the weight of a scatterer
SCALE = float(1 << 20)             # units of the integer sums


@dataclass(frozen=True, kw_only=True)
class Triangles:
    """Triangles of facets that a ping may receive echoes of, on the device."""

    ping: mi.UInt32  # (R,): number in the block
    facet: mi.UInt32  # (R,)
    first: mi.UInt32  # (R,): number of the first scatterer
    level: mi.UInt32  # (R,)
    most: mi.Float  # (R,): scatterers, at most

    def chosen(self, index: mi.UInt32) -> Triangles:
        """Return the triangles at an index."""
        return Triangles(**{name: dr.gather(type(value), value, index) for name, value in vars(self).items()})

    def quarters(self) -> Triangles:
        """Return the four quarters of each triangle."""
        thread = dr.arange(mi.UInt32, 4 * dr.width(self.facet))
        whole = self.chosen(thread >> 2)
        return Triangles(ping=whole.ping, facet=whole.facet, level=whole.level + 1, most=whole.most,
                         first=whole.first + ((thread & 3) << (2 * whole.level)))


def speckle_of(survey: SidescanSurvey, jitter: Jitter = STEADY,
               seed: int = 0) -> Callable[[np.ndarray, int], np.ndarray]:
    """Return a function that returns the speckle of pings (B,), see `SideSpeckle.of`; `seed` draws the jitter."""
    around = PerSurroundings(survey, lambda part: SideSpeckle(part, jitter, seed))

    def speckle(ping: np.ndarray, steps: int) -> np.ndarray:
        changes = np.flatnonzero(np.diff([survey.surroundings_of(number) for number in ping])) + 1
        return np.concatenate([around.at(part[0]).of(part, steps) for part in np.split(ping, changes)])

    return speckle


class SideSpeckle:
    """Speckle of pings that share their surroundings."""

    def __init__(self, survey: SidescanSurvey, jitter: Jitter = STEADY, seed: int = 0):
        sonar, (start, end) = survey.sonar, survey.window
        self._lib, self._survey = arrays_of(mi.Float), survey
        self._jitter, self._seed = jitter, seed
        self.gates = survey.bins * speckle_gates(survey.bin_length, sonar.pulse_length)
        gate, to_range = (end - start) / self.gates, 0.5 * sonar.sound_speed
        self._beam = GateBeam(main_lobe(sonar, to_range * end),
                              to_range * (start + (np.arange(self.gates) + 0.5) * gate),
                              per_width=ACROSS * survey.per_cell / (to_range * gate))
        self._start, self._per_gate = (dr.opaque(mi.Float64, value) for value in (start, 1 / gate))
        self._count, self._speed = dr.opaque(mi.UInt32, self.gates), dr.opaque(mi.Float, sonar.sound_speed)
        self._underway = Underway.of(survey, end)
        reach, (geometry, water) = 0.5 * end * survey.waters.fastest, survey.surroundings
        self._facets = Scatterers(geometry, np.inf, survey.pass_number, survey.world.seed)
        self._table = EigenrayTable(Connector(geometry, water),
                                    depth=survey.planned_depth, farthest=reach)
        # cycles, seconds and gates per metre of the way out and back
        speed, self._bends = self._table.sound_speed, bool(np.ptp(water.profile.sound_speed))
        self._per_metre, self._seconds = (dr.opaque(mi.Float64, value)
                                          for value in (sonar.frequency / speed, 1 / speed))
        self._cycles_per_metre, self._gates_per_metre, self._gates = (dr.opaque(mi.Float, value) for value in (
            sonar.frequency / speed, 1 / (speed * gate), self.gates))
        # across a ball, the axis turns and the sonar moves by this share of its radius
        drift = self._underway.drift(sonar.sound_speed)
        self._drift, self._end = drift, end
        self._near, self._far = (dr.opaque(mi.Float, value) for value in (
            0.5 * start * survey.waters.slowest * (1 - drift), reach * (1 + drift)))
        self._water = WaterCells(survey)
        self._sort(reach * (1 + 3 * drift))
        self._facets.forget_measures()
        if self._blocks > MANY:
            give_back_memory()          # as much again as is kept

    def _sort(self, farthest: float) -> None:
        """Sort the facets that scatter within `farthest` [m] of the track into blocks of neighbours, each in a ball."""
        facets = self._facets
        reached = facets.scattering
        if self._survey.passage.stepping is None:
            reached = facets.near(self._survey.track.position, farthest)
        number = np.flatnonzero(reached).astype(np.uint32)
        number = number[np.argsort(_along_a_curve(facets.centre[number]), kind="stable")]
        moving = facets.moving[number]
        number = np.concatenate([number[~moving], number[moving]])     # those that move have blocks of their own
        ball, blocks = self._balls(number)
        self._last = number[(len(number) - int(moving.sum())) // BLOCK * BLOCK:] if moving.any() else number[:0]
        self._blocks, self._facet_count = len(blocks), dr.opaque(mi.UInt32, len(number))
        self._block, self._ball, self._number = (upload(mi.Float, blocks), upload(mi.Float, ball),
                                                 upload(mi.UInt32, number))
        dr.eval(self._block, self._ball, self._number)
        facets.geometry.follow(self._moved)

    def _balls(self, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return middles and radii [m] of the balls around facets (F,), and around each block of them."""
        facets = self._facets
        ball = np.empty((len(number), 4), np.float32)
        ball[:, :3], ball[:, 3] = facets.centre[number], facets.radius[number]
        starts = np.arange(0, len(number), BLOCK)
        blocks = np.zeros((len(starts), 4), np.float32)
        if len(starts):
            low, high = (np.stack([least.reduceat(ball[:, axis] + sign * ball[:, 3], starts) for axis in range(3)], 1)
                         for least, sign in ((np.minimum, -1), (np.maximum, 1)))
            blocks[:, :3], blocks[:, 3] = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
        return ball, blocks

    def _moved(self) -> None:
        """Move the balls of moving facets, which are the last ones."""
        if len(self._last):
            for table, rows in zip((self._ball, self._block), self._balls(self._last)):
                first = dr.width(table) - rows.size
                dr.scatter(table, upload(mi.Float, rows), first + dr.arange(mi.UInt32, rows.size))
            dr.eval(self._ball, self._block)

    def of(self, ping: np.ndarray, steps: int = 1) -> np.ndarray:
        """Return the speckle of pings (B,) as complex64 (B, 2, gates, steps): port, starboard.

        The first step is the speckle of the gates, the others that of gates which begin later, in steps of a gate.
        """
        most = max(1, min(TESTED // max(self._blocks, 1), THREADS_OWN // (8 * self.gates * steps)))
        return np.concatenate([self._of(ping[first:first + most], steps) for first in range(0, len(ping), most)])

    def _of(self, ping: np.ndarray, steps: int) -> np.ndarray:
        """Return the speckle of a block of pings."""
        track, rows = self._survey.track, 2 * len(ping)
        rotation = self._jitter.turned(track.rotation()[ping], ping, self._seed)
        poses, motion = PingPoses(track.position[ping], rotation), self._underway.motion(ping)
        turned = self._underway.largest_turn
        if self._survey.passage.latest is not None:
            turned = max(turned, self._survey.turn_rate * self._end)
        self._slack = dr.opaque(mi.Float, 1 + self._drift + turned)
        sums = dr.zeros(mi.UInt32, sum_size(4 * rows * self.gates * steps))
        for triangles in self._met(poses, motion, len(ping)):
            self._add(sums, poses, motion, triangles, dr.opaque(mi.UInt32, steps))
        dr.eval(sums)
        thread = dr.arange(mi.UInt32, rows * self.gates)
        dr.eval(thread)
        speckle = np.empty((len(ping), 2, self.gates, steps), np.complex64)
        for step in range(steps):
            later = dr.opaque(mi.UInt32, step)
            parts = self._in_gates(sums, thread, later, steps)
            real, imaginary = self._water.added(ping, poses, self._beam, thread, self._count, parts, later)
            dr.eval(real, imaginary)
            speckle[..., step] = (real.numpy() + np.complex64(1j) * imaginary.numpy()).reshape(speckle.shape[:3])
        return self._jitter.mixed(speckle, ping, self._seed)

    def _in_gates(self, sums: mi.UInt32, thread: mi.UInt32, later: mi.UInt32,
                  steps: int) -> tuple[mi.Float, mi.Float, mi.Float]:
        """Return Σ w a e and Σ |w|² of gates that begin by so many steps `later`, from the sums of the steps."""
        last = thread % self._count + 1 == self._count
        words = dr.zeros(self._lib.Array4u, dr.width(thread))
        for part in range(steps):
            words += dr.gather(self._lib.Array4u, sums, thread * steps + later + part, ~last | (later + part < steps))
        return (mi.Float(mi.Int32(words.x)) / SCALE, mi.Float(mi.Int32(words.y)) / SCALE, mi.Float(words.z) / SCALE)

    # ---- the ground that the main lobe meets

    def _met(self, poses: PingPoses, motion: PingMotion | None, pings: int) -> Iterator[Triangles]:
        """Yield the triangles that the lobes of pings meet, from coarse to fine."""
        if not self._blocks:
            return
        thread, count = dr.arange(mi.UInt32, pings * self._blocks), dr.opaque(mi.UInt32, self._blocks)
        ping = thread // count
        block = thread - ping * count
        index = compressed(self._meets(poses, motion, ping, *self._in_ball(self._block, block, mi.Bool(True)))[0])
        if not dr.width(index):
            return
        ping, block = dr.gather(mi.UInt32, ping, index), dr.gather(mi.UInt32, block, index)
        thread = dr.arange(mi.UInt32, BLOCK * dr.width(index))
        ping = dr.gather(mi.UInt32, ping, thread // BLOCK)
        number = dr.gather(mi.UInt32, block, thread // BLOCK) * BLOCK + thread % BLOCK
        exists = number < self._facet_count
        index = compressed(exists & self._meets(poses, motion, ping, *self._in_ball(self._ball, number, exists))[0])
        if not dr.width(index):
            return
        ping = dr.gather(mi.UInt32, ping, index)
        facet = dr.gather(mi.UInt32, self._number, dr.gather(mi.UInt32, number, index))
        # arrays, not numbers, and evaluated: all rounds, and the sums of their triangles, have the same kernels
        first, level = (dr.opaque(mi.UInt32, 0, dr.width(index)) for _ in range(2))
        todo = Triangles(ping=ping, facet=facet, first=first, level=level,
                         most=dr.opaque(mi.Float, np.inf, dr.width(index)))
        while dr.width(todo.facet):
            dr.eval(vars(todo))
            met, fine, most = self._sized(poses, motion, todo)
            todo = Triangles(ping=todo.ping, facet=todo.facet, first=todo.first, level=todo.level, most=most)
            dr.eval(met, fine, vars(todo))
            done, rest = compressed(met & fine), compressed(met & ~fine)
            if dr.width(done):
                yield todo.chosen(done)
            if not dr.width(rest):
                break
            todo = todo.chosen(rest).quarters()

    def _in_ball(self, table: mi.Float, number: mi.UInt32, active: mi.Bool) -> tuple[dr.ArrayBase, mi.Float]:
        """Return the middles and radii [m] of the balls of blocks or facets."""
        row = dr.gather(self._lib.Array4f, table, number, active)
        return self._lib.Array3f64(row[0], row[1], row[2]), row[3]

    def _half_way(self, poses: PingPoses, motion: PingMotion | None, ping: mi.UInt32,
                  point: dr.ArrayBase) -> tuple[dr.ArrayBase, mi.Vector3f, mi.Float]:
        """Return the offsets [m] of points from the sonar half-way between transmission and reception, and its axis.

        The third is what both ways together are longer [m] than twice the offset.
        """
        offset, axis = point - poses.origin(ping), poses.axis(ping)
        if motion is None:
            return offset, axis, mi.Float(0)
        time = mi.Float(dr.norm(offset)) * (2 / self._speed)
        moved, turned = motion.moved(ping, time), motion.turned(ping, time)
        offset -= self._lib.Array3f64(0.5 * moved)
        distance = dr.maximum(mi.Float(dr.norm(offset)), NEAREST)
        across = dr.squared_norm(moved) - dr.square(dr.dot(mi.Vector3f(offset), moved) / distance)
        return offset, mi.Vector3f(*rotated(list(axis), list(0.5 * turned))), across / (4 * distance)

    def _meets(self, poses: PingPoses, motion: PingMotion | None, ping: mi.UInt32, centre: dr.ArrayBase,
               radius: mi.Float) -> tuple[mi.Bool, mi.Float, mi.Vector3f, mi.Float]:
        """Return True for balls that the lobe may meet; their shortest distance, offsets [m], and edges of the lobe."""
        offset, axis, _ = self._half_way(poses, motion, ping, centre)
        offset = mi.Vector3f(offset)
        distance = dr.norm(offset)
        nearest = dr.maximum(distance - radius, 0)
        edge = self._beam.edge(self._gate(nearest))
        aside = abs(dr.dot(offset, axis)) - radius * self._slack
        return ((aside < edge * (distance + radius)) & (distance - radius < self._far)
                & (distance + radius > self._near), nearest, offset, edge)

    def _gate(self, distance: mi.Float) -> mi.UInt32:
        """Return the gates of echoes from distances [m], about, or the first or last one."""
        place = (2 * distance / self._speed - mi.Float(self._start)) * mi.Float(self._per_gate)
        return mi.UInt32(held(place, 0, self._gates - 1))

    def _sized(self, poses: PingPoses, motion: PingMotion | None,
               triangles: Triangles) -> tuple[mi.Bool, mi.Bool, mi.Float]:
        """Return True for triangles that the lobe may meet, and that need no cut; and their greatest numbers."""
        facets, lib = self._facets, self._lib
        a, b, c, _ = facets.device_corners(triangles.facet)
        seed = facets.seed_of(facets.facts(triangles.facet)[2])
        u, v, side = triangle_of(scrambled(triangles.first, seed), triangles.level)
        e, f = mi.Vector3f(b - a), mi.Vector3f(c - a)
        middle = a + (b - a) * lib.Float64(u + side / 3) + (c - a) * lib.Float64(v + side / 3)
        radius = abs(side) * dr.sqrt(dr.maximum(dr.maximum(dr.squared_norm(e + f), dr.squared_norm(2 * e - f)),
                                                dr.squared_norm(2 * f - e))) / 3
        met, nearest, offset, edge = self._meets(poses, motion, triangles.ping, middle, radius)
        cross = dr.cross(e, f)
        twice = dr.norm(cross)
        normal, distance = cross / dr.maximum(twice, 1e-30), dr.norm(offset)
        least = dr.maximum(dr.maximum(nearest, abs(dr.dot(offset, normal))), NEAREST)
        seen = abs(dr.dot(normal, dr.cross(offset, poses.axis(triangles.ping)))) / dr.maximum(distance, NEAREST)
        density = self._beam.density(self._gate(distance + 2 * radius))          # rises with the distance, if at all
        most = dr.minimum(density * 0.5 * twice * dr.minimum(seen + 2 * radius / least, 1) / least, MOST_OF_A_FACET)
        parts = mi.Float(mi.UInt32(1) << (2 * triangles.level))
        most = (most - facets.threshold_of(triangles.facet) - mi.Float(triangles.first)) / parts
        fine = (most < FEW) | (radius < 0.5 * edge * distance) | (triangles.level >= LEVELS - 1)
        return met & (most > 0), fine, most

    # ---- its scatterers

    def _add(self, sums: mi.UInt32, poses: PingPoses, motion: PingMotion | None, triangles: Triangles,
             steps: mi.UInt32) -> None:
        """Add the scatterers of triangles to the sums of the steps of their gates.

        What is long is computed once for the middle of a triangle, in double precision: the scatterers' ways differ
        from it by small numbers.
        """
        lib, facets, ping = self._lib, self._facets, triangles.ping
        a, b, c, _ = facets.device_corners(triangles.facet)
        facts, threshold = facets.facts(triangles.facet), facets.threshold_of(triangles.facet)
        seed, key = facets.seed_of(facts[2]), facets.amplitude_key(facts[2])
        middle_u, middle_v, side = triangle_of(scrambled(triangles.first, seed), triangles.level)
        middle_u, middle_v = middle_u + side / 3, middle_v + side / 3
        e, f = mi.Vector3f(b - a), mi.Vector3f(c - a)
        cross = dr.cross(e, f)
        twice = dr.norm(cross)
        normal = cross / dr.maximum(twice, 1e-30)
        middle = a + (b - a) * lib.Float64(middle_u) + (c - a) * lib.Float64(middle_v)
        near, glints = mi.Point3f(middle), facets.glints_of(facts[0]) if facets.glinting else None
        offset, axis, wider = self._half_way(poses, motion, ping, middle)
        far = dr.maximum(dr.norm(offset), NEAREST)
        cycles = 2 * far * self._per_metre
        cycles = mi.Float(cycles - dr.floor(cycles))
        place = mi.Float((2 * far * self._seconds - self._start) * self._per_gate)
        offset, far, across = mi.Vector3f(offset), mi.Float(far), dr.cross(axis, normal)
        towards = offset / far
        starboard = poses.body(ping, offset).y > 0
        row = (2 * ping + dr.select(starboard, mi.UInt32(1), 0)) * self._count * steps
        gate = mi.UInt32(held(place, 0, self._gates - 1))
        lobe, density = self._beam.lobe(gate), self._beam.density(gate) * 0.5 * twice

        def step(j: UInt32, count: UInt32) -> tuple[UInt32, UInt32]:
            k = triangles.first + (j << (2 * triangles.level))
            u, v = place_of(k, seed)
            way, distance, longer = detour(towards, far, (middle_u - u) * e + (middle_v - v) * f)
            per_metre = dr.rcp(distance)
            if self._bends:
                level = dr.sqrt(dr.square(way.x) + dr.square(way.y))
                longer += distance * self._table.lateness(level, way.z)
            longer = 2 * longer + wider
            seen = abs(dr.dot(way, across)) * per_metre
            gate = place + longer * self._gates_per_metre
            m = dr.minimum(density * seen * per_metre, MOST_OF_A_FACET)
            inside = exists(k, threshold, m) & (gate >= 0) & (gate < self._gates)
            gate = mi.UInt32(dr.select(inside, gate * mi.Float(steps), 0))
            b_real, b_imaginary = self._beam.pressure(lobe, dr.dot(way, axis) * per_metre, inside)
            weight = SCALE * abs(dr.dot(way, normal)) * per_metre * dr.rsqrt(dr.maximum(seen, LEVEL_SEEN))
            # the phase falls with the time
            turns = cycles + longer * self._cycles_per_metre
            real, imaginary = facets.amplitude(triangles.facet, key, k, u, v, (dr.floor(turns) - turns) * (2 * np.pi))
            if glints is not None:
                there = near + (u - middle_u) * e + (v - middle_v) * f
                root = facets.root_of_glints(glints, there, 0.5 * twice / dr.maximum(m, 1e-30))
                real, imaginary = real * root, imaginary * root
            power = dr.square(b_real) + dr.square(b_imaginary)
            words = (weight * (real * b_real - imaginary * b_imaginary),
                     weight * (real * b_imaginary + imaginary * b_real), dr.square(weight) * power / SCALE, mi.Float(0))
            dr.scatter_add(sums, lib.ArrayXu([mi.UInt32(mi.Int32(value)) for value in words]), row + gate,
                           inside & (power > 0))
            return j + 1, count

        looped((mi.UInt32(0), mi.UInt32(dr.ceil(triangles.most))), lambda j, count: j < count, step,
               "scatterers of a triangle")


def _along_a_curve(place: np.ndarray) -> np.ndarray:
    """Return numbers (N,), uint32, that sort places (N, 3) along a curve of short steps (Morton 1966)."""
    columns = [column - column.min(initial=np.inf) for column in place.T]
    size = max(max(float(column.max(initial=0)) for column in columns), 1e-9)
    number = np.zeros(len(place), np.uint32)
    for axis, column in enumerate(columns):
        bits = (column * (1023 / size)).astype(np.uint32)
        for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
            bits = (bits | (bits << np.uint32(shift))) & np.uint32(mask)
        number |= bits << np.uint32(axis)
    return number
