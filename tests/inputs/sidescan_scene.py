"""Small sidescan scenes for tests, built as Mitsuba dictionaries."""
import mitsuba as mi
import numpy as np

import mitsonar
from mitsonar.scene.loading import prepare

LEVEL = {"speckle": False, "noise": False}


def sidescan(shapes, *, sensor=None, water=None, film=None, rays=100_000, first_pass=0.15):
    """Load a scene: shapes {id: dict}, and changes to the sensor's, water's and film's attributes."""
    prepare()
    water = water or {}
    if "profile" not in water:
        water = {"sound_speed": 1500.0, **water}
    sensor = sensor or {}
    if "track" not in sensor:
        sensor = {"pings": 4, "speed_knots": 0.0, "heading_deg": 0.0, "start": [0.0, 0.0, -20.0], **sensor}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "sonar_path", "rays": rays, "first_pass": first_pass},
        "sensor": {"type": "sidescan", "preset": "towed_100khz", **LEVEL, **sensor,
                   "medium": {"type": "seawater", "absorption_db_per_km": 30.0, **water},
                   "film": {"type": "sonar_film", "range": 100.0, "bins": 1000, **(film or {})}},
        **shapes}, optimize=False, parallel=False)


def lambert(mu_db=-27.0):
    """A Lambert material."""
    return {"type": "lambert", "mu_db": float(mu_db)}


def plane(depth, *, half=400.0, mu_db=-27.0, tilt=0.0):
    """A square of seabed, tilted about the north axis by `tilt` [rad] (deeper to the east)."""
    T = mi.ScalarTransform4f
    to_world = T().translate([0, 0, -depth]).rotate([0, 1, 0], float(np.rad2deg(tilt))).scale([half, half, 1])
    return {"type": "rectangle", "to_world": to_world, "bsdf": lambert(mu_db)}


def render(scene, seed=0):
    """`mitsonar.render`, and the mean intensity over pings, (side, bin) [µPa²], with its standard error."""
    dataset = mitsonar.render(scene, seed)
    intensity = 10 ** (dataset["mean_level"].values.astype(float) / 10)
    return dataset, intensity.mean(0), intensity.std(0, ddof=1) / np.sqrt(len(intensity))
