"""Small scenes with an array_sonar for tests, built as Mitsuba dictionaries."""
import mitsuba as mi
import numpy as np

from mitsonar.scene.loading import prepare

SUMMER = "0:1513.2, 4:1513, 8:1511.6, 11:1506.4, 14:1500.8, 17:1496.6, 20:1494.2, 25:1492.9, 32:1492.3, 40:1492.2"


def array_scene(shapes, *, sensor=None, water=None, film=None, integrator=None):
    """Load a scene: shapes {id: dict}, and changes to the attributes of the rest."""
    prepare()
    water, sensor = water or {}, sensor or {}
    place = {} if "track" in sensor else {"speed_knots": 0.0, "heading_deg": 0.0, "start": [0.0, 0.0, -10.0]}
    if not {"profile", "sound_speed"} & set(water):
        water = {"sound_speed": 1500.0, **water}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "sonar_path", **(integrator or {})},
        "sensor": {"type": "array_sonar", "frequency_khz": 100.0, "noise": False, **place, **sensor,
                   "medium": {"type": "seawater", "absorption_db_per_km": 30.0, **water},
                   "film": {"type": "sonar_film", "range": 30.0, **(film or {})}},
        **shapes}, optimize=False, parallel=False)


def bed(depth, *, size=200.0, mu_db=-27.0):
    """A flat, level bed of two facets."""
    T = mi.ScalarTransform4f
    return {"type": "rectangle", "to_world": T().translate([0, 0, -depth]).scale([size / 2, size / 2, 1]),
            "bsdf": {"type": "lambert", "mu_db": float(mu_db)}}


def buried_bed(depth, *, size=200.0):
    """A bed that as good as scatters nothing: for tests of point targets alone."""
    return bed(depth, size=size, mu_db=-190.0)


def target(position, strength_db=0.0):
    """A point target."""
    return {"type": "point_target", "position": [float(v) for v in position], "target_strength_db": float(strength_db)}


def knots(speed):
    """Knots of a speed [m/s]."""
    return float(np.asarray(speed) * 3600 / 1852)
