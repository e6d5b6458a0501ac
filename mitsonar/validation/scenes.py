"""Small scenes for comparisons of the whole chain, as Mitsuba dictionaries."""

__all__ = ["array_sonar", "bed", "buried_bed", "lambert", "point_target", "sediment", "sidescan", "water_of"]


def sidescan(shapes, *, depth, sensor=None, water=None, film=None, rays=1_000_000, pings=2):
    """Load a scene of a sidescan that stands still at the origin, speckle and noise off, heading north.

    Parameters
    ----------
    shapes : dict of str to dict
        By their ids.
    depth : float [m]
        Of the sonar.
    sensor, water, film : dict
        Changes to their attributes.
    rays, pings : int

    Returns
    -------
    mitsuba.Scene
    """
    place = {"pings": pings, "speed_knots": 0.0, "heading_deg": 0.0, "start": [0.0, 0.0, -float(depth)]}
    return _load({"type": "sidescan", "preset": "towed_100khz", "speckle": False, "noise": False, **place,
                  **(sensor or {})}, water, film, {"rays": rays}, shapes)


def array_sonar(shapes, *, depth, sensor=None, water=None, film=None, integrator=None):
    """Load a scene of one omnidirectional element that sends and hears, still and without noise; as `sidescan`."""
    place = {"speed_knots": 0.0, "heading_deg": 0.0, "start": [0.0, 0.0, -float(depth)]}
    return _load({"type": "array_sonar", "frequency_khz": 100.0, "noise": False, **place, **(sensor or {})}, water,
                 film, integrator or {}, shapes)


def _load(sensor, water, film, integrator, shapes):
    from ..scene.loading import prepare

    prepare()
    import mitsuba as mi

    water = dict(water or {})
    if not {"profile", "sound_speed"} & set(water):
        water["sound_speed"] = 1500.0
    return mi.load_dict({
        "type": "scene", "integrator": {"type": "sonar_path", **integrator},
        "sensor": {**sensor, "medium": {"type": "seawater", "absorption_db_per_km": 30.0, **water},
                   "film": {"type": "sonar_film", "range": 100.0, **(film or {})}},
        **shapes}, optimize=False)


def water_of(profile):
    """The attributes of water with a sound speed profile."""
    if len(profile.depth) == 1:
        return {"sound_speed": float(profile.sound_speed[0])}
    return {"profile": ", ".join(f"{depth:g}:{speed:g}" for depth, speed in zip(profile.depth, profile.sound_speed))}


def bed(depth, material, *, size=800.0):
    """A flat, level bed of two facets, `size` [m] square."""
    from ..scene.loading import prepare

    prepare()
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate([0, 0, -float(depth)]).scale([size / 2, size / 2, 1])
    return {"type": "rectangle", "to_world": place, "bsdf": material}


def buried_bed(depth, *, size=200.0):
    """A bed that as good as scatters nothing: for targets alone."""
    return bed(depth, lambert(-190.0), size=size)


def lambert(mu_db):
    """A material of Lambert's law."""
    return {"type": "lambert", "mu_db": float(mu_db)}


def sediment(name):
    """The material of a named sediment."""
    return {"type": "sediment", "sediment": name}


def point_target(position, strength_db=0.0):
    """A point target at a place [m]."""
    return {"type": "point_target", "position": [float(one) for one in position],
            "target_strength_db": float(strength_db)}
