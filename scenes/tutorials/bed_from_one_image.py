# %% [markdown]
# # The seabed from one sidescan image
#
# A slope that faces a sidescan is brighter, and the first return shows how deep the bed is. An image therefore
# contains information on the shape of the bed and, where the shape is known, on its sediments. mitsonar finds both by
# the gradients of its own images, and states the uncertainty of the answer.
#
# The image here is rendered, so that the answers can be checked. It has speckle, other rays than the model, and a bed
# that is 1 dB stronger than in the model.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import mitsonar  # before Mitsuba: it chooses the LLVM that Dr.Jit loads
import mitsuba as mi
import numpy as np

from mitsonar.inversion import Stage, fit_heights, fit_sediment_map

SCALE = float(os.environ.get("TUTORIAL_SCALE", 1))
PINGS = round(20 * SCALE)
folder = Path(tempfile.mkdtemp())

# %% [markdown]
# One scene serves for the truth and for the model: `$waves` is the height of the bed's waves, which is flat in the
# model, and `$strength` the scattering strength of the bed.

# %%
(folder / "scene.xml").write_text(f"""<scene version="3.0.0">
    <default name="waves" value="0"/> <default name="strength" value="-20"/> <default name="rays" value="4000"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="20"/> <float name="length" value="48"/> <float name="width" value="48"/>
        <float name="spacing" value="1.5"/>
        <float name="sine_wavelength" value="16"/> <float name="sine_height" value="$waves"/>
        <float name="sine_heading_deg" value="40"/>
        <bsdf type="lambert"><float name="mu_db" value="$strength"/></bsdf>
    </shape>
    <sensor type="sidescan" id="sonar">
        <float name="pulse_ms" value="0.1"/> <float name="beam_width_deg" value="1.5"/>
        <integer name="pings" value="{PINGS}"/> <float name="ping_rate_hz" value="{0.8 * SCALE}"/>
        <float name="speed_knots" value="3"/> <float name="heading_deg" value="0"/>
        <point name="start" x="0" y="-19" z="-10"/>
        <medium type="seawater"><string name="profile" value="0:1500, 12:1495, 18:1482, 30:1480"/></medium>
        <film type="sonar_film"><float name="range" value="22"/> <integer name="bins" value="200"/></film>
    </sensor>
</scene>""")
true_bed = mitsonar.load_file(folder / "scene.xml", waves=0.8, strength=-19, rays=40_000)
image = mitsonar.render(true_bed, seed=7)
plt.imshow(image.level[:, 1].T, aspect="auto", cmap="copper")
plt.title("starboard: level [dB re 1 µPa]")
plt.show()

# %% [markdown]
# The model is the same scene with a flat bed. Its gradients with respect to 1,089 heights cost about as much as an
# image.

# %%
scene = mitsonar.load_file(folder / "scene.xml")
model = mitsonar.scene_model(scene, ["bed.vertex_positions", "bed.bsdf.strength"], seed=1, edges=False)
about = model.linearised({})
lifted = np.zeros_like(model.start["bed.vertex_positions"])
lifted[:, 2] = 1
weights = np.random.default_rng(0).uniform(size=about.value.shape) / about.value.mean()
forward = about.forward({"bed.vertex_positions": lifted}) @ weights
backward = np.sum(about.backward(weights)["bed.vertex_positions"] * lifted)
print(model, forward, backward)
assert np.isclose(forward, backward, rtol=1e-3)

# %% [markdown]
# The fit begins with a flat bed at the depth of the first return. It goes from coarse bins to fine ones, weights bins
# by the statistics of speckle (gamma deviance), and stops when further steps no longer improve the fit.

# %%
stages = Stage(bins=8, steps=4, products=10), Stage(bins=4, steps=3, products=10)
fit = fit_heights(model, image, "bed.vertex_positions", strength="bed.bsdf.strength", stages=stages, farthest=21)
nodes = np.array(mi.traverse(true_bed)["bed.vertex_positions"]).reshape(-1, 3)
truth = nodes[:, 2].reshape(len(np.unique(nodes[:, 1])), -1).T                       # (x, y)
assert truth.shape == fit.height.shape
seen = (np.abs(fit.x.values)[:, None] > 3) & (np.abs(fit.x.values)[:, None] < 17) & (np.abs(fit.y.values) < 16)


def off(heights):
    """Root mean square error of heights that were seen [m], their mean left out: the first return says that."""
    error = (heights - truth)[seen]
    return float(np.std(error))


before, after = off(fit.height_start.values), off(fit.height.values)
print(f"off by {before:.2f} m before and {after:.2f} m after; said to be "
      f"{np.sqrt(np.mean(fit.height_deviation.values[seen] ** 2)):.2f} m; level {fit.gain_db:.2f} dB of 1; "
      f"{fit.stopped}")
assert after < 0.7 * before
assert np.all(fit.height_deviation.values <= fit.height_prior_deviation.values * (1 + 1e-6))
figure, axes = plt.subplots(1, 4, figsize=(16, 4), gridspec_kw={"wspace": 0.5})
for axis, title, values in zip(axes, ("truth", "start", "answer", "one deviation"),
                               (truth, fit.height_start, fit.height, fit.height_deviation)):
    drawn = axis.imshow(np.asarray(values).T, origin="lower", extent=(-24, 24, -24, 24),
                        **({} if title == "one deviation" else {"vmin": truth.min(), "vmax": truth.max()}))
    axis.set_title(f"{title} [m]")
    figure.colorbar(drawn, ax=axis, fraction=0.046)
plt.show()

# %% [markdown]
# Crests are in the right places, and the errors of the heights are smaller than before and about as large as the
# stated standard deviations. These cover speckle only, for a correct model: errors of navigation and levels add to
# them. Slopes along the track are hardly visible to the sonar. Where the shape is known, the same image gives the
# strength of the bed at each node of a texture, and the most probable sediment.

# %%
across, along = np.meshgrid(np.linspace(-1, 1, 24), np.linspace(-1, 1, 24))
painted = np.where(across + 0.4 * np.sin(3 * along) > 0.2, -14.0, -22.0).astype(np.float32)
texture = """<texture type="bitmap" name="mu_db"> <boolean name="raw" value="true"/>
    <string name="filename" value="$texture"/> </texture>"""
text = (folder / "scene.xml").read_text().replace('<float name="mu_db" value="$strength"/>', texture)
text = text.replace('<default name="strength" value="-20"/>', '<default name="texture" value="even.exr"/>')
(folder / "painted.xml").write_text(text)
mi.Bitmap(painted[..., None]).write(str(folder / "painted.exr"))
mi.Bitmap(np.full_like(painted, -19)[..., None]).write(str(folder / "even.exr"))
image = mitsonar.render(mitsonar.load_file(folder / "painted.xml", texture="painted.exr", rays=40_000), seed=8)
model = mitsonar.scene_model(mitsonar.load_file(folder / "painted.xml"), ["bed.bsdf.mu_db.data"], edges=False)
sediments = fit_sediment_map(model, image, "bed.bsdf.mu_db.data", classes={"sand": -22.0, "gravel": -14.0},
                             stages=stages, farthest=21)
inside = (np.abs(across) > 0.15) & (np.abs(across) < 0.7) & (np.abs(along) < 0.7)
right = np.mean((sediments.strength_db_class.values == (painted > -18))[inside])
print(f"{right:.0%} of the cells named rightly; off by "
      f"{np.sqrt(np.mean((sediments.strength_db.values - painted)[inside] ** 2)):.1f} dB rms, before "
      f"{np.sqrt(np.mean((-19 - painted)[inside] ** 2)):.1f}")
assert right > 0.85
assert np.sqrt(np.mean((sediments.strength_db.values - painted)[inside] ** 2)) < 3
figure, axes = plt.subplots(1, 3, figsize=(12, 4), gridspec_kw={"wspace": 0.5})
for axis, title, values in zip(axes, ("truth [dB]", "answer [dB]", "probability of gravel"),
                               (painted, sediments.strength_db,
                                sediments.strength_db_probability.sel(sediment="gravel"))):
    drawn = axis.imshow(values, **({} if "gravel" in title else {"vmin": -25, "vmax": -12}))
    axis.set_title(title)
    figure.colorbar(drawn, ax=axis, fraction=0.046)
plt.show()
