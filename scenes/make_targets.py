"""Make the meshes and the survey that the scenes name, the same bytes every time.

    python3 scenes/make_targets.py [FOLDER]

Writes meshes/*.ply and bathymetry/sandwaves.tif, by default beside this script. Every mesh stands on the seabed z = 0,
metres, z up, its bow or front to the north (+y); what lies below z = 0 is buried. All surfaces are closed and look
outwards. Scenes should load them with face_normals = true: these are plates, not smooth bodies.
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
    generator = np.random.default_rng(11)
    debris = []
    for size in generator.uniform((0.3, 0.3, 0.05), (2.2, 1.4, 0.5), (24, 3)):
        roll, pitch, turn = generator.uniform((-30, -30, 0), (30, 30, 360))
        place = generator.normal((3.0, -0.5, 0.1), (4.0, 4.5, 0.08))
        debris.append(moved(box(size, (0, 0, 0)), roll, pitch, turn, place))
    debris.append(tube((3.6, -6.0, 0.15), (8.4, -2.2, 0.1), 0.14))              # a boom on the seabed
    return join([bow, stern, *debris])


TARGETS = {"boulder": boulder, "truncated_cone": truncated_cone, "tyre": tyre, "wreck": wreck}


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


def main(folder=ROOT):
    """Write everything into ``folder``."""
    for name in ("meshes", "bathymetry"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, make in TARGETS.items():
        write_ply(folder / "meshes" / f"{name}.ply", *make())
    write_survey(folder / "bathymetry" / "sandwaves.tif", sandwaves())


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
