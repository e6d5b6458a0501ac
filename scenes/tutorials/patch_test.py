# %% [markdown]
# # A patch test by your own code
#
# Before a survey, a launch runs pairs of lines over a level bed and over a slope. Each wrong angle, delay, lever arm or
# water level makes the lines disagree in a way of its own. The scene `patch_test` has such lines, and its sensors can
# be wrong on purpose. Here seven errors are put in at once, and found again by forty lines of NumPy that share nothing
# with the reduction of mitsonar: they take travel times, angles and what the sensors state, and no truth.

# %%
import os

import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import mitsonar

RATE = 0.5 * float(os.environ.get("TUTORIAL_SCALE", 1))                  # [1/s] pings: 6 m apart
SPEED = 1500.0                                                           # [m/s] of sound in this water

# %% [markdown]
# ## The lines
#
# The roll pair runs one way and back over the level bed, the pitch pair up and down the slope, the latency pair the
# same way at 6 and 12 knots, the heading pair side by side. Two lines are run in the afternoon, with a tide that is 30
# cm too low.

# %%
WRONG = {"roll_bias_deg": 0.4, "pitch_bias_deg": -0.8, "heading_bias_deg": 1.2, "latency_ms": 60,
         "position_latency_ms": 350, "motion_sensor_error": "4, 0, 0"}
TIDE = -0.3
NAMES = ("roll_a", "roll_b", "pitch_a", "pitch_b", "latency_a", "latency_b", "heading_a", "heading_b")
AFTERNOON = ("roll_b", "heading_b")


def sounded(name, number):
    """Run a line: 48 beams, a coarse bed that loads fast, waves of its own, the same errors."""
    fast = {"speed_knots": 12, "ping_rate": 2 * RATE} if name == "latency_b" else {"ping_rate": RATE}
    return mitsonar.soundings("patch_test", seed=number, line=name, beams=48, bed_spacing=0.5, motion_seed=number + 1,
                              tide_error=TIDE if name in AFTERNOON else 0.0, **fast, **WRONG)


lines = {name: sounded(name, number) for number, name in enumerate(NAMES)}
figure, axes = plt.subplots(figsize=(7, 4))
for name in ("pitch_a", "pitch_b"):
    line = lines[name]
    middle = line.isel(beam=slice(22, 26))
    axes.plot(middle["y"].values.ravel(), middle["depth"].values.ravel(), ".", label=name)
axes.invert_yaxis()
axes.set_xlabel("north [m]")
axes.set_ylabel("depth [m]")
axes.legend()
plt.show()
apart = float(lines["pitch_a"]["error"].where(lines["pitch_a"]["valid"]).std())
print(f"up and down the same slope, the soundings are off by {apart:.2f} m rms")
assert apart > 0.1

# %% [markdown]
# ## A reduction of our own
#
# In water of one speed, rays are straight. A sounding lies on the cone about the transmitting array at transmission, on
# the cone about the receiving array at reception, and half the two-way time away from the point midway between both
# places. Those lie an arm and the launch's way apart: without that, soundings would lag by half the way, as much as by
# 22 ms of position latency. Sensors state what was true a latency ago: attitude and heave by one latency, positions by
# another. The heave of a motion sensor is carried to the reference point by its lever arm, so that a wrong arm turns
# pitch into heave.

# %%
FIELDS = ("x", "y", "depth", "roll", "pitch", "heading")
ERRORS = ("roll [deg]", "pitch [deg]", "heading [deg]", "latency [ms]", "position latency [ms]", "arm forward [m]",
          "tide [m]")
TRUTH = np.array([0.4, -0.8, 1.2, 60, 350, 4.0, TIDE])
SCALE = np.array([*3 * [np.pi / 180], 1e-3, 1e-3, 1, 1])                  # to SI and radians


def curve(line):
    """Return a function of time: what the sensors state, as a table of `FIELDS`."""
    columns = [np.unwrap(line[f"motion_{name}"].values) if name == "heading" else line[f"motion_{name}"].values
               for name in FIELDS]
    return make_interp_spline(line["motion_time"].values, np.stack(columns, -1), k=1)


def measured(line):
    """Return times of transmission, two-way times, receiving and transmitting angles, and arrays' offsets."""
    valid = line["valid"].values
    sent = np.broadcast_to(line["ping_time"].values[:, None], valid.shape)[valid]
    return (sent, *(line[name].values[valid] for name in ("travel_time", "angle", "transmit_angle")),
            line["transmit_offset"].values, line["receive_offset"].values)


def placed(stated, data, errors, afternoon):
    """Return soundings as north, east, down, with the sensors' errors (7,) taken away."""
    roll, pitch, heading, late, fix, arm, tide = errors * SCALE
    sent, travel, angle, tilt, *offsets = data
    places, axes = [], []
    for when, axis, offset in zip((sent, sent + travel), np.eye(3)[:2], offsets):
        east, north = stated(when + fix)[:, :2].T
        depth, *attitude = stated(when + late)[:, 2:].T
        turn = Rotation.from_euler("ZYX", np.stack(attitude, -1)[:, ::-1] - [heading, pitch, roll])
        down = depth - arm * np.sin(attitude[1]) + tide * afternoon
        places.append(np.stack([north, east, down], -1) + turn.apply(offset))
        axes.append(turn.apply(axis))
    ahead, aside = axes
    cosine, below = np.sum(ahead * aside, -1), np.cross(ahead, aside)
    share = 1 / (1 - cosine**2)
    apart = (places[1] - places[0]) / (SPEED * travel[:, None])          # cones about both places, from midway
    first, second = np.sin(tilt) - np.sum(apart * ahead, -1), np.sin(angle) + np.sum(apart * aside, -1)
    level = (((first - cosine * second) * share)[:, None] * ahead
             + ((second - cosine * first) * share)[:, None] * aside)
    towards = level + np.sqrt((1 - np.sum(level**2, -1)) * share)[:, None] * below
    return 0.5 * (places[0] + places[1]) + 0.5 * SPEED * travel[:, None] * towards


curves, data = {}, {}
for name, line in lines.items():
    curves[name], data[name] = curve(line), measured(line.isel(beam=slice(None, None, 2)))
unchanged = placed(curves["roll_a"], data["roll_a"], np.zeros(7), 0)
theirs = lines["roll_a"]["depth"].values[:, ::2][lines["roll_a"]["valid"].values[:, ::2]]
print(f"without corrections, both reductions differ by {1e3 * np.abs(unchanged[:, 2] - theirs).max():.0f} mm at most")
assert np.abs(unchanged[:, 2] - theirs).max() < 0.01

# %% [markdown]
# ## The errors
#
# Both parts of the bed are taken for planes, whose heights and slopes are unknown, too. The errors are those with which
# all lines lie on the same planes.

# %%
def misfit(unknown, names=NAMES):
    """Return how far soundings lie below their plane."""
    parts = []
    for name in names:
        north, east, down = placed(curves[name], data[name], unknown[:7], name in AFTERNOON).T
        height, along, across = unknown[7:10] if name.startswith("roll") else unknown[10:13]
        parts.append(down - height - along * north - across * east)
    return np.concatenate(parts)


start = np.array([*7 * [0.0], 15, 0, 0, 15, 0.2, 0])
typical = np.array([1, 1, 1, 100, 100, 1, 0.3, 1, 0.01, 0.01, 1, 0.01, 0.01])
fit = least_squares(misfit, start, x_scale=typical, loss="soft_l1", f_scale=0.05)
before, after = (float(np.sqrt(np.mean(misfit(one) ** 2))) for one in (start, fit.x))
deviation = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))[:7] * after
found = fit.x[:7]
for name, value, spread, true in zip(ERRORS, found, deviation, TRUTH):
    print(f"{name:22s} {value:8.2f} +- {spread:.2f}, put in: {true:g}")
print(f"soundings lie on their planes to {after:.3f} m rms, {before:.2f} m before")
assert after < 0.05 < 0.3 < before
assert (np.abs(found - TRUTH) < [0.02, 0.15, 0.15, 3, 20, 0.15, 0.02]).all(), found

# %% [markdown]
# The standard deviations take soundings to be independent. Neighbours share the roughness of the bed, so that the
# deviations are too small by some part.

# %%
figure, axes = plt.subplots(figsize=(7, 4))
axes.errorbar(np.arange(7), (found - TRUTH) / typical[:7], yerr=deviation / typical[:7], fmt="o")
axes.axhline(0, color="0.6")
axes.set_xticks(np.arange(7), [f"{name}\n/ {one:g}" for name, one in zip(ERRORS, typical)], fontsize=7)
axes.set_ylabel("found less put in")
plt.show()

# %% [markdown]
# ## What each line shows
#
# Before the fit, residuals differ from line to line; after it, they are those of the bed's roughness and of detection.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), sharey=True)
for axes, unknown, title in ((left, np.r_[np.zeros(7), fit.x[7:]], "as measured"), (right, fit.x, "corrected")):
    for name in NAMES:
        rest = misfit(unknown, [name])
        axes.plot(np.sort(rest), np.linspace(0, 1, rest.size), label=name)
    axes.set_title(title)
    axes.set_xlabel("below the plane [m]")
left.set_ylabel("share of soundings")
left.legend(fontsize=7)
plt.show()
assert max(np.abs(np.median(misfit(fit.x, [name]))) for name in NAMES) < 0.03

# %% [markdown]
# ## The tide by another way
#
# The scene's water has a separation, so that the record also states heights above the ellipsoid. They need neither tide
# nor heave: the water level that follows from them, less the one that the line was reduced with, is the error of the
# tide, but for the heave that the wrong arm turns the pitch into. It was found above.

# %%
line = lines["heading_b"]
higher = line["ping_height"] - line["separation"] + line["ping_depth"]
induced = found[5] * np.sin(line["ping_pitch"])
off = float((induced - higher).mean())
print(f"the tide in use is off by {off:.3f} m; with the induced heave it would seem {float(-higher.mean()):.3f} m")
assert abs(off - TIDE) < 0.02
