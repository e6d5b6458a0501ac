"""Small scenes for comparisons of the whole chain, as Mitsuba dictionaries.

    scene = sidescan({"bed": bed(40.0), "ball": point_target([30.0, 0.0, -38.0])}, film={"range": 60.0})

Every scene has a sonar that stands still at x = y = 0 and looks north, in water of 1500 m/s, without speckle and noise.
Sidescans are without flaws: no side lobes, no crosstalk between the sides, no noise of their own, no quantization, no
jitter.
The arguments ``sensor``, ``water``, ``film`` and ``integrator`` add attributes to these, or replace them.
"""
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mitsuba as mi

    from mitsonar.water.profile import SoundSpeedProfile

Attributes = Mapping[str, object]      # of a plugin, by their names in XML

FLAWLESS: Attributes = {"sidelobe_db": -200.0, "vertical_sidelobe_db": -200.0, "back_db": -200.0,
                        "crosstalk_db": -200.0, "chirp_ms": 0.0, "self_noise_db": -200.0, "recorder": "none",
                        "yaw_jitter_deg": 0.0, "phase_jitter_deg": 0.0}


def sidescan(shapes: Mapping[str, object], *, depth: float = 20.0, pings: int = 4, rays: int = 100_000,
             sensor: Attributes | None = None, water: Attributes | None = None, film: Attributes | None = None,
             integrator: Attributes | None = None) -> "mi.Scene":
    """Load a scene of a sidescan, by default of 100 kHz and 1000 bins to 100 m."""
    # depth [m]
    return loaded(shapes, {"type": "sidescan", "preset": "towed_100khz", "speckle": False, **FLAWLESS},
                  {"pings": pings, **at_rest(depth)}, sensor, water, {"range": 100.0, "bins": 1000, **(film or {})},
                  {"rays": rays, **(integrator or {})})


def array_sonar(shapes: Mapping[str, object], *, depth: float = 10.0, sensor: Attributes | None = None,
                water: Attributes | None = None, film: Attributes | None = None,
                integrator: Attributes | None = None) -> "mi.Scene":
    """Load a scene of one omnidirectional transducer, by default 100 kHz to 30 m; see `sidescan`."""
    return loaded(shapes, {"type": "array_sonar", "frequency_khz": 100.0}, at_rest(depth), sensor, water,
                   {"range": 30.0, **(film or {})}, integrator or {})


def at_rest(depth: float) -> dict[str, object]:
    """Return the attributes of a sensor that does not move and looks north, at a depth [m]."""
    return {"speed_knots": 0.0, "heading_deg": 0.0, "start": [0.0, 0.0, -float(depth)]}


def loaded(shapes: Mapping[str, object], kind: Attributes, still: Attributes, sensor: Attributes | None,
            water: Attributes | None, film: Attributes, integrator: Attributes) -> "mi.Scene":
    """Load a scene with a sensor of the attributes `kind`, which stands `at_rest` unless it follows a track."""
    from mitsonar.scene.loading import prepare

    prepare()
    import mitsuba as mi

    sensor, water = sensor or {}, water or {}
    place = {} if "track" in sensor else still
    speed = {} if {"profile", "cast", "casts", "field_file"} & set(water) else {"sound_speed": 1500.0}
    # the value None leaves an attribute out
    written = {name: value for name, value in {**kind, "noise": False, **place, **sensor}.items() if value is not None}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "sonar_path", **integrator},
        "sensor": {**written,
                   "medium": {"type": "seawater", "absorption_db_per_km": 30.0, **speed, **water},
                   "film": {"type": "sonar_film", **film}},
        **shapes}, optimize=False, parallel=False)


def water_of(profile: "SoundSpeedProfile") -> dict[str, object]:
    """Return the attributes of water with a sound speed profile."""
    if len(profile.depth) == 1:
        return {"sound_speed": float(profile.sound_speed[0])}
    return {"profile": ", ".join(f"{depth:g}:{speed:g}" for depth, speed in zip(profile.depth, profile.sound_speed))}


def bed(depth: float, material: Attributes | None = None, *, size: float = 800.0,
        tilt: float = 0.0) -> dict[str, object]:
    """Return the description of a flat bed of two facets."""
    # depth [m]; size [m]; tilt [rad]
    from mitsonar.scene.loading import prepare

    prepare()
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate([0, 0, -float(depth)])
    place = place.rotate([0, 1, 0], float(np.rad2deg(tilt))).scale([size / 2, size / 2, 1])
    return {"type": "rectangle", "to_world": place, "bsdf": dict(material or lambert())}


def buried_bed(depth: float, *, size: float = 200.0) -> dict[str, object]:
    """Return the description of a bed with negligible scattering, for scenes of targets."""
    return bed(depth, lambert(-190.0), size=size)


def lambert(mu_db: float = -27.0) -> dict[str, object]:
    """Return the description of a material of Lambert's law with the strength µ [dB]."""
    return {"type": "lambert", "mu_db": float(mu_db)}


def sediment(name: str) -> dict[str, object]:
    """Return the description of the material of a named sediment."""
    return {"type": "sediment", "sediment": name}


def point_target(position: Sequence[float] | np.ndarray, strength_db: float = 0.0) -> dict[str, object]:
    """Return the description of a point target at a place (3,) [m] with a target strength [dB re 1 m²]."""
    return {"type": "point_target", "position": [float(one) for one in position],
            "target_strength_db": float(strength_db)}
