"""Back-projection of one ping: for every point of the beam, the sum of all receivers' signals at the point's delay.

    N(p) += Σ_r v_r w(u_r) R_t R_r 10^(α (R_t + R_r)/20) m_r(τ - (η - 1) f₀/k) e^(i2πf₀τ)
    D(p) += Σ_r v_r w(u_r) g(u_r)
    c₀ τ = R_t (1 + r_t) + R_r (1 + r_r),     u_r = (sine of the angle from abreast, out + back) / 2

m -> compressed signals, r -> residuals of `delays`, g -> the beams of the elements' lengths, at u from abreast of the
body; w -> the aperture's weights, tapered by u from abreast of the track, so that yaw does not move the aperture; v ->
the receivers' ``shares``. N/D 10^(-SL/20) is the image. The transmitter's place is that at the middle of the pulse,
where the frequency is the carrier. A receiver's place is that at the arrival of this middle, at τ, by iteration. Motion
compresses an echo in time by η, which shifts a sweep of rate k: its peak stands (η - 1) f₀/k too early.

For each point, everything is computed once for the receivers' centre, in float64. The path of a single receiver differs
by ΔR of `propagation.returns.moved_ends`, q = |a|² - 2 a·p, where a is its place from the centre and p the point, both
in body axes at reception. The residual follows a to first order, through the receiver's distance and depth.
"""
from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import drjit as dr
import numpy as np

from mitsonar.device.arrays import held, looped, upload
from mitsonar.device.types import ArrayTypes, Float, Float64, UInt32
from mitsonar.propagation.returns.line_difference import polynomial
from mitsonar.propagation.returns.moved_ends import further, moved_length
from mitsonar.signal.doppler import two_way_shift

from .delays import FocalPlane
from .grids import Grid
from .motion import Moving

TILE = 16                          # points along a tile's side
WEIGHTS = 1024                     # nodes of the weights over |u|
TOGETHER = 2                       # receivers per step of the loop
TINY = 1e-3                        # [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageAperture:
    """Range of angles that an image uses, and their weights."""

    widest: float  # largest |u| from abreast of the way
    taper: np.ndarray  # W at even steps of |u| from 0 to `widest`
    beam_reach: float  # largest |u| from abreast of the body
    beams: np.ndarray  # w/W and g w/W at even steps of it from 0 to `beam_reach`
    fall: float = 0.0  # g falls by fall δ² where the angles out and back are u -+ δ instead of u


@dataclass(frozen=True, kw_only=True, eq=False)
class Sender:
    """Transmitter at the middle of its pulse."""

    place: np.ndarray  # (3,) [m]
    velocity: np.ndarray  # (3,) [m/s]
    rotation: np.ndarray  # (3, 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageWater:
    """Sound speed, residuals and absorption of one ping."""

    sound_speed: float  # [m/s]
    sender: FocalPlane | None = None  # residuals at the transmitter's depth; None: straight rays
    receivers: FocalPlane | None = None  # residuals at the depth of the receivers' centre
    absorption_db: float = 0.0  # [dB/m]


class BackProjection:
    """Sums of an image, to which pings of one bank of receivers are added."""

    def __init__(self, lib: ArrayTypes, grid: Grid, aperture: ImageAperture, *, frequency: float,  # [Hz]
                 rate: float,                           # [Hz], of the compressed signals
                 first: float,                          # [s], their first sample
                 samples: int, coupling: float,         # [s], f₀/k of the module's equation
                 look: np.ndarray):                     # (3,), body frame
        self.lib, self.grid, self.aperture, self.look = lib, grid, aperture, np.asarray(look, float)
        self.frequency, self.rate, self.first = frequency, rate, first
        self.samples, self.coupling = samples, coupling
        rows, columns = grid.depth.shape
        self.tiles = -(-rows // TILE), -(-columns // TILE)
        self.along, self.ground = upload(lib.Float64, grid.along_track), upload(lib.Float64, grid.ground)
        self.depth = upload(lib.Float, grid.depth)
        self.taper, self.beams = upload(lib.Float, aperture.taper), upload(lib.Float, aperture.beams)
        self.real, self.imaginary, self.weight = (dr.zeros(lib.Float, rows * columns) for _ in range(3))
        self._centres, self._radius = self._tile_places()

    def _tile_places(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the centres (N, 3) of the tiles and the radii (N,) of spheres about their points."""
        grid, corners = self.grid, []
        for row_end, column_end in product((0, TILE - 1), repeat=2):
            rows = np.minimum(np.arange(self.tiles[0]) * TILE + row_end, len(grid.along_track) - 1)
            columns = np.minimum(np.arange(self.tiles[1]) * TILE + column_end, len(grid.ground) - 1)
            a, g = grid.along_track[rows][:, None], grid.ground[columns]
            corners.append(np.stack([grid.origin[0] + a * np.sin(grid.heading) + g * np.cos(grid.heading),
                                     grid.origin[1] + a * np.cos(grid.heading) - g * np.sin(grid.heading),
                                     grid.depth[np.ix_(rows, columns)]], -1).reshape(-1, 3))
        middle = np.mean(corners, 0)
        radius = np.max([np.linalg.norm(corner - middle, axis=-1) for corner in corners], 0)
        depths = [np.maximum.reduceat(np.maximum.reduceat(z, np.arange(self.tiles[0]) * TILE, 0),
                                      np.arange(self.tiles[1]) * TILE, 1).ravel() for z in (grid.depth, -grid.depth)]
        return middle, radius + np.maximum(depths[0] - middle[:, 2], depths[1] + middle[:, 2])

    def in_sight(self, sender: Sender, receivers: Moving, places: np.ndarray, ahead: np.ndarray,
                 sound_speed: float) -> np.ndarray:
        """Return the numbers of the tiles that the ping may reach: in the beam, abreast, and within the record."""
        away = self._centres - receivers.place
        distance = np.maximum(np.linalg.norm(away, axis=1), TINY)
        out = np.maximum(np.linalg.norm(self._centres - sender.place, axis=1), TINY)
        reach = np.linalg.norm(places, axis=1).max() + self._radius
        sine = 0.5 * np.abs(away @ ahead / distance + (self._centres - sender.place) @ ahead / out)
        beam = sine <= self.aperture.widest + reach / distance
        abreast = away @ (receivers.rotation @ self.look) > -2 * self._radius
        last = self.first + self.samples / self.rate
        # residuals of the straight line and the array's own extent are far below the margin
        margin = 0.05 * (distance + out) + 2 * reach + 1.0
        recorded = (distance + out + margin > self.first * sound_speed) & (distance + out - margin < last * sound_speed)
        return np.flatnonzero(beam & abreast & recorded).astype(np.uint32)

    def add(self, signals: np.ndarray, sender: Sender, receivers: Moving,
            places: np.ndarray,             # (rx, 3) [m], from the receivers' centre, body frame
            shares: np.ndarray,             # (rx,)
            ahead: np.ndarray,              # (3,), mean direction of the track
            water: ImageWater) -> None:
        """Add a ping's compressed signals (rx, sample) to the sums."""
        tiles = self.in_sight(sender, receivers, places, ahead, water.sound_speed)
        if not len(tiles):
            return
        lib = self.lib
        inside, pixel, point = self._points(tiles)
        ways = _PingWays(lib, point, sender, receivers, ahead, water, self)
        tilts = np.column_stack([places @ receivers.rotation[2], shares, places @ (ahead @ receivers.rotation),
                                 np.zeros(len(places))])
        elements = np.column_stack([places, (places ** 2).sum(1)])
        padding = -len(places) % TOGETHER          # receivers whose share is 0
        elements, tilts = (upload(lib.Float, np.pad(table, ((0, padding), (0, 0))).astype(np.float32))
                           for table in (elements, tilts))
        dr.sync_thread()           # the ping before may still run: at most one waits, however long the strip
        values = upload(lib.Float, signals.view(np.float32))
        real, imaginary, weight = self._summed(ways, values, elements, tilts, len(places), inside, water)
        for total, part in ((self.real, real), (self.imaginary, imaginary), (self.weight, weight)):
            dr.scatter(total, dr.gather(lib.Float, total, pixel, inside) + part, pixel, inside)
        dr.eval(self.real, self.imaginary, self.weight)

    def _points(self, tiles: np.ndarray) -> tuple[Any, UInt32, list[Float64]]:
        """Return a mask of the threads that have a point, the point's number, and its place: x, y, depth."""
        lib, (rows, columns) = self.lib, self.grid.depth.shape
        thread = dr.arange(lib.UInt32, len(tiles) * TILE * TILE)
        tile = dr.gather(lib.UInt32, upload(lib.UInt32, tiles), thread // (TILE * TILE))
        local = thread % (TILE * TILE)
        across = dr.opaque(lib.UInt32, self.tiles[1])
        row = tile // across * TILE + local // TILE
        column = tile % across * TILE + local % TILE
        height, width = dr.opaque(lib.UInt32, rows), dr.opaque(lib.UInt32, columns)
        inside = (row < height) & (column < width)
        pixel = row * width + column
        a = dr.gather(lib.Float64, self.along, row, inside)
        g = dr.gather(lib.Float64, self.ground, column, inside)
        s, c = (dr.opaque(lib.Float64, float(f(self.grid.heading))) for f in (np.sin, np.cos))
        x, y = (dr.opaque(lib.Float64, value) for value in self.grid.origin)
        z = lib.Float64(dr.gather(lib.Float, self.depth, pixel, inside))
        return inside, pixel, [x + a * s + g * c, y + a * c - g * s, z]

    def _summed(self, ways: _PingWays, values: Float, elements: Float, tilts: Float, count: int, inside: Any,
                water: ImageWater) -> tuple[Float, Float, Float]:
        """Return the sums over the receivers, for every thread."""
        lib = self.lib
        unit_step, stop = dr.opaque(lib.UInt32, 1), dr.opaque(lib.UInt32, count)
        steps = [dr.opaque(lib.UInt32, k) for k in range(TOGETHER + 1)]   # literals make iterations wait
        row, end = dr.opaque(lib.UInt32, self.samples), dr.opaque(lib.Float, float(self.samples - 1))
        per_metre = dr.opaque(lib.Float, self.rate / water.sound_speed)
        cycles = dr.opaque(lib.Float, self.frequency / water.sound_speed)
        to_taper = dr.opaque(lib.Float, (WEIGHTS - 1) / self.aperture.widest)
        to_beam = dr.opaque(lib.Float, (WEIGHTS - 1) / self.aperture.beam_reach)
        final = dr.opaque(lib.UInt32, count - 1)
        fall = dr.opaque(lib.Float, -self.aperture.fall)
        bent = water.receivers is not None
        bx, by, bz = (-2 * part for part in ways.body)

        def fallen(apart: Float) -> Float:
            return dr.maximum(dr.fma(apart * apart, fall, 1), 0.5)

        def add_receiver(n: UInt32, real: Float, imaginary: Float, weight: Float) -> tuple[Float, Float, Float]:
            a = dr.gather(lib.Array4f, elements, n)
            q = dr.fma(a[0], bx, dr.fma(a[1], by, dr.fma(a[2], bz, a[3])))
            slant = moved_length(q, ways.slant)
            later = further(q, ways.slant, slant) * ways.stretch
            tilt = dr.gather(lib.Array4f, tilts, n)
            if bent:
                bend = dr.fma(dr.fma(ways.by_depth_square, tilt[0], ways.by_depth), tilt[0], ways.by_square * q)
                later += bend
            place = dr.fma(later, per_metre, ways.fraction)
            whole = dr.floor(place)
            share = place - whole
            place = ways.whole + whole
            per_slant = 0.5 / slant
            back_sine = (ways.ahead - a[0]) * per_slant
            node = dr.fma(dr.abs(dr.fma(ways.way_ahead - tilt[2], per_slant, ways.way_half_sine)), to_taper, 0.5)
            in_beam = dr.fma(dr.abs(back_sine + ways.half_sine), to_beam, 0.5)
            on = (place >= 0) & (place < end) & (node < WEIGHTS) & (in_beam < WEIGHTS)
            at = dr.minimum(n, final) * row + lib.UInt32(held(place, 0, end))
            beam = dr.gather(lib.Array2f, self.beams, lib.UInt32(held(in_beam, 0, WEIGHTS - 1)), on)
            share_here = tilt[1] * dr.gather(lib.Float, self.taper, lib.UInt32(held(node, 0, WEIGHTS - 1)), on)
            first = dr.gather(lib.Array2f, values, at, on)
            second = dr.gather(lib.Array2f, values, at + unit_step, on)
            re, im = dr.lerp(first[0], second[0], share), dr.lerp(first[1], second[1], share)
            turn = dr.fma(later, cycles, ways.phase)
            s, c = _sine_cosine(turn)
            scale = share_here * beam[0] * slant
            return (dr.fma(scale, dr.fma(re, c, -im * s), real),
                    dr.fma(scale, dr.fma(re, s, im * c), imaginary),
                    dr.fma(beam[1] * fallen(back_sine - ways.half_sine), share_here, weight))

        def body(n: UInt32, *sums: Float) -> tuple:
            for k in range(TOGETHER):
                sums = add_receiver(n + steps[k], *sums)
            return (n + steps[-1], *sums)

        size = dr.width(ways.slant)
        zeros = [dr.zeros(lib.Float, size) for _ in range(3)]
        start = dr.zeros(lib.UInt32, size)
        _, real, imaginary, weight = looped((start, *zeros), lambda n, *_: (n < stop) & inside & ways.abreast, body)
        return real * ways.loss, imaginary * ways.loss, weight


def _sine_cosine(turns: Float) -> tuple[Float, Float]:
    """Return sine and cosine of turns, to 1e-6: Taylor series over a quarter of a turn, doubled twice."""
    angle = (turns - dr.round(turns)) * (0.5 * np.pi)
    square = angle * angle
    s = angle * dr.fma(square, dr.fma(square, dr.fma(square, -1 / 5040, 1 / 120), -1 / 6), 1)
    c = dr.fma(square, dr.fma(square, dr.fma(square, dr.fma(square, 1 / 40320, -1 / 720), 1 / 24), -0.5), 1)
    for _ in range(2):
        s, c = 2 * s * c, dr.fma(-2 * s, s, 1)
    return s, c


class _PingWays:
    """Path out to each thread's point, and path back to the receivers' centre."""

    def __init__(self, lib: ArrayTypes, point: list[Float64], sender: Sender, receivers: Moving, ahead: np.ndarray,
                 water: ImageWater, image: BackProjection):
        def number(value: float) -> Float:
            return dr.opaque(lib.Float, float(value))

        def exact(value: float) -> Float64:
            return dr.opaque(lib.Float64, float(value))

        out = [p - exact(s) for p, s in zip(point, sender.place, strict=True)]
        out_slant = dr.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
        out_axis = [lib.Float(value) for value in out]
        out_way = out_slant
        residual = None
        if water.sender is not None:
            residual = _Residual(lib, water.sender, out_axis, lib.Float(point[2]))
            out_way = out_slant * (1 + lib.Float64(residual.value))
        speed, middle = exact(water.sound_speed), exact(receivers.middle)
        per_half = exact(1 / receivers.half)
        powers = receivers.coefficients
        centre = [p - exact(c) for p, c in zip(point, receivers.place, strict=True)]

        def powered(time: Float, column: int) -> Float:
            return polynomial([number(power) for power in powers[:, column]], time)

        def when(way: Float64) -> Float:
            return dr.clip(lib.Float((way / speed - middle) * per_half), -1.05, 1.05)

        def back_at(time: Float) -> tuple[list[Float], list[Float64], Float64]:
            moved = [powered(time, k) for k in range(3)]
            back = [c - lib.Float64(m) for c, m in zip(centre, moved, strict=True)]
            return moved, back, dr.sqrt(back[0] * back[0] + back[1] * back[1] + back[2] * back[2])

        early = back_at(when(2 * out_way))[2]
        if residual is not None:
            early = early * (1 + lib.Float64(residual.value))
        time = when(out_way + early)
        moved, back, slant = back_at(time)
        self.slant = lib.Float(slant)
        axis = [lib.Float(value) for value in back]
        unit = [value / self.slant for value in axis]
        closing = sum(u * number(v / water.sound_speed) for u, v in zip(unit, receivers.velocity, strict=True))
        out_closing = sum(d * number(v / water.sound_speed) for d, v in zip(out_axis, sender.velocity, strict=True))
        out_near = lib.Float(out_slant)
        # a later arrival meets a receiver that has moved on: dτ = dR / (1 + closing)
        self.stretch = 1 / (1 + closing)
        way = slant
        self.by_square = self.by_depth = self.by_depth_square = number(0)
        if water.receivers is not None:
            bend = _Residual(lib, water.receivers, axis, lib.Float(point[2]))
            value = dr.fma(dr.fma(bend.by_square, moved[2], bend.by_depth), moved[2], bend.value)
            by_depth = dr.fma(2 * bend.by_square, moved[2], bend.by_depth)
            way = slant * (1 + lib.Float64(value))
            self.by_square = self.slant * bend.by_range / (2 * dr.maximum(bend.across, TINY)) * self.stretch
            self.by_depth = dr.fma(2 * axis[2], self.by_square, self.slant * by_depth * self.stretch)
            self.by_depth_square = self.slant * bend.by_square * self.stretch - self.by_square
            self.stretch *= 1 + value
        total = (out_way + way) / speed
        early = two_way_shift(out_closing / out_near, 1, closing) * number(image.coupling)
        place = (total - exact(image.first)) * exact(image.rate)
        whole = dr.floor(place)
        self.whole = dr.clip(lib.Float(whole), -1e6, 1e9)
        self.fraction = lib.Float(place - whole) - early * number(image.rate)
        turns = total * exact(image.frequency)
        self.phase = lib.Float(turns - dr.round(turns))
        turned = [powered(time, 3 + k) + number(receivers.rotation.ravel()[k]) for k in range(9)]
        self.body = [axis[0] * turned[k] + axis[1] * turned[3 + k] + axis[2] * turned[6 + k] for k in range(3)]
        self.ahead = self.body[0]
        forward = sender.rotation[:, 0]
        way = [number(value) for value in ahead]
        self.way_ahead = sum(b * w for b, w in zip(axis, way, strict=True))
        self.way_half_sine = 0.5 * sum(d * w for d, w in zip(out_axis, way, strict=True)) / out_near
        self.half_sine = 0.5 * sum(d * number(f) for d, f in zip(out_axis, forward, strict=True)) / out_near
        self.abreast = sum(b * number(f) for b, f in zip(self.body, image.look, strict=True)) > 0
        self.loss = out_near * dr.exp2((out_near + self.slant) * number(water.absorption_db / 20 * np.log2(10)))


class _Residual:
    """Residual of the straight line, read from a plane: value, slope over the distance, derivatives over the depth."""

    def __init__(self, lib: ArrayTypes, plane: FocalPlane, axis: list[Float], depth: Float):
        rows, columns = plane.values.shape[:2]
        self.across = dr.sqrt(axis[0] * axis[0] + axis[1] * axis[1])
        values = upload(lib.Float, plane.values)
        step = dr.opaque(lib.Float, plane.range[1])
        x = (self.across - dr.opaque(lib.Float, plane.range[0])) / step
        y = (depth - dr.opaque(lib.Float, plane.depth[0])) / dr.opaque(lib.Float, plane.depth[1])
        x = held(x, 0, dr.opaque(lib.Float, columns - 1.001))
        y = held(y, 0, dr.opaque(lib.Float, rows - 1.001))
        column, row = lib.UInt32(x), lib.UInt32(y)
        x, y = x - lib.Float(column), y - lib.Float(row)
        width = dr.opaque(lib.UInt32, columns)
        at = row * width + column
        a, b, c, d = (dr.gather(lib.Array4f, values, at + k) for k in (0, 1, width, width + 1))
        near, far = dr.lerp(a[0], c[0], y), dr.lerp(b[0], d[0], y)
        self.value = dr.lerp(near, far, x)
        self.by_range = (far - near) / step
        self.by_depth, self.by_square = (dr.lerp(dr.lerp(a[k], c[k], y), dr.lerp(b[k], d[k], y), x) for k in (1, 2))
