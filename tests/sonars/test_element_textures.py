"""Textures under fixed scatterers: a bed bright in one quarter of its texture sounds bright there and nowhere else.

Four reflectances in the ratios 1, 0.5, 0.25, 0.125 on the quarters of a square below the sonar, which all contribute
alike otherwise: Lambert's law, <|g|²> aside. Energies are summed without the amplitudes' chance; 0.1 dB is five times
what points anywhere within 10,000 cells of a quarter scatter.
"""
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.scene.loading import prepare
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar

BRIGHTNESS = np.array([[1.0, 0.5], [0.25, 0.125]])
SIDE = 6.0


def square(kind, tmp_path):
    """A square bed as a rectangle, or as a mesh of two facets with texture coordinates."""
    transform = mi.ScalarTransform4f().translate([0, 0, -20]).scale([SIDE, SIDE, 1])
    material = {"type": "twosided", "material": {"type": "diffuse", "reflectance": {
        "type": "bitmap", "bitmap": mi.Bitmap(0.5 * BRIGHTNESS[..., None].astype(np.float32)), "raw": True,
        "filter_type": "nearest", "wrap_mode": "clamp"}}}
    if kind == "rectangle":
        return {"type": "rectangle", "to_world": transform, "bsdf": material}
    path = tmp_path / "square.obj"
    path.write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                    "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")
    return {"type": "obj", "filename": str(path), "to_world": transform, "bsdf": material}


@pytest.mark.parametrize("integrator", [{"cell": 0.06}, {"cell": 0.06, "ensonification": "rays", "rays": 200_000}],
                         ids=["scatterers", "rays"])
@pytest.mark.parametrize("kind", ["rectangle", "obj"])
def test_cells_see_the_texture(variant, monkeypatch, tmp_path, kind, integrator):
    monkeypatch.setattr("mitsonar.echoes.scatterers.scatterers.gaussian", lambda lib, *_: (lib.Float(1), lib.Float(0)))
    prepare()
    scene = array_sonar({"bed": square(kind, tmp_path)}, integrator=integrator)
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ensonification = PressureRecord(survey).ensonification(0)
    energy = np.zeros((2, 2))
    origin, rotation = survey.track.position[0], survey.track.rotation()[0]
    for block in ensonification.echoes(origin, rotation, float(survey.depth_below[0]), 3):
        x, y, _ = block.out.offset.numpy()
        np.add.at(energy, ((x > 0).astype(int), (y > 0).astype(int)),
                  sum(part.numpy().astype(float) ** 2 for part in block.amplitude))
    towards = mi.Ray3f(mi.Point3f([-3, -3, 3, 3], [-3, 3, -3, 3], -10), mi.Vector3f(0, 0, -1))
    si = scene.ray_intersect(towards)
    value = si.bsdf().eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1))[0].numpy().reshape(2, 2)
    assert sorted(value.ravel() / value.max()) == pytest.approx(sorted(BRIGHTNESS.ravel()), rel=1e-5)
    apart = 10 * np.log10(energy / energy.sum() / (value / value.sum()))
    assert np.abs(apart).max() < 0.1
