"""Scene files as text, made of plugins whose attributes are written as Python has them."""


def plugin(tag, kind, name="", *within, **attributes):
    """Return the element of a plugin: its attributes by their types, a triple as a point, then what stands within."""
    tags = {bool: "boolean", int: "integer", float: "float", str: "string"}
    written = [f'<point name="{key}" x="{value[0]}" y="{value[1]}" z="{value[2]}"/>' if isinstance(value, tuple) else
               f'<{tags[type(value)]} name="{key}" value="{str(value).lower() if value in (True, False) else value}"/>'
               for key, value in attributes.items()]
    named = f' id="{name}"' if name else ""
    return f'<{tag} type="{kind}"{named}>\n{" ".join([*written, *within])}\n</{tag}>'


def lambert(mu_db, name=""):
    """Return the element of a material by Lambert's law."""
    return plugin("bsdf", "lambert", name, mu_db=float(mu_db))


def scene_text(*plugins, rays=None, integrator=""):
    """Return a scene file of its plugins, with an integrator of so many rays a ping and what else is within it."""
    path = plugin("integrator", "sonar_path", "", integrator, **({} if rays is None else {"rays": rays}))
    return "\n".join(['<scene version="3.0.0">', path, *plugins, "</scene>"])


def lit_bed(*shapes, bed="", profile="0:1500, 50:1500", water="", rays=100_000, bins=200, **sonar):
    """Return a scene file: a sidescan without speckle and noise 12 m above a level bed, which holds all its range."""
    sonar = {"pings": 4, "start": (0, -0.6, -18), "speed_knots": 15.0, "beam_width_deg": 3.0, **sonar}
    return scene_text(
        plugin("shape", "seabed", "bed", lambert(-25, "sand"), bed, depth=30.0, length=24.0, width=72.0), *shapes,
        plugin("sensor", "sidescan", "sonar", plugin("medium", "seawater", "", water, profile=profile),
               plugin("film", "sonar_film", range=34.0, bins=bins), speckle=False, noise=False, **sonar), rays=rays)
