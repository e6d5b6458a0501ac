"""The sea surface in a sidescan's picture: where it lies, how strong it is, and that the seabed does not notice it.

Sonar 12 m deep, 28 m above a flat Lambert bed, one sound speed, faces omnidirectional in elevation. The level of a gate
is the sonar equation integrated over range and azimuth as in `test_sidescan_levels`, dA = R dR dφ, once with the bed's
strength at sin θ = 28/R and once with the surface's at sin θ = 12/R; the two add. The surface is summed in steps of a
bin's 1/80, as its strength near the vertical falls by 1 dB in 0.05 m. 0.05 dB is left for the noise of 2 million rays.
"""
import numpy as np
from mean_intensity import render
from scipy.integrate import trapezoid

import mitsonar
from mitsonar.scattering import backscatter_strength_db
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import bed, lambert, sidescan

ALPHA = 0.030
DEPTH, ALTITUDE, WIND = 12.0, 28.0, 6.0
PLACE = ("x", "y", "z", "heading", "altitude")
START = {"start": [0.0, 0.0, -DEPTH], "vertical_beam_width_deg": 180.0}


def surface(**attributes):
    return {"type": "sea_surface", "wind_speed": WIND, **attributes}


def ring_level(sonar, height, strength, edges, steps=80):
    """Intensity [µPa²] of the bins between `edges` [m] from a plane `height` [m] away of strength(grazing angle)."""
    azimuth = np.linspace(0, 1, 2001) ** 3 * np.pi / 2
    found = []
    for near, far in zip(edges[:-1], edges[1:]):
        if far <= height:
            found.append(0.0)
            continue
        start = max(near, height)                          # where the beam cuts the first ring within millimetres
        r = start + (far - start) * np.linspace(0, 1, steps + 1) ** (3 if start == height else 1)
        sine = np.minimum(height / r, 1.0)
        pattern = sonar.along_intensity(np.sqrt(1 - sine**2)[:, None] * np.sin(azimuth))
        ring = 2 * trapezoid(pattern, azimuth, axis=1) * r
        gate = trapezoid(ring * strength(np.arcsin(sine)) * r**-4.0 * 10 ** (-0.2 * ALPHA * r), r)
        found.append(gate * min(1.0, sonar.resolution / (far - near)))
    return 10 ** (sonar.source_level_db / 10) * np.array(found)


def expected(scene, bins):
    sonar = sonar_at(scene.sensors()[0], DEPTH)
    edges = np.arange(bins + 1) * 100.0 / bins
    above = ring_level(sonar, DEPTH, lambda angle: 10 ** (backscatter_strength_db(
        "sea_surface", angle, sonar.frequency, wind_speed=WIND) / 10), edges)
    below = ring_level(sonar, ALTITUDE, lambda angle: 10**-2.7 * np.sin(angle) ** 2, edges)
    return above, below


def test_surface_and_bed_add_up_to_the_sonar_equation():
    scene = sidescan({"seabed": bed(DEPTH + ALTITUDE), "surface": surface()}, sensor=START, film={"bins": 400},
                     rays=2_000_000)
    dataset, intensity, _ = render(scene)
    above, below = expected(scene, 400)
    first = int(DEPTH / 0.25)
    assert np.all(intensity[:, :first - 1] == intensity[:, :first - 1].min())           # nothing before the surface
    assert np.argmax(intensity[:, :100].mean(0)) in (first, first + 1)
    error_db = 10 * np.log10(intensity.mean(0)[first:] / (above + below)[first:])
    assert np.abs(error_db).max() < 0.05


def test_bed_is_seen_as_if_there_were_no_surface():
    """Under a mirror, which scatters nothing back, the picture is the bed's: 0.15 dB are 5 sigma of the rays' noise,
    and places and altitudes are the same."""
    laid = {"track": "", "altitude": 20.0, "pings": 6, "heading_deg": 0.0}
    bed = {"type": "seabed", "depth": 40.0, "length": 100.0, "width": 200.0, "spacing": 5.0, "bsdf": lambert()}
    alone, both = (sidescan({"seabed": bed, **more}, sensor=laid, rays=1_000_000, film={"bins": 100, "range": 60.0})
                   for more in ({}, {"surface": surface(wind_speed=0.0, size=3000.0)}))
    (alone, level, _), (both, same, _) = render(alone), render(both)
    for name in PLACE:
        np.testing.assert_array_equal(alone[name], both[name])
    seen = alone["range"].values > 21
    assert np.abs(10 * np.log10(level / same))[:, seen].max() < 0.15
    assert np.all(both["mean_level"].values[..., alone["range"].values < 19] == -200)
    assert set(both.attrs["labels"].values()) == {"seabed", "surface"}


def test_a_mirror_takes_no_rays_and_lights_no_shadow(variant):
    """A flat surface sends nothing back: what is seen straight is the record without it, shadows and all."""
    import mitsuba as mi
    box = {"type": "cube", "bsdf": {"type": "lambert"},
           "to_world": mi.ScalarTransform4f().translate([30, 0, -37]).scale([1, 8, 3])}
    shapes = {"seabed": bed(40.0), "wreck": box}
    alone = mitsonar.render(sidescan(shapes, rays=20_000))
    under = mitsonar.render(sidescan({**shapes, "surface": {"type": "sea_surface", "wind_speed": 0.0}}, rays=20_000))
    assert alone["shadow"].values.any()
    # the mean speed that rays are aimed by is over all depths of the scene: its last bit differs, and packets whose
    # rays leave the beam together may miss an edge together
    np.testing.assert_array_equal(under["shadow"].values, alone["shadow"].values)
    apart = np.abs(under["rays"].values.astype(int) - alone["rays"].values.astype(int))
    assert apart.max() <= 4 and np.mean(apart > 0) < 0.03
