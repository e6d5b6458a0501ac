# %% [markdown]
# # Where the elements really are
#
# An array never matches its drawing: elements are millimetres off, channels differ in gain, and navigation is accurate
# to centimetres only. At 120 kHz a wavelength is 12 mm, and beams need a tenth of it. A few point targets in the water
# are enough to find most of these errors, and mitsonar reports which of them cannot be found.
#
# `mitsonar.inversion.calibrated` takes element signals as `mitsonar.element_signals` makes them, or as an
# instrument recorded them. Here they are made with a known array, so that the answers can be checked.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mitsonar
from mitsonar.inversion import calibrated, moved, sharpened, without_trend
from mitsonar.synthetic_aperture import ground_grid

PINGS = round(7 * float(os.environ.get("TUTORIAL_SCALE", 1)))
rng = np.random.default_rng(7)
folder = Path(tempfile.mkdtemp())
turn = np.arange(12) * np.pi / 6
drawing = np.stack([0.1 * np.cos(3 * turn), 0.25 * np.cos(turn), 0.25 * np.sin(turn)], 1)    # forward, starboard, down
truth = drawing + 2e-3 * rng.standard_normal(drawing.shape)
np.savetxt(folder / "elements.csv", truth, delimiter=",", header="x,y,z", comments="")
targets = np.array([(3, 15, -15), (-5, 19, -20), (7, 23, -17), (-2, 28, -22), (10, 30, -20)], float)

# %% [markdown]
# The sonar passes five targets over a seabed. The echoes of the targets have to stand out from its speckle.

# %%
shapes = "".join(f"""<shape type="point_target" id="target{number}">
    <point name="position" x="{x}" y="{y}" z="{z}"/><float name="target_strength_db" value="3"/></shape>"""
                 for number, (x, y, z) in enumerate(targets))
(folder / "scene.xml").write_text(f"""<scene version="3.0.0">
    <integrator type="sonar_path"><float name="cell" value="0.8"/></integrator>
    <sensor type="array_sonar" id="sonar">
        <float name="frequency_khz" value="120"/> <string name="pulse" value="lfm"/>
        <float name="bandwidth_khz" value="24"/> <float name="pulse_ms" value="1"/>
        <string name="receive" value="file"/> <string name="receive_file" value="elements.csv"/>
        <integer name="pings" value="{PINGS}"/> <float name="ping_rate_hz" value="4"/>
        <float name="speed_knots" value="4"/> <point name="start" x="-2" y="0" z="-12"/>
        <float name="heading_deg" value="80"/>
        <medium type="seawater"><string name="profile" value="0:1510, 10:1508, 15:1498, 30:1492"/></medium>
        <film type="sonar_film"><float name="range" value="40"/></film>
    </sensor>
    <shape type="seabed" id="bed"><float name="depth" value="26"/> <float name="length" value="120"/>
        <float name="width" value="120"/> <float name="spacing" value="10"/> <bsdf type="lambert"/></shape>
    {shapes}
</scene>""")
scene = mitsonar.load_file(folder / "scene.xml")
signals = mitsonar.element_signals(scene, list(range(PINGS)))
plt.imshow(20 * np.log10(np.abs(signals.values[0, 0]) + 1), aspect="auto", vmin=60, cmap="magma")
plt.title("what the elements hear of the first ping [dB re 1 µPa]")
plt.xlabel("sample")
plt.ylabel("element")
plt.show()

# %% [markdown]
# ## What is known beforehand
#
# The calibration starts with elements where the drawing has them. Channels differ by 15 %. Navigation is off by 5 cm
# at each ping, and so are the positions of the targets. The levels are not calibrated: 1 dB is missing.

# %%
gain = np.exp(0.15 * rng.standard_normal(len(truth)))
believed = signals.copy(data=(10 ** -0.05 * gain[:, None] * signals.values).astype(np.complex64))
off = 0.03 * rng.standard_normal((PINGS, 3))
for number, axis in enumerate("xyz"):
    believed = believed.assign_coords({f"rx_{axis}": ("rx", drawing[:, number]),
                                       axis: ("ping", signals[axis].values + off[:, number])})
places = targets + 0.03 * rng.standard_normal(targets.shape)

doubts = {"rx_position": 2e-3, "rx_delay": 0.0, "position_offset": 0.03, "target_position": 0.03,
          "attitude_offset": np.radians(0.05)}
answer = calibrated(believed, places, scene.sensors()[0].water.profile, believed=doubts)
print(*answer.sentences(), sep="\n")

# %% [markdown]
# Positions of targets and platform are known to centimetres only, so the whole array may be shifted and turned. Shapes
# are therefore compared after the best shift and turn.


# %%
def shape_off(found):
    """Offsets of elements [mm] after the best shift and turn."""
    apart = (found - found.mean(0)) - (truth - truth.mean(0))
    turns = np.stack([np.cross(axis, truth - truth.mean(0)) for axis in np.eye(3)], -1).reshape(-1, 3)
    return 1e3 * (apart.ravel() - turns @ np.linalg.lstsq(turns, apart.ravel(), rcond=None)[0]).reshape(-1, 3)


before, after = shape_off(drawing), shape_off(answer.values["rx_position"])
figure, axes = plt.subplots(1, 3, figsize=(12, 3.5), sharey=True)
for number, axis in enumerate(axes):
    axis.plot(before[:, number], "k:", label="drawing")
    axis.errorbar(np.arange(len(truth)), after[:, number], 1e3 * answer.uncertainty["rx_position"][:, number], fmt=".",
                  label="calibrated, and what it says of itself")
    axis.set(title=("forward", "starboard", "down")[number], xlabel="element")
axes[0].set_ylabel("off the truth [mm]")
axes[0].legend()
plt.show()
rms = [np.sqrt(np.mean(np.sum(part ** 2, 1))) for part in (before, after)]
print(f"shape: {rms[0]:.2f} mm off before, {rms[1]:.2f} mm after")
assert rms[1] < 0.4 * rms[0]
assert np.abs(answer.gain * gain.mean() / gain - 1).max() < 0.05

# %% [markdown]
# ## What is observable
#
# Each singular value compares the prior standard deviation of a combination of unknowns with the standard deviation
# that the data give it. Below 1, the answer is mostly prior. Navigation improves as far as five targets with uncertain
# positions allow.

# %%
plt.semilogy(answer.singular_values, ".")
plt.axhline(1, color="k", lw=0.5)
plt.xlabel("combination of unknowns")
plt.ylabel("doubt before / doubt of the data")
plt.show()
here = np.stack([signals[axis].values for axis in "xyz"], 1)
place = [np.sqrt(np.mean(np.sum((part - here) ** 2, 1))) for part in (here + off,
                                                                      here + off + answer.values["position_offset"])]
print(f"navigation: {1e3 * place[0]:.0f} mm off before, {1e3 * place[1]:.0f} mm after")
assert place[1] < 0.8 * place[0]
assert answer.effective < len(answer.singular_values)
assert any("not observable" in sentence for sentence in answer.sentences())

# %% [markdown]
# ## The track of a synthetic aperture
#
# Without targets, the sharpness of the image itself shows how the sonar swayed from ping to ping, except for a shift
# and a turn. Pings of a strip are focused one by one, and moved sideways until their sum is sharpest.

# %%
lying = np.stack([19 + rng.uniform(-0.8, 0.8, 15), rng.uniform(-0.8, 0.8, 15), rng.uniform(-26, -20, 15)], 1)
stones = "".join(f"""<shape type="point_target" id="stone{number}"><point name="position" x="{x:.3f}" y="{y:.3f}"
    z="-19.98"/><float name="target_strength_db" value="{level:.1f}"/></shape>"""
                 for number, (x, y, level) in enumerate(lying))
(folder / "strip.xml").write_text(f"""<scene version="3.0.0">
    <integrator type="sonar_path"><float name="cell" value="0.4"/></integrator>
    <sensor type="synthetic_aperture" id="sonar">
        <string name="preset" value="wideband_90khz"/> <integer name="receivers" value="8"/>
        <integer name="overlap" value="2"/> <integer name="banks" value="1"/> <float name="pulse_ms" value="1"/>
        <integer name="pings" value="24"/> <float name="speed_knots" value="3"/>
        <point name="start" x="0" y="-1.35" z="-10"/>
        <medium type="seawater"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range_min" value="20"/><float name="range" value="23"/></film>
    </sensor>
    <shape type="seabed" id="bed"><float name="depth" value="20"/> <float name="length" value="80"/>
        <float name="width" value="80"/> <float name="spacing" value="10"/> <bsdf type="lambert"/></shape>
    {stones}
</scene>""")
raw = mitsonar.raw_echoes(folder / "strip.xml")

# %% [markdown]
# The recorded trajectory lacks 3 mm of sway.

# %%
ping = np.arange(24)
sway = np.exp(-0.5 * ((ping[:, None] - ping) / 3) ** 2) @ rng.standard_normal(24)
sway = without_trend(sway, ping)
sway *= 3e-3 / sway.std()
grid = ground_grid((-1.0, 1.0), (18.0, 20.0), (0.03, 0.03), 20.0)
found = sharpened(raw, grid, trajectory=moved(raw, raw["ping_time"].values, -sway))
print(*found.sentences(), sep="\n")
figure, axes = plt.subplots(1, 3, figsize=(12, 3.5))
loudest = 20 * np.log10(np.abs(found.after).max())
for axis, image, title in ((axes[0], found.before, "as believed"), (axes[1], found.after, "sharpened")):
    axis.imshow(20 * np.log10(np.abs(image) + 1e-9), vmin=loudest - 35, vmax=loudest, cmap="magma", origin="lower")
    axis.set_title(title)
axes[2].plot(ping, 1e3 * sway, "k", label="truth")
axes[2].axhline(0, ls=":", label="believed")
axes[2].errorbar(ping, 1e3 * found.sway, 1e3 * found.uncertainty, fmt=".", label="found")
axes[2].set(xlabel="ping", ylabel="sway [mm]")
axes[2].legend()
plt.show()
error = np.std(found.sway - sway)
print(f"sway: {1e3 * sway.std():.1f} mm before, {1e3 * error:.2f} mm off after")
assert error < 0.25 * sway.std()
assert found.contrast[1] > 2 * found.contrast[0]
