"""Make the meshes and the survey that the scenes name, the same bytes every time.

    python3 scenes/make_targets.py [FOLDER]

Writes meshes/*.ply, targets/*.ply, bathymetry/sandwaves.tif and textures/*.pfm, by default beside this script. Every
mesh stands on the seabed z = 0, metres, z up, its bow or front to the north (+y). In meshes/, what lies below z = 0 is
buried; those in targets/ are whole, to be strewn by the shape `targets`. All surfaces are closed and look outwards.
Scenes should load them with face_normals = true: these are plates, not smooth bodies.
"""
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent


# ---- building blocks: lists of (vertices (V, 3), faces (F, 3)) ---------------------------------------------------


def loft(rings, ends=True, around=False):
    """Skin closed rings of points (S, N, 3); close the ends, or join the last ring to the first."""
    rings = np.asarray(rings, float)
    count, points = rings.shape[:2]
    steps = count if around else count - 1
    s, n = np.meshgrid(np.arange(steps), np.arange(points), indexing="ij")
    here, right = s * points + n, s * points + (n + 1) % points
    above, across = (s + 1) % count * points + n, (s + 1) % count * points + (n + 1) % points
    faces = np.stack((here, right, across, here, across, above), axis=-1).reshape(-1, 3)
    vertices = rings.reshape(-1, 3)
    if ends and not around:
        middles = vertices.shape[0] + np.arange(2)
        ring = np.arange(points)
        first = np.stack((np.full(points, middles[0]), (ring + 1) % points, ring), axis=-1)
        last = np.stack((np.full(points, middles[1]), ring, (ring + 1) % points), axis=-1) \
            + (count - 1) * points * np.array([0, 1, 1])
        vertices = np.concatenate((vertices, rings[:1].mean(axis=1), rings[-1:].mean(axis=1)))
        faces = np.concatenate((faces, first, last))
    return outwards(vertices, faces)


def outwards(vertices, faces):
    """Turn the faces of a closed surface so that it holds a positive volume."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return vertices, faces if np.einsum("ij,ij->", a, np.cross(b, c)) > 0 else faces[:, ::-1]


def box(size, centre):
    """Make a box of ``size`` (x, y, z) about ``centre``."""
    x, y, z = np.array(size) / 2
    square = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
    return loft([square + (0, 0, -z) + centre, square + (0, 0, z) + centre])


def plate(size, generator, corners=10):
    """Make a broken plate of about ``size`` (x, y, z) about the origin: ragged in outline, and a little bent."""
    x, y, z = np.array(size) / 2
    turn = 2 * np.pi * (np.arange(corners) + generator.uniform(0.1, 0.9, corners)) / corners
    way = np.column_stack((np.cos(turn), np.sin(turn)))
    outline = way / np.abs(way).max(axis=1, keepdims=True) * generator.uniform(0.6, 1.0, (corners, 1)) * (x, y)
    bend = generator.uniform(-1.5, 1.5) * z * (outline[:, 1] / y) ** 2
    return loft([np.column_stack((outline, bend + side * z)) for side in (-1, 1)])


def tube(start, end, radius, sides=12):
    """Make a round bar between two points; ``radius`` at start and end may differ."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    radius = np.broadcast_to(radius, 2)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(along, [1.0, 0, 0] if abs(along[0]) < 0.9 else [0, 1.0, 0])
    across /= np.linalg.norm(across)
    angle = 2 * np.pi * np.arange(sides)[:, None] / sides
    circle = np.cos(angle) * across + np.sin(angle) * np.cross(along, across)
    return loft([start + radius[0] * circle, end + radius[1] * circle])


def moved(part, roll=0.0, pitch=0.0, turn=0.0, by=(0, 0, 0)):
    """Turn a part by degrees about y (roll), x (pitch) and z, then shift it."""
    vertices, faces = part
    for degrees, (i, j) in ((roll, (2, 0)), (pitch, (1, 2)), (turn, (0, 1))):
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        vertices = vertices.copy()
        vertices[:, [i, j]] = vertices[:, [i, j]] @ [[c, s], [-s, c]]
    return vertices + by, faces


def join(parts):
    """Put parts into one mesh."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    return (np.concatenate([vertices for vertices, _ in parts]),
            np.concatenate([faces + start for (_, faces), start in zip(parts, starts)]))


# ---- targets -----------------------------------------------------------------------------------------------------


def truncated_cone():
    """A bottom mine: 1.0 m across at the base, 0.5 m at the top, 0.45 m high, 2 cm in the mud."""
    return tube((0, 0, -0.02), (0, 0, 0.43), (0.5, 0.25), sides=64)


def tyre():
    """A lorry tyre lying flat: 1.0 m across, 0.28 m wide, a third buried."""
    turn, section = 2 * np.pi * np.arange(48) / 48, 2 * np.pi * np.arange(16) / 16
    radius = 0.38 + 0.12 * np.cos(section)
    height = 0.05 + 0.14 * np.sign(np.sin(section)) * np.abs(np.sin(section)) ** 0.6
    return loft(np.stack((np.cos(turn)[:, None] * radius, np.sin(turn)[:, None] * radius,
                          np.broadcast_to(height, (48, 16))), axis=-1), around=True)


def boulder():
    """A boulder of about 1.6 x 1.3 x 1.0 m, a quarter buried."""
    lift = np.pi * (np.arange(1, 24) / 24 - 0.5)
    turn = 2 * np.pi * np.arange(40) / 40
    way = np.stack((np.cos(lift)[:, None] * np.cos(turn), np.cos(lift)[:, None] * np.sin(turn),
                    np.broadcast_to(np.sin(lift)[:, None], (23, 40))), axis=-1)
    generator = np.random.default_rng(7)
    bumps = sum(size * np.sin(way @ generator.normal(0, wave, 3) + generator.uniform(0, 2 * np.pi))
                for size, wave in ((0.12, 2), (0.08, 4), (0.05, 6), (0.03, 10), (0.02, 16)))
    return loft(way * (1 + bumps)[..., None] * (0.8, 0.65, 0.5) + (0, 0, 0.25))


LENGTH, BEAM, DEPTH = 30.0, 7.0, 3.6  # [m] of the ship: between bow and stern, across, keel to deck


def hull(from_y, to_y, stations=28):
    """Make the hull between two distances from midships, the end nearer to midships torn."""
    y = np.linspace(from_y, to_y, stations)
    along = 2 * y / LENGTH
    half_beam = BEAM / 2 * np.where(along > 0, 1 - np.abs(along) ** 2.2, 1 - 0.75 * np.abs(along) ** 5) + 0.03
    sheer = DEPTH + np.where(along > 0, 1.4, 0.7) * along**2
    rise = 2.2 * np.clip(along - 0.6, 0, None) + 1.8 * np.clip(-along - 0.75, 0, None)  # keel towards the ends
    girth = np.linspace(-1, 1, 21)
    side = np.sign(girth) * np.abs(girth) ** 0.6  # from gunwale to gunwale under the keel, full in the bilge
    height = np.abs(girth) ** 3.0
    outline = np.stack((half_beam[:, None] * side, np.repeat(y[:, None], 21, axis=1),
                        rise[:, None] + (sheer - rise)[:, None] * height), axis=-1)
    deck = np.linspace(0.8, -0.8, 7)                               # back over a cambered deck
    lid = np.stack((half_beam[:, None] * deck, np.repeat(y[:, None], 7, axis=1),
                    np.repeat(sheer[:, None], 7, axis=1) + 0.15 * (1 - deck**2) - 0.05), axis=-1)
    rings = np.concatenate((outline, lid), axis=1)
    torn = rings[0] if abs(from_y) < abs(to_y) else rings[-1]
    ring = np.arange(len(torn))
    torn[:, 1] += np.sign(-y.mean()) * (0.5 * np.sin(2.4 * ring) + 0.35 * np.sin(5.1 * ring + 1))
    return loft(rings)


def wreck():
    """A coaster of 30 m, broken midships, a metre in the seabed, the stern fallen to port."""
    bow = [hull(0.8, 15.0),
           box((3.4, 4.4, 0.6), (0, 4.2, DEPTH + 0.35)),                        # hatch coaming
           box((2.0, 2.2, 1.2), (0, 10.3, DEPTH + 1.0)),                        # forecastle
           tube((0, 7.6, DEPTH), (1.6, 8.6, DEPTH + 6.5), (0.18, 0.09)),        # mast
           tube((0.1, 7.6, DEPTH + 1.2), (-0.6, 2.6, DEPTH + 2.6), (0.1, 0.06)),  # derrick
           tube((0, 12.4, DEPTH + 0.8), (0, 12.4, DEPTH + 1.8), 0.25)]          # windlass
    stern = [hull(-15.0, -1.2),
             box((4.6, 5.0, 2.3), (0, -9.8, DEPTH + 1.2)),                      # deckhouse
             box((3.6, 2.6, 2.0), (0, -8.6, DEPTH + 3.3)),                      # bridge
             tube((0, -11.2, DEPTH + 2.0), (0, -11.6, DEPTH + 4.6), (0.75, 0.65), sides=20),  # funnel
             box((2.6, 2.8, 0.5), (0, -4.2, DEPTH + 0.35)),                     # after hatch
             *(tube((x, -14.2 + 0.2 * abs(x), DEPTH + 0.4), (x, -14.2 + 0.2 * abs(x), DEPTH + 1.6), 0.06, sides=6)
               for x in (-1.5, -0.5, 0.5, 1.5))]                                # rail
    bow = moved(join(bow), roll=8, pitch=-2, by=(0, 0.5, -1.0))
    stern = moved(join(stern), roll=-24, pitch=3, turn=9, by=(-0.6, -1.6, -0.9))
    generator, breaks = np.random.default_rng(11), np.random.default_rng(12)
    debris = []
    for size in generator.uniform((0.3, 0.3, 0.05), (2.2, 1.4, 0.5), (24, 3)):
        roll, pitch, turn = generator.uniform((-30, -30, 0), (30, 30, 360))
        place = generator.normal((3.0, -0.5, 0.1), (4.0, 4.5, 0.08))
        debris.append(moved(plate(size, breaks), roll, pitch, turn, place))
    debris.append(tube((3.6, -6.0, 0.15), (8.4, -2.2, 0.1), 0.14))              # a boom on the seabed
    return join([bow, stern, *debris])


def plank(from_y, to_y, side, top, *, length, beam, depth, thick=0.14):
    """Make one side of an open hull between two stations; ``top`` (stations,) is its height, 1 at the gunwale."""
    y = np.linspace(from_y, to_y, len(top))
    rings = []
    for here, high in zip(y, top):
        outside = hull_section(here, np.linspace(0.06, high, 9), side, length, beam, depth)
        inside = outside[::-1] - (side * thick, 0, 0) + (0, 0, 0.3 * thick)
        rings.append(np.concatenate((outside, inside)))
    return loft(rings)


def hull_section(y, girth, side, length, beam, depth):
    """Return points (N, 3) of a hull's skin at the distance y from midships; girth 0 at the keel, 1 at the gunwale."""
    along = 2 * y / length
    half = beam / 2 * (1 - np.abs(along) ** (2.6 if along > 0 else 4.0)) + 0.2
    lift = 1.3 * max(along - 0.55, 0) + 0.9 * max(-along - 0.7, 0)
    x, z = side * half * girth ** 0.45, lift + (depth + 0.5 * along ** 2 - lift) * girth ** 1.7
    return np.stack((x, np.full_like(girth, y), z), -1)


def hulk():
    """A wooden steamer's hull of 24 m, broken down: splintered planking, ribs, two boilers, an engine, a sternpost."""
    size = {"length": 24.0, "beam": 8.4, "depth": 3.3}
    generator, breaks = np.random.default_rng(23), np.random.default_rng(24)
    parts = []
    for side in (-1, 1):
        stations = np.linspace(-11.6, 11.7, 71)
        waves = sum(high * np.sin(stations / scale + generator.uniform(0, 2 * np.pi))
                    for high, scale in ((0.09, 2.6), (0.09, 0.9), (0.06, 0.35)))
        waves += breaks.choice((0.0, -0.04, -0.12), 71, p=(0.6, 0.25, 0.15)) + breaks.uniform(-0.02, 0.02, 71)
        top = np.clip(0.84 + waves - 0.5 * np.exp(-((stations - side * 3.5) / 1.6) ** 2), 0.18, 1.0)
        parts.append(plank(stations[0], stations[-1], side, top, **size))
        for rib in np.arange(-10.8, 10.9, 0.9):
            start = float(np.interp(rib, stations, top)) - 0.08
            girth = np.linspace(start, min(start + generator.uniform(0.05, 0.3), 1.06), 4)
            bones = hull_section(rib, girth, side, *size.values()) - (side * 0.22, 0, 0)
            parts += [tube(low, high, 0.09, sides=5) for low, high in zip(bones[:-1], bones[1:])]
    parts.append(box((0.6, 20.5, 1.2), (0, 0, 0.7)))                                # keelson
    parts += [moved(tube((0, -1.7, 0), (0, 1.7, 0), 1.05, sides=28), turn=turn, by=(x, y, 1.25))
              for x, y, turn in ((-1.35, -1.6, 6), (1.3, -1.0, -14))]               # boilers
    parts += [box((1.4, 2.0, 1.6), (0.1, -5.2, 1.5)), tube((0, -6.2, 1.3), (0, -11.2, 1.3), 0.14)]     # engine, shaft
    parts += [tube((0, -11.9, -0.3), (0, -12.3, 5.0), (0.2, 0.13), sides=8),        # sternpost
              box((0.12, 1.2, 2.2), (0, -12.9, 1.1)),                               # rudder
              tube((0, 11.7, 0.4), (0, 12.5, 3.6), (0.22, 0.15), sides=8),          # stem
              tube((-3.6, 5.5, 1.3), (3.4, 2.5, 2.3), 0.13, sides=8),               # a fallen mast
              tube((0.3, 8.3, 1.3), (-0.2, 8.4, 2.1), 0.35, sides=14)]              # windlass
    parts += [moved(box((generator.uniform(0.15, 0.3), 6.6, 0.2), (0, 0, 0)), turn=90 + generator.uniform(-6, 6),
                    roll=generator.uniform(-5, 5), by=(0, y, 2.3)) for y in (6.6, 7.8, 9.0)]    # deck beams
    for _ in range(70):
        place = generator.normal((0.6, 0.0, 1.3), (2.9, 6.8, 0.12))
        wide = generator.uniform((0.15, 0.3, 0.05), (0.7, 2.4, 0.35))
        parts.append(moved(plate(wide, breaks, 6), *generator.uniform((-25, -25, 0), (25, 25, 360)), place))
    return moved(join(parts), roll=6, pitch=1, by=(0, 0, -1.25))


def diver(kick=0.0):
    """A diver who swims, prone and head first: 2.5 m with fins, 0.6 m across, a cylinder on the back.

    The right leg is lifted by `kick` [degrees] and the left one lowered.
    """
    trunk = turned_body([(-0.34, 0.12), (-0.3, 0.17), (0.1, 0.19), (0.28, 0.2), (0.36, 0.12)], sides=20)
    bend = np.deg2rad(np.linspace(-80, 80, 7))
    head = moved(turned_body(np.column_stack((0.14 * np.sin(bend), 0.12 * np.cos(bend))), sides=16), by=(0, 0.5, 0.02))
    bottle = [(-0.34, 0.05), (-0.31, 0.085), (0.24, 0.085), (0.3, 0.05), (0.36, 0.025)]
    limbs = [part for side in (-1, 1) for part in (
        tube((side * 0.2, 0.28, 0), (side * 0.27, 0.5, -0.1), (0.06, 0.05)),                # arms, before the chest
        tube((side * 0.27, 0.5, -0.1), (side * 0.12, 0.72, -0.12), (0.05, 0.035)),
        *kicked(side, kick))]
    return join([trunk, head, moved(turned_body(bottle, sides=16), by=(0, -0.02, 0.25)), *limbs])


def kicked(side, kick):
    """One leg of the diver and its fin, lifted about the hip by `kick` [degrees] times its side."""
    hip = np.array((side * 0.1, -0.3, 0))
    leg = (
        tube((side * 0.1, -0.3, 0), (side * 0.13, -0.75, -0.06), (0.095, 0.065)),           # legs
        tube((side * 0.13, -0.75, -0.06), (side * 0.15, -1.18, 0.04), (0.065, 0.045)),
        moved(box((0.2, 0.66, 0.03), (0, 0, 0)), pitch=-8 * side, turn=-4 * side, by=(side * 0.17, -1.48, 0.02)))
    return [moved(moved(part, by=-hip), pitch=-side * kick, by=hip) if kick else part for part in leg]


def school(fish=60, size=(2.4, 4.0, 1.2), length=0.3):
    """A school of fish that swims north: 60 of about 0.3 m in 2.4 x 4.0 x 1.2 m, ten to a cubic metre."""
    generator, rings = np.random.default_rng(29), np.array([(0.5, 0.1), (0.25, 0.8), (0, 1), (-0.3, 0.45), (-0.4, 0.2)])
    angle = 2 * np.pi * np.arange(6)[:, None] / 6
    around = np.concatenate((0.07 * np.cos(angle), np.zeros((6, 1)), 0.13 * np.sin(angle)), axis=1)    # high, not wide
    body = [loft([wide * around + (0, along, 0) for along, wide in rings]), box((0.015, 0.16, 0.22), (0, -0.46, 0))]
    vertices, faces = join(body)
    places = generator.normal(size=(fish, 3))
    places *= (generator.uniform(0, 1, fish) ** (1 / 3) / np.linalg.norm(places, axis=1))[:, None] * np.array(size) / 2
    return grounded([moved((vertices * length * generator.uniform(0.8, 1.2), faces), pitch=generator.normal(0, 8),
                           turn=generator.normal(0, 15), by=place) for place in places])


# ---- species: whole bodies, for the shape `targets` --------------------------------------------------------------


STROKES = {"S": [(0, 0, 1, 0), (1, 0, 1, 0.5), (1, 0.5, 0, 0.5), (0, 0.5, 0, 1), (0, 1, 1, 1)],
           "O": [(0, 0, 1, 0), (1, 0, 1, 1), (1, 1, 0, 1), (0, 1, 0, 0)],
           "N": [(0, 0, 0, 1), (0, 1, 1, 0), (1, 0, 1, 1)],
           "A": [(0, 0, 0.5, 1), (0.5, 1, 1, 0), (0.25, 0.45, 0.75, 0.45)],
           "R": [(0, 0, 0, 1), (0, 1, 1, 1), (1, 1, 1, 0.5), (1, 0.5, 0, 0.5), (0.3, 0.5, 1, 0)]}


def letters(word="SONAR", size=(0.75, 1.3), apart=1.1, thick=0.12, high=0.1):
    """Bars of concrete laid out as a word: letters 1.3 m high that one reads from the south, the first in the west."""
    bars = []
    for number, letter in enumerate(word):
        for x0, y0, x1, y1 in STROKES[letter]:
            start, end = np.array([x0, y0]) * size, np.array([x1, y1]) * size
            along = (end - start) / np.hypot(*(end - start))
            side = 0.5 * thick * along[::-1] * (-1, 1)
            start, end = start - 0.5 * thick * along, end + 0.5 * thick * along
            outline = np.array([start - side, end - side, end + side, start + side]) + (number * apart, 0)
            ground = outline - (0.5 * (apart * (len(word) - 1) + size[0]), 0.5 * size[1])
            bars.append(loft([np.column_stack((ground, np.full(4, z))) for z in (-0.05, high)]))
    return join(bars)


def turned_body(outline, sides=32):
    """Turn an outline of (distance along y, radius) [m] about the y axis."""
    angle = 2 * np.pi * np.arange(sides)[:, None] / sides
    ring = np.concatenate((np.cos(angle), np.zeros((sides, 1)), np.sin(angle)), axis=1)
    return loft([radius * ring + (0, y, 0) for y, radius in outline])


def torus(radius, thickness, sides=24, section=8):
    """Make a ring about the y axis."""
    turn = 2 * np.pi * np.arange(sides)[:, None] / sides
    around = 2 * np.pi * np.arange(section) / section
    across = radius + thickness * np.cos(around)
    return loft(np.stack((np.cos(turn) * across, np.broadcast_to(thickness * np.sin(around), (sides, section)),
                          np.sin(turn) * across), axis=-1), around=True)


def grounded(parts):
    """Join parts and lift them onto z = 0."""
    vertices, faces = join(parts)
    return vertices - (0, 0, vertices[:, 2].min()), faces


def cylinder():
    """A cylindrical ground mine: 2.0 m long, 0.53 m across, edges rounded off, a lug for its parachute."""
    body = turned_body([(-1.0, 0.22), (-0.96, 0.265), (0.9, 0.265), (1.0, 0.19)], sides=40)
    return grounded([body, tube((0, 0.98, 0), (0, 1.06, 0), 0.1, sides=16), box((0.06, 0.3, 0.06), (0, 0.1, 0.28))])


def sphere():
    """A moored mine come down: 0.9 m across, with seven horns and an eye to moor it by."""
    lift = np.deg2rad(np.linspace(-84, 84, 15))
    ball = turned_body(np.column_stack((0.45 * np.sin(lift), 0.45 * np.cos(lift))), sides=36)
    directions = [(0, 0, 1)] + [(np.cos(turn), np.sin(turn), 0.6) for turn in np.deg2rad(np.arange(6) * 60)]
    horns = [tube(0.43 * way, 0.57 * way, 0.03, sides=8)
             for way in (np.array(direction) / np.linalg.norm(direction) for direction in directions)]
    return grounded([ball, *horns, moved(torus(0.06, 0.015), by=(0, 0, -0.49))])


def wedge():
    """A wedge-shaped ground mine: 1.0 x 0.8 x 0.4 m, low in front, with a step behind."""
    outline = [(-0.5, 0), (0.5, 0), (0.5, 0.08), (-0.1, 0.4), (-0.35, 0.4), (-0.5, 0.3)]
    return loft([[(side * (0.4 if z == 0 else 0.36), y, z) for y, z in outline] for side in (-1, 1)])


def torpedo():
    """A torpedo: 5.8 m long, 0.533 m across, round nose, tapering tail with four fins and a ring about the screw."""
    bend = np.deg2rad(np.linspace(4, 90, 8))
    nose = np.column_stack((2.55 + 0.35 * np.cos(bend), 0.2665 * np.sin(bend)))
    body = turned_body([*nose, (-1.9, 0.2665), (-2.5, 0.17), (-2.8, 0.06)], sides=28)
    fins = [moved(box((0.02, 0.5, 0.2), (0, -2.5, 0.2)), roll=90 * turn) for turn in range(4)]
    return grounded([body, *fins, moved(torus(0.22, 0.02), by=(0, -2.84, 0))])


def drum():
    """A drum of 200 l, lying: 0.88 m long, 0.585 m across, with rolling hoops and chimes."""
    hoops = ((-0.44, 0.293), (-0.41, 0.293), (-0.4, 0.283), (-0.17, 0.283), (-0.15, 0.2925), (-0.13, 0.283))
    return grounded([turned_body([*hoops, *((-y, radius) for y, radius in reversed(hoops))], sides=40)])


def crate():
    """A wooden crate: 1.2 x 0.8 x 0.7 m with battens round its edges."""
    x, y, z = 0.8, 1.2, 0.7
    edges = [box((x + 0.04, 0.1, z + 0.04), (0, place, z / 2 + 0.02)) for place in (-0.5, 0.0, 0.5)]
    return grounded([box((x, y, z), (0, 0, z / 2 + 0.02)), *edges])


def clump():
    """A concrete sinker: 1.0 m square below, 0.8 m above, 0.6 m high, with a mooring ring."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    block = loft([0.5 * square, 0.4 * square + (0, 0, 0.6)])
    return grounded([block, moved(torus(0.14, 0.025), by=(0, 0, 0.7))])


def anchor():
    """A stocked anchor lying on stock and fluke: shank 1.8 m, arms 1.1 m, stock 1.5 m across."""
    bend = np.deg2rad(np.linspace(-65, 65, 9))
    arm = np.column_stack((0.65 * np.sin(bend), -0.2 - 0.65 * np.cos(bend), np.zeros(9)))
    bars = [tube(start, end, 0.055, sides=8) for start, end in zip(arm[:-1], arm[1:])]
    palms = [moved(box((0.04, 0.34, 0.3), (0, 0, 0)), turn=-side * 30, by=(side * 0.53, -0.42, 0)) for side in (-1, 1)]
    parts = [tube((0, -0.85, 0), (0, 0.95, 0), (0.075, 0.055), sides=10), *bars, *palms,
             tube((0, 0.72, -0.75), (0, 0.72, 0.75), 0.04, sides=8), moved(torus(0.1, 0.022), roll=90, by=(0, 1.05, 0))]
    return grounded([moved(join(parts), roll=45)])


def lobster_pot():
    """A lobster pot: 0.7 x 0.5 m, 0.42 m high, a floor of slats under hoops and stringers, bars of 3 cm."""
    turn = np.deg2rad(np.linspace(0, 180, 9))
    hoop = np.column_stack((0.25 * np.cos(turn), np.zeros(9), 0.12 + 0.28 * np.sin(turn)))
    hoops = [tube(start + (0, y, 0), end + (0, y, 0), 0.016, sides=6)
             for y in (-0.34, 0.0, 0.34) for start, end in zip(hoop[:-1], hoop[1:])]
    stringers = [tube(hoop[n] + (0, -0.36, 0), hoop[n] + (0, 0.36, 0), 0.014, sides=6) for n in range(9)]
    posts = [tube((x, y, 0.02), (x, y, 0.13), 0.016, sides=6) for x in (-0.25, 0.25) for y in (-0.34, 0.0, 0.34)]
    slats = [box((0.06, 0.74, 0.03), (x, 0, 0.015)) for x in np.linspace(-0.24, 0.24, 5)]
    return grounded([*hoops, *stringers, *posts, *slats])


def debris():
    """Wreckage of a hull: a torn plate of 2.2 x 1.5 m with three frames, a piece that stands up, and a broken mast."""
    generator = np.random.default_rng(7)
    frames = [box((1.0, 0.08, 0.16), (0, y, 0.08)) for y in (-0.6, 0.0, 0.6)]
    piece = moved(plate((0.8, 1.1, 0.04), generator), roll=35, by=(0.5, -0.5, 0.3))
    mast = tube((-0.9, -0.8, 0.22), (0.7, 1.2, 0.3), (0.09, 0.06), sides=10)
    return grounded([plate((1.5, 2.2, 0.05), generator), *frames, piece, mast])


SPECIES = {"anchor": anchor, "boulder": lambda: grounded([boulder()]), "clump": clump, "crate": crate,
           "cylinder": cylinder, "debris": debris, "drum": drum, "lobster_pot": lobster_pot, "sphere": sphere,
           "torpedo": torpedo, "truncated_cone": lambda: grounded([truncated_cone()]),
           "tyre": lambda: grounded([tyre()]), "wedge": wedge}

TARGETS = {"boulder": boulder, "diver": diver, "diver_kick_left": lambda: diver(-16),
           "diver_kick_right": lambda: diver(16), "hulk": hulk, "letters": letters, "school": school,
           "truncated_cone": truncated_cone, "tyre": tyre, "wreck": wreck}


# ---- a survey ----------------------------------------------------------------------------------------------------


def sandwaves():
    """Make a small survey, (240, 200) heights [m] from the north, NaN where the ship did not sail."""
    sys.path.insert(0, str(ROOT.parent))
    from mitsonar.scattering import Fractal, Plane, Ripples, RoughnessSpectrum

    x, y = np.arange(200) * 2.0, np.arange(240) * 2.0
    heights = (Plane(slope=np.deg2rad(0.4), heading=np.deg2rad(70))
               + Ripples(wavelength=90.0, height=2.2, heading=np.deg2rad(25), asymmetry=0.35, sharpness=0.5,
                         wander=12.0, wander_length=200.0, defect_density=4e-5, seed=3)
               + Fractal(spectrum=RoughnessSpectrum.of_height(0.12, outer_scale=60.0), seed=5)).on_grid(x, y) - 27.0
    bend = 250 + 60 * np.sin(y[:, None] / 140)
    heights -= 5.5 * np.exp(-(((x - bend) / 38) ** 2))                          # a channel
    heights[np.hypot((x - 90) / 26, (y[:, None] - 330) / 17) < 1] = np.nan       # a shoal that was sailed around
    edge = 6 + 4 * np.sin(y[:, None] / 37) + 3 * np.sin(y[:, None] / 11)
    heights[(x < edge) | (x > 398 - edge[::-1])] = np.nan
    return np.round(heights[::-1], 2).astype(np.float32)


def bottom_map():
    """Make a map of a bed's strength, (150, 150) [dB] from the south-west over 110 x 118 m: sand, silt, shell, weed."""
    from scipy.ndimage import gaussian_filter

    generator = np.random.default_rng(31)

    def smooth(cells):
        field = gaussian_filter(generator.standard_normal((150, 150)), cells, mode="wrap")
        return field / field.std()

    x, y = np.meshgrid(*((np.arange(150) + 0.5 - 75) * side / 150 for side in (110, 118)))
    streak = gaussian_filter(generator.standard_normal((150, 150)), (3, 16), mode="wrap")
    level = -24 + 1.3 * smooth(14) + 0.7 * smooth(4) + 1.1 * streak / streak.std()
    level -= 4.5 / (1 + np.exp(-6 * (smooth(12) - 1.0)))                            # silt in hollows
    level += 4.0 / (1 + np.exp(-8 * (smooth(7) - 1.5)))                             # shell and gravel
    weed = gaussian_filter((generator.random((150, 150)) < 0.06) * 1.0, 0.7) / 0.1
    level += 3.0 * np.minimum(weed, 2) / (1 + np.exp(-8 * (smooth(16) - 0.7)))      # clumps, where weed grows
    level += 2.5 * np.exp(-(((x - 4.7) ** 2 + (y - 8.4) ** 2) / 13.0 ** 2))         # coarse in the wreck's scour
    return np.round(np.clip(level, -34, -14), 2).astype(np.float32)


# ---- files -------------------------------------------------------------------------------------------------------


def write_ply(path, vertices, faces):
    """Write a binary PLY file, the vertices to a tenth of a millimetre."""
    records = np.empty(len(faces), [("count", "u1"), ("index", "<i4", 3)])
    records["count"], records["index"] = 3, faces
    header = ("ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}", "property float x",
              "property float y", "property float z", f"element face {len(faces)}",
              "property list uchar int vertex_indices", "end_header", "")
    path.write_bytes("\n".join(header).encode() + np.round(vertices, 4).astype("<f4").tobytes() + records.tobytes())


def write_survey(path, heights):
    """Write a GeoTIFF in UTM zone 31, somewhere in the southern North Sea."""
    import rasterio
    from rasterio.transform import from_origin

    with rasterio.open(path, "w", driver="GTiff", height=heights.shape[0], width=heights.shape[1], count=1,
                       dtype="float32", nodata=-9999.0, crs="EPSG:32631", compress="deflate", predictor=3, zlevel=9,
                       transform=from_origin(512000, 5790480, 2, 2)) as raster:
        raster.write(np.where(np.isnan(heights), np.float32(-9999), heights), 1)
        raster.set_band_description(1, "elevation")


def write_pfm(path, values):
    """Write a grey picture of floats, from below."""
    path.write_bytes(f"Pf\n{values.shape[1]} {values.shape[0]}\n-1.0\n".encode() + values.astype("<f4").tobytes())


def main(folder=ROOT):
    """Write everything into ``folder``."""
    for name in ("meshes", "targets", "bathymetry", "textures"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for inside, made in (("meshes", TARGETS), ("targets", SPECIES)):
        for name, make in made.items():
            write_ply(folder / inside / f"{name}.ply", *make())
    write_survey(folder / "bathymetry" / "sandwaves.tif", sandwaves())
    write_pfm(folder / "textures" / "wreck_bed.pfm", bottom_map())


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
