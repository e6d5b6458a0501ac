# %% [markdown]
# # A vehicle that follows a pipe
#
# So far every track was planned before the first ping. Here a vehicle decides after each frame of its forward-looking
# sonar where to go next. It does not know where the pipe lies; it has nothing but its frames. `mitsonar.Sonar` gives
# them one by one, each at the pose that the vehicle has reached by then.
#
# An `assert` checks every number in the text.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mitsonar

SCALE = float(os.environ.get("TUTORIAL_SCALE", 1))         # 1: 32 elements, half a minute; 2: twice as many
ELEMENTS, BEAMS = round(32 * SCALE), round(61 * SCALE)
DEPTH, ALTITUDE, RADIUS = 15.0, 3.0, 0.3                   # [m], of the bed; of the vehicle over it; of the pipe
SPEED, INTERVAL = 1.0, 0.5                                 # [m/s]; [s] between pings
folder = Path(tempfile.mkdtemp(prefix="closed_loop_"))

# %% [markdown]
# ## A bed with a pipe
#
# The pipe winds from south to north over a rippled bed, half of it above the sand. We sweep a circle along its middle
# line, and write the facets to a file. The pipe is overgrown, so that it scatters sound in all directions.

# %%
along = np.linspace(-40.0, 40.0, 321)
middle = np.stack([5 * np.sin(2 * np.pi * along / 50), along], 1)                       # (N, 2) [m], east and north
course = np.gradient(middle, along, axis=0)
course /= np.linalg.norm(course, axis=1, keepdims=True)
side = np.stack([course[:, 1], -course[:, 0]], 1)                                       # to starboard
angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
ring = np.concatenate([middle[:, None] + RADIUS * np.cos(angle)[:, None] * side[:, None],
                       np.broadcast_to(RADIUS * np.sin(angle)[:, None] - DEPTH, (len(along), 12, 1))], 2)
number = np.arange(12 * len(along)).reshape(len(along), 12) + 1
a, b = number[:-1], number[1:]
quads = np.stack([a, b, np.roll(b, -1, 1), np.roll(a, -1, 1)], -1).reshape(-1, 4)
lines = [*("v {} {} {}".format(*row) for row in ring.reshape(-1, 3)), *("f {} {} {} {}".format(*row) for row in quads)]
(folder / "pipe.obj").write_text("\n".join(lines), encoding="utf-8")

(folder / "scene.xml").write_text(f"""
<scene version="3.0.0">
  <integrator type="sonar_path"/>
  <shape type="seabed" id="seabed">
    <float name="depth" value="{DEPTH}"/> <float name="length" value="90"/> <float name="width" value="50"/>
    <float name="spacing" value="0.2"/> <float name="ripple_wavelength" value="1.4"/>
    <float name="ripple_height" value="0.05"/> <float name="ripple_heading_deg" value="60"/>
    <bsdf type="lambert"> <float name="mu_db" value="-27"/> </bsdf>
  </shape>
  <shape type="obj" id="pipe">
    <string name="filename" value="pipe.obj"/>
    <bsdf type="lambert"> <float name="mu_db" value="-14"/> </bsdf>
  </shape>
  <sensor type="forward_looking" id="sonar">
    <float name="frequency_khz" value="300"/> <string name="pulse" value="lfm"/>
    <float name="bandwidth_khz" value="20"/> <float name="pulse_ms" value="0.3"/>
    <integer name="receive_elements" value="{ELEMENTS}"/> <float name="element_spacing" value="0.5"/>
    <string name="receive_shading" value="hamming"/> <boolean name="noise" value="true"/>
    <integer name="beams" value="{BEAMS}"/> <float name="fan_deg" value="90"/>
    <float name="tilt_deg" value="18"/> <float name="vertical_beam_width_deg" value="40"/>
    <point name="start" x="0" y="0" z="{ALTITUDE - DEPTH}"/> <float name="speed_knots" value="2"/>
    <medium type="seawater"/>
    <film type="sonar_film"> <float name="range_min" value="4"/> <float name="range" value="11"/> </film>
  </sensor>
</scene>""", encoding="utf-8")
scene = mitsonar.load_file(folder / "scene.xml")

# %% [markdown]
# ## What a frame shows
#
# The vehicle begins two metres to the west of the pipe, which runs to the north-west there, and looks north.

# %%
start = np.array([middle[40, 0] - 2.0, middle[40, 1]])
sonar = mitsonar.Sonar(scene, seed=1)
frame = sonar.ping(position=(*start, ALTITUDE - DEPTH), velocity=(0, SPEED, 0))
frame


def show_frame(frame, title):
    """Draw the levels of a frame over bearing and range."""
    level = frame["level"].values[0]
    plt.pcolormesh(np.degrees(frame["bearing"]), frame["range"], level.T, cmap="gray", vmin=level.max() - 50,
                   shading="auto")
    plt.title(title)


plt.figure(figsize=(6, 4))
show_frame(frame, "level [dB re 1 µPa]")
plt.xlabel("bearing [degrees], to starboard")
plt.ylabel("slant range [m]")
plt.tight_layout()
plt.show()

# %% [markdown]
# The pipe is the bright line that begins ahead and leaves to port. We divide the energy of each range by its
# median over all beams, which leaves what is brighter than the bed, and average over the ranges about a look-ahead of
# 7 m. The bearing of the brightest beam is the answer, and its height over the others says how sure it is.

# %%
AHEAD, BAND = 7.0, 1.0                                     # [m], slant range to which we look, and half a band about it
SURE = 6.0                                                 # [dB] over the median bearing


def find(frame):
    """Return the bearing [rad] of what stands out of the bed ahead, and by how many dB it does."""
    near = (np.abs(frame["range"].values - AHEAD) < BAND)
    energy = 10 ** (frame["level"].values[0][:, near] / 10)
    contrast = (energy / np.median(energy, 0)).mean(1)
    contrast = np.convolve(contrast, np.ones(3) / 3, "same")
    best = int(np.argmax(contrast))
    return float(frame["bearing"][best]), float(10 * np.log10(contrast[best] / np.median(contrast)))


bearing, contrast = find(frame)
print(f"the pipe is {-np.degrees(bearing):.0f} degrees to port, {contrast:.0f} dB over the bed")
assert 5 < -np.degrees(bearing) < 25 and contrast > SURE

# %% [markdown]
# ## The loop
#
# A vehicle at the speed v that is to reach a point at the bearing β and the distance L on a circle turns at the rate
# 2 v sin β / L (pure pursuit; Coulter, 1992). Ours cannot turn faster than 0.3 rad/s, and goes on as it did where
# nothing stands out. Velocity and turn rate hold while echoes arrive, and then carry the vehicle to its next ping.

# %%
MOST_TURN = 0.3                                            # [rad/s]


def sail(sonar, place, heading, pings, steer=True):
    """Run a vehicle for a number of pings; return its places (P, 2) [m], the bearings that it found, and frames."""
    ahead = np.sqrt(AHEAD ** 2 - ALTITUDE ** 2)            # [m] over ground
    way, bearings, frames, turn = [], [], [], 0.0
    for ping in range(pings):
        course = np.array([np.sin(heading), np.cos(heading)])
        frame = sonar.ping(position=(*place, ALTITUDE - DEPTH), attitude=(0, 0, heading),
                           velocity=(*SPEED * course, 0), turn_rate=(0, 0, -turn), time=INTERVAL * ping)
        bearing, contrast = find(frame)
        way.append(place)
        bearings.append(bearing if contrast > SURE else np.nan)
        frames.append(frame)
        if steer and contrast > SURE:
            turn = float(np.clip(2 * SPEED * np.sin(bearing) / ahead, -MOST_TURN, MOST_TURN))
        half_way = heading + 0.5 * turn * INTERVAL
        place = place + SPEED * INTERVAL * np.array([np.sin(half_way), np.cos(half_way)])
        heading += turn * INTERVAL
    return np.array(way), np.array(bearings), frames


PINGS = 130
with mitsonar.Sonar(scene, seed=1) as sonar:
    way, bearings, frames = sail(sonar, start, 0.0, PINGS)
    print(sonar)
with mitsonar.Sonar(scene, seed=1) as sonar:
    straight = sail(sonar, start, 0.0, 40, steer=False)[0]

# %% [markdown]
# ## Its way
#
# Only now do we look at where the pipe lies. The vehicle cuts corners a little, because the pipe bends within the six
# metres that it looks ahead. Without steering, it leaves the pipe.


# %%
def away(way):
    """Return the distances of places (P, 2) from the pipe's middle line [m]."""
    return np.linalg.norm(way[:, None] - middle, axis=-1).min(1)


settled = away(way)[20:]
print(f"{np.isfinite(bearings).mean():.0%} of the frames show the pipe. After 10 s, the vehicle is at most "
      f"{settled.max():.2f} m beside it, {np.sqrt(np.mean(settled ** 2)):.2f} m rms; without steering, up to "
      f"{away(straight).max():.1f} m.")
assert np.isfinite(bearings).mean() > 0.95
assert settled.max() < 0.8 and np.sqrt(np.mean(settled ** 2)) < 0.5
assert away(straight).max() > 5
assert way[-1, 1] - way[0, 1] > 50                         # it got along, too

fig, (map_view, beside) = plt.subplots(2, 1, figsize=(9, 6))
map_view.plot(*middle.T[::-1], color="0.7", linewidth=6, label="pipe")
map_view.plot(*way.T[::-1], color="tab:blue", label="vehicle")
map_view.plot(*straight.T[::-1], color="tab:orange", linestyle=":", label="without steering")
map_view.plot(*start[::-1], "o", color="tab:blue")
map_view.set(xlabel="y [m], north", ylabel="x [m], east", aspect="equal", xlim=(-34, 40), ylim=(8, -8))
map_view.legend(loc="lower right", ncols=3)
time = INTERVAL * np.arange(PINGS)
beside.plot(time, away(way), label="distance from the pipe [m]")
beside.plot(time, np.degrees(bearings) / 10, label="bearing found [10 degrees]")
beside.set(xlabel="time [s]")
beside.legend(loc="upper right")
plt.tight_layout()
plt.savefig(folder / "way.png", dpi=120)
print(f"its way is drawn in {folder / 'way.png'}")
plt.show()

# %% [markdown]
# Six of its frames, with the bearing that it took from each:

# %%
plt.figure(figsize=(10, 5.5))
for number, ping in enumerate(range(5, PINGS, PINGS // 6)[:6], 1):
    plt.subplot(2, 3, number)
    show_frame(frames[ping], f"{time[ping]:.1f} s")
    plt.plot(np.degrees(bearings[ping]), AHEAD, "r+", markersize=12)
plt.tight_layout()
plt.show()

# %% [markdown]
# ## The truth of its frames
#
# Frames are records as any other, and hold the truth of each bin. `label` says which shape stands behind it, so the
# bearings that the vehicle used can be judged afterwards: they are those of bins whose strongest echo is the pipe's.

# %%
pipe = next(int(number) for number, name in frames[0].attrs["labels"].items() if name == "pipe")
off = []
for frame, bearing in zip(frames, bearings):
    near = np.abs(frame["range"].values - AHEAD) < BAND
    share = (frame["label"].values[0][:, near] == pipe).mean(1)            # of a beam's bins, that show the pipe
    if share.any() and np.isfinite(bearing):
        off.append(bearing - np.sum(share * frame["bearing"].values) / share.sum())
width = 1.3 / (0.5 * ELEMENTS)                             # [rad] at -3 dB, of a Hamming window half a wavelength apart
print(f"bearings are off by {np.degrees(np.sqrt(np.mean(np.square(off)))):.1f} degrees rms; a beam is "
      f"{np.degrees(width):.1f} degrees wide")
assert len(off) > 0.9 * PINGS and np.degrees(np.sqrt(np.mean(np.square(off)))) < 3

# %% [markdown]
# ## The same way again
#
# A loop is as reproducible as a planned track: frames follow from the scene, the seed and the poses, and these follow
# from the frames. Another seed has other noise and other speckle, and the vehicle finds its way there as well.

# %%
with mitsonar.Sonar(scene, seed=1) as again, mitsonar.Sonar(scene, seed=2) as other:
    repeated, elsewhere = (sail(sonar, start, 0.0, 30)[0] for sonar in (again, other))
assert np.array_equal(repeated, way[:30])
assert not np.array_equal(elsewhere, way[:30]) and np.abs(elsewhere - way[:30]).max() < 0.5
