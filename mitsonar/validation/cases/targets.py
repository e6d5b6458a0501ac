"""Target strengths of smooth bodies through the whole chain, against closed forms and exact series."""
from collections.abc import Mapping
from typing import Literal

import numpy as np
from scipy.special import j1

from mitsonar.scattering.bodies.spheres import sphere_target_strength_db

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table

WAVELENGTH, SPEED, FREQUENCY = 0.015, 1500.0, 100e3
K = 2 * np.pi / WAVELENGTH
DISTANCE = 150.0
AT = np.array([0.0, DISTANCE, -10.0])              # ahead of the sonar, at its depth [m]
# printed 20 log(2 |f| / a) of the exact series [dB], by ka
SPHERES: dict[Literal["rigid", "soft"], dict[int, float]] = {
    "rigid": {20: -0.226047, 50: -0.017897, 100: -0.006580}, "soft": {20: 0.013307, 50: 0.002164, 100: 0.000542}}
ALLOWED = 0.5                                      # [dB]
PLATE, DISC, PIPE = (0.3, 0.2), 0.15, (0.1, 0.5)    # [m] sides; radius; radius and length
DIHEDRAL, SQUARE = (0.2, 0.3), 0.2                 # [m] sides


def strength_db(shapes: Mapping[str, object], bounces: int = 1, middle: float = DISTANCE) -> float:
    """Return the target strength [dB re 1 m²] of bodies at `DISTANCE`: the echo's spectrum at the carrier.

    Spreading is removed; `middle` [m] replaces one of the two ranges, for a sphere the range of its centre.
    """
    import mitsonar

    scene = scenes.array_sonar(
        {"bed": scenes.buried_bed(900.0), **shapes}, depth=10.0, water={"absorption_db_per_km": 0.0},
        sensor={"pulse": "cw", "pulse_ms": 1.0, "frequency_khz": FREQUENCY / 1e3},
        film={"range": DISTANCE + 8, "range_min": DISTANCE - 8}, integrator={"max_depth": bounces})
    response = mitsonar.impulse_response(scene).values[0, 0, 0].astype(complex)
    return float(20 * np.log10(abs(response.sum()) * DISTANCE * middle))


def _placed(kind, x, y, normal, centre):
    """Return a rectangle or disk with half sides x and y (vectors) [m]."""
    import mitsuba as mi

    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, normal, centre
    return {"type": kind, "to_world": mi.ScalarTransform4f(matrix.tolist()), "bsdf": {"type": "rigid"}}


def _facing(kind, width, height, tilt):
    """Return a plate that faces the sonar, turned about the vertical by `tilt` [rad]."""
    along = np.array([np.cos(tilt), np.sin(tilt), 0])
    return _placed(kind, 0.5 * width * along, [0, 0, 0.5 * height], [along[1], -along[0], 0], AT)


def _rectangle(tilt):
    return {"plate": _facing("rectangle", *PLATE, tilt)}


def _disc(tilt):
    return {"disc": _facing("disk", 2 * DISC, 2 * DISC, tilt)}


def _cylinder(tilt):
    radius, length = PIPE
    along, middle = 0.5 * length * np.array([np.cos(tilt), np.sin(tilt), 0]), AT + [0, radius, 0]
    return {"pipe": {"type": "cylinder", "p0": list(middle - along), "p1": list(middle + along), "radius": radius,
                     "bsdf": {"type": "rigid"}}}


def _rectangle_db(tilt):
    lobe = np.sinc(K * PLATE[0] * np.sin(tilt) / np.pi)
    return 20 * np.log10(np.abs(PLATE[0] * PLATE[1] / WAVELENGTH * lobe * np.cos(tilt)))


def _disc_db(tilt):
    x = np.maximum(2 * K * DISC * np.sin(tilt), 1e-9)
    return 20 * np.log10(np.abs(np.pi * DISC ** 2 / WAVELENGTH * 2 * j1(x) / x * np.cos(tilt)))


def _cylinder_db(tilt):
    radius, length = PIPE
    lobe = np.sinc(K * length * np.sin(tilt) / np.pi)
    return 10 * np.log10(radius * length ** 2 / (2 * WAVELENGTH) * (lobe * np.cos(tilt)) ** 2)


# name -> body, closed form, tilts [deg]
TILTED = {"rectangle": (_rectangle, _rectangle_db, (0.5, 0.0, 1.0, 2.5, 5.0)),
          "disc": (_disc, _disc_db, (1.0, 0.0, 2.0, 4.0)), "cylinder": (_cylinder, _cylinder_db, (0.3, 0.0, 0.6, 1.0))}


def _sphere(ka, surface):
    radius = ka / K
    ball = {"type": "sphere", "center": list(AT + [0, radius, 0]), "radius": radius, "bsdf": {"type": surface}}
    return strength_db({"ball": ball}, middle=DISTANCE + radius)


def _dihedral():
    a, b = DIHEDRAL
    side = np.sqrt(0.5) * np.array([[1, -1, 0], [-1, -1, 0]])
    return {f"plate{i}": _placed("rectangle", 0.5 * a * side[i], [0, 0, 0.5 * b], side[1 - i], AT + 0.5 * a * side[i])
            for i in range(2)}


def _trihedral():
    # three unit vectors at right angles, whose bisector points to the sonar
    rows = np.array([[1, -1, 0], [1, 1, -2], [1, 1, 1]]) / np.sqrt([[2], [6], [3]])
    e = (np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).T @ rows).T
    return {f"plate{i}": _placed("rectangle", 0.5 * SQUARE * e[i - 1], 0.5 * SQUARE * e[i - 2], e[i],
                                 AT + 0.5 * SQUARE * (e[i - 1] + e[i - 2])) for i in range(3)}


def _ellipsoid(end_on, steps=160, long=0.4, short=0.12):
    """Return the target strength of a mesh of an ellipsoid of revolution that touches `AT`, and the closed form."""
    import mitsuba as mi

    theta, phi = np.meshgrid(np.linspace(0, np.pi, steps + 1), np.arange(steps) * 2 * np.pi / steps, indexing="ij")
    unit = np.stack([np.cos(theta), np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)], -1)
    number = np.arange(theta.size).reshape(theta.shape)
    low, high = number[:-1], number[1:]
    faces = np.concatenate([np.stack(abc, -1).reshape(-1, 3) for abc in (
        (low, high, np.roll(high, -1, 1)), (low, np.roll(high, -1, 1), np.roll(low, -1, 1)))])
    half = np.array([short, long, short] if end_on else [long, short, short])
    unit = (unit[..., [1, 0, 2]] if end_on else unit).reshape(-1, 3)
    vertices, normals = unit * half + AT + [0, half[1], 0], unit / half
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    props = mi.Properties()
    props["bsdf"] = mi.load_dict({"type": "rigid"})
    body = mi.Mesh("body", len(vertices), len(faces), props=props, has_vertex_normals=True)
    parameters = mi.traverse(body)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["vertex_normals"] = normals.astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    parameters.update()
    radius = short ** 2 / long if end_on else long         # of the sphere of the same strength
    return strength_db({"body": body}), 20 * np.log10(radius / 2)


def _tilted(quick):
    """Return rows and panels of plates and cylinders over tilt."""
    rows, panels = [], []
    for name, (body, closed_form, tilts) in TILTED.items():
        tilts = tilts[:1] if quick else tilts
        got = [strength_db(body(np.radians(tilt))) for tilt in tilts]
        rows += [Compared(f"rigid {name}, {tilt:g} degrees", level, float(closed_form(np.radians(tilt))), ALLOWED, "dB")
                 for tilt, level in zip(tilts, got)]
        fine = np.linspace(0, 1.2 * max(tilts), 400)
        expected = closed_form(np.radians(fine))
        panels.append(Panel(f"rigid {name}", "tilt [deg]", "target strength [dB re 1 m²]", (
            Curve("closed form", fine, np.maximum(expected, expected[0] - 40)), Curve("chain", tilts, got, "."))))
    return rows, panels


def _run(quick):
    from mitsonar.scene.loading import prepare

    prepare()
    rows, panels = _tilted(quick)
    spheres = []
    for surface, table in SPHERES.items():
        cases = list(table)[1:2] if quick else list(table)
        got = [_sphere(ka, surface) for ka in cases]
        expected = [20 * np.log10(0.5 * ka / K) + table[ka] for ka in cases]
        rows += [Compared(f"{surface} sphere, ka {ka}", level, wanted, ALLOWED, "dB")
                 for ka, level, wanted in zip(cases, got, expected)]
        rows += [Compared(f"exact series of a {surface} sphere, ka {ka}", float(sphere_target_strength_db(
            ka / K, FREQUENCY, SPEED, surface=surface)), wanted, 1e-5, "dB") for ka, wanted in zip(cases, expected)]
        spheres += [Curve(surface, cases, expected), Curve(surface, cases, got, ".")]
    a, b = DIHEDRAL
    rows.append(Compared("dihedral, two bounces", strength_db(_dihedral(), 2), 10 * np.log10(2) + 20 * np.log10(
        a * b / WAVELENGTH), ALLOWED, "dB"))
    rows.append(Compared("trihedral of squares, three bounces", strength_db(_trihedral(), 3),
                    10 * np.log10(3) + 20 * np.log10(SQUARE ** 2 / WAVELENGTH), ALLOWED, "dB"))
    for name, end_on in (("end", True), ("side", False)):
        rows.append(Compared(f"ellipsoid of facets with normals, {name} on", *_ellipsoid(end_on), ALLOWED, "dB"))
    return Table(tuple(rows), (*panels, Panel("spheres", "ka", "target strength [dB re 1 m²]", tuple(spheres), "x")))


CASE = Case(title="Target strengths of smooth bodies", run=_run, text=(
    "One omnidirectional element, water without loss, bodies 150 m away at 100 kHz: |response at the carrier|² r⁴. "
    "Rectangle (ab/λ)² sinc² cos², disc (πa²/λ)² (2J₁(x)/x)² cos², cylinder (aL²/2λ) sinc² cos², dihedral 2(ab/λ)², "
    "trihedral of squares 3(a²/λ)², ellipsoid (R₁R₂)/4 (Urick 1983, ch. 9; Kirchhoff); spheres by the exact series. "
    "The allowed error is 0.5 dB; at ka = 20 the Kirchhoff integral lacks the wave that creeps around a rigid sphere."))
