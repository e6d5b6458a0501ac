"""Spheres, cylinders and disks carry scatterers: facets on their surface, found again from hits, lit where seen.

Energies without the amplitudes' chance: μ ∫ cos²ψ dA over what is seen from 14 m, ψ from the normal (from far away
2πμa²/3 for a sphere). 1 % is left for what facets lie below the surface, their shadowed rim and points anywhere in
their cells; 4 % for rays, 1 % rms by their number.
"""
import numpy as np
import pytest

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.loading import prepare
from mitsonar.scene.tessellation import FINEST_SAGITTA
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar, buried_bed

MU_DB = -20.0


def shapes():
    import mitsuba as mi

    T, material = mi.ScalarTransform4f, {"type": "lambert", "mu_db": MU_DB}
    return {
        "sphere": {"type": "sphere", "center": [0.5, 14.0, -11.0], "radius": 0.8, "bsdf": material},
        "cylinder": {"type": "cylinder", "p0": [-0.7, 14.0, -9.5], "p1": [0.7, 14.0, -9.5], "radius": 0.5,
                     "bsdf": material},
        "disk": {"type": "disk", "to_world": T().translate([0, 14, -10]).rotate([1, 0, 0], 90).scale([1.2, 0.7, 1]),
                 "bsdf": material},
        "rectangle": {"type": "rectangle", "to_world": T().translate([0, 14, -10]).rotate([1, 0, 0], 80),
                      "bsdf": material}}


def seen(kind, steps=2000):
    """∫ cos²ψ dA by midpoints."""
    t = (np.arange(steps) + 0.5) / steps
    if kind == "sphere":                                                # cosine from the axis to the sonar
        a, d, cosine = 0.8, np.linalg.norm([0.5, 14, -1]), 2 * t - 1
        facing = (d * cosine - a) / np.sqrt(d ** 2 + a ** 2 - 2 * a * d * cosine)
        return 4 * np.pi * a ** 2 * np.mean(np.maximum(facing, 0) ** 2)
    if kind == "cylinder":
        phi, x = (2 * t - 1)[:, None] * np.pi, 0.7 * (2 * t[None, ::20] + 1 / steps - 1)
        normal = np.stack(np.broadcast_arrays(0 * x, -np.cos(phi), np.sin(phi)), -1)
        point = 0.5 * normal + np.stack(np.broadcast_arrays(x, 14.0 + 0 * phi, 0.5), -1)
        facing = -np.sum(point * normal, -1) / np.linalg.norm(point, axis=-1)
        return np.pi * 1.4 * np.mean(np.maximum(facing, 0) ** 2)
    r, phi = np.sqrt(t)[:, None], 2 * np.pi * t[None, ::20]
    x, z = 1.2 * r * np.cos(phi), 0.7 * r * np.sin(phi)
    return np.pi * 1.2 * 0.7 * np.mean(14.0 ** 2 / (14.0 ** 2 + x ** 2 + z ** 2))


KINDS = ("sphere", "cylinder", "disk")


def energy(kind, **integrator):
    scene = array_sonar({"bed": buried_bed(40.0), "thing": shapes()[kind]}, water={"absorption_db_per_km": 0.0},
                        integrator={"cell": 0.02, **integrator}, film={"range": 20.0, "range_min": 5.0})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ensonification = PressureRecord(survey).ensonification(0)
    start = survey.track.position[0]
    total, point = 0.0, []
    for echoes in ensonification.echoes(start, np.eye(3), 30.0, 1):
        offset = echoes.out.offset.numpy().T
        total += float(np.sum(echoes.energy.numpy().astype(float) * np.linalg.norm(offset, axis=1) ** 4))
        point.append(offset + start)
    return total, np.concatenate(point), ensonification.scatterers


@pytest.mark.parametrize("kind", KINDS)
def test_strength_of_lambert_shapes(variant, kind):
    total, point, _ = energy(kind)
    assert total == pytest.approx(10 ** (MU_DB / 10) * seen(kind), rel=0.01)
    if kind == "sphere":
        assert np.abs(np.linalg.norm(point - [0.5, 14, -11], axis=1) - 0.8).max() <= 1.01 * FINEST_SAGITTA


@pytest.mark.parametrize("kind", KINDS)
def test_rays_bring_the_same(variant, kind):
    total, _, _ = energy(kind, ensonification="rays", rays=400_000)
    assert total == pytest.approx(10 ** (MU_DB / 10) * seen(kind), rel=0.04)


@pytest.mark.parametrize("kind", ["sphere", "cylinder", "disk", "rectangle"])
def test_a_point_on_the_surface_is_in_its_facet(variant, kind):
    import drjit as dr
    import mitsuba as mi

    prepare()
    geometry = Geometry(array_sonar({"bed": buried_bed(40.0), "thing": shapes()[kind]}))
    scatterers = Scatterers(geometry, 0.03)
    index = next(index for index, shape in geometry.others if shape.id() == "thing")
    first = int(scatterers.rows[index, 0])
    count = len(scatterers.cuts) - first if index == geometry.others[-1][0] else None
    last = first + (count or 2)
    runs = np.arange(first, last, dtype=np.uint32)
    cells = scatterers.cuts[runs].astype(np.int64) ** 2
    facet, s = next(scatterers.listed((runs, 0 * cells, 1 + 0 * cells, cells), 1 << 22))
    at = scatterers.at(facet, s)

    class Hits:
        valid, point, shape, primitive = dr.full(mi.Bool, True, dr.width(s)), at.point, at.shape, mi.UInt32(0)

    again, number = scatterers.of(Hits)
    area = at.area.numpy() > 1e-9
    same = (again.numpy() == facet.numpy())[area]
    # facets lie below the surface: a few points at their edges belong, seen along the radius, to the neighbour
    assert same.mean() > 0.98
    assert (number.numpy() == s.numpy())[area][same].mean() > 0.98
