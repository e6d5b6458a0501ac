# %% [markdown]
# # The water that soundings came through
#
# The cast is old, or there is none. Every sounding contains information on the water that it came through: its beam
# left at a known angle, and its travel time was measured. Is that enough to find the sound-speed profile? Over a bed
# of many depths it is. Over a level bed it is not, however many soundings there are, and mitsonar then reports this.
#
# `mitsonar.inversion.fit_profile` takes lines as `mitsonar.soundings` makes them, or as instruments wrote
# them. Here the lines are made with known water, so that the answers can be checked.

# %%
import os
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from mitsonar.gradients import BedGrid, SoundingTimes
from mitsonar.hydrography import SoundingBeams
from mitsonar.inversion import ProfilePrior, fit_profile
from mitsonar.water import SoundSpeedProfile

PINGS = round(20 * float(os.environ.get("TUTORIAL_SCALE", 1)))                       # of a line
HEAD, BEAMS, NOISE = 2.0, 24, 10e-6          # [m] depth of the sonar; beams of a ping; [s] of two-way times
rng = np.random.default_rng(5)

# %% [markdown]
# ## The truth
#
# Warm water lies on cold, with a thermocline at 22 m, and a slope climbs through it, from 42 to 10 m.

# %%
fine = np.arange(0.0, 60.0, 0.5)
water = SoundSpeedProfile(fine, 1510 - 18 / (1 + np.exp(-(fine - 22) / 4)))
x, y = np.arange(-60.0, 400, 2), np.arange(-220.0, 221, 2)


def bed(shallowest, deepest):
    """A slope along x, with some relief."""
    fall = np.clip(shallowest + (deepest - shallowest) * x / 340, shallowest, deepest)
    return BedGrid(x=x, y=y, depth=fall + 0.4 * np.sin(x / 23) * np.cos(y[:, None] / 31))


# %% [markdown]
# Four lines go up the slope, and three cross them, so that the same bed is seen at several angles. This separates depth
# from sound speed: where only one beam reaches a place, a deeper bed below faster water has the same travel time.

# %%
def lines(along, across):
    """Beams of lines along x, at y = `along`, and across, at x = `across`."""
    angle = np.radians(np.linspace(-60, 60, BEAMS))                                  # from the vertical
    parts = []
    for place in along:
        parts.append((np.linspace(10, 330, PINGS), np.full(PINGS, place), (0.0, -1.0)))
    for place in across:
        parts.append((np.full(PINGS, place), np.linspace(-100, 100, PINGS), (1.0, 0.0)))
    columns = [np.concatenate([np.repeat(part[k], BEAMS) for part in parts]) for k in (0, 1)]
    starboard = [np.concatenate([np.tile(np.sign(angle) * part[2][k], PINGS) for part in parts]) for k in (0, 1)]
    angles = np.tile(np.abs(angle), PINGS * len(parts))
    count, head = len(angles), float(water.at(HEAD))
    return SoundingBeams(
        x=columns[0], y=columns[1], depth=np.full(count, HEAD), east=starboard[0], north=starboard[1],
        slowness=np.sin(angles) / head, travel_time=np.ones(count), head_speed=np.full(count, head),
        starboard=np.tile(np.sign(angle), PINGS * len(parts)))


def surveyed(beams, over):
    """The same beams with the times of their echoes, noise, and 5 cm of navigation error a ping."""
    times = SoundingTimes(beams, water, over).value({})
    astray = np.repeat(0.05 * rng.standard_normal((2, len(beams) // BEAMS)), BEAMS, axis=1)
    return replace(beams, x=beams.x + astray[0], y=beams.y + astray[1],
                   travel_time=times + NOISE * rng.standard_normal(len(beams)))


slope = bed(10, 42)
many = lines(along=(-60, -20, 20, 60), across=(60, 170, 280))
measured = surveyed(many, slope)
figure, axes = plt.subplots(figsize=(8, 4))
chart = axes.pcolormesh(slope.x, slope.y, slope.depth, cmap="viridis_r")
axes.plot(measured.x[::BEAMS], measured.y[::BEAMS], "w.", markersize=2)
axes.set_xlabel("x [m]")
axes.set_ylabel("y [m]")
figure.colorbar(chart, ax=axes, label="depth [m]")
plt.show()

# %% [markdown]
# ## The answer
#
# The fit begins with water of one sound speed, that of the head's own sensor, and nodes every four metres. The bed is
# unknown. The prior: speeds within some 10 m/s of the start, correlated over 8 m.

# %%
nodes = np.r_[0, HEAD, np.arange(4, 45, 4)]
start = SoundSpeedProfile(nodes, np.full(nodes.size, water.at(HEAD)))
prior = ProfilePrior(deviation=10, length=8)
fit = fit_profile(measured, start, noise=NOISE, prior=prior)
truth = water.at(nodes)
told = fit.told & (nodes > HEAD)
before, after = (np.abs(speed - truth)[told].mean() for speed in (fit.start, fit.speed))
print(fit.verdict)
print(f"mean error of the told nodes: {before:.1f} before, {after:.2f} m/s after; met to {1e6 * fit.noise:.0f} us")
assert fit.is_profile and told.sum() >= 6
assert after < 0.15 * before
assert not fit.told[(nodes > HEAD + 1) & (nodes < fit.bed_depths[0])].any()

# %% [markdown]
# Nodes above the shallowest soundings are not *determined*: all rays cross those layers completely, and their travel
# times do not depend on the order of the layers. The standard deviations there hold only if the layers are about as
# the prior assumes.

# %%
def drawn(axes, fit):
    """Truth, start, answer, uncertainty."""
    axes.plot(water.at(fine), fine, "k", label="truth")
    axes.plot(fit.start, fit.depth, "0.6", linestyle=":", label="start")
    axes.errorbar(fit.speed, fit.depth, xerr=fit.deviation, fmt="none", ecolor="C0", label="one deviation")
    axes.plot(fit.speed[fit.told], fit.depth[fit.told], "C0o", label="told")
    axes.plot(fit.speed[~fit.told], fit.depth[~fit.told], "wo", markeredgecolor="C0", label="not told")
    axes.axhspan(fit.bed_depths[0], fit.bed_depths[-1], color="tan", alpha=0.3, label="soundings lie here")
    axes.set_ylim(46, 0)
    axes.set_xlim(1480, 1530)
    axes.set_xlabel("sound speed [m/s]")
    axes.set_ylabel("depth [m]")


figure, axes = plt.subplots(figsize=(5, 5))
drawn(axes, fit)
axes.legend(fontsize=8, loc="lower right")
plt.show()

# %% [markdown]
# ## What the soundings determine
#
# Singular values above 1 count the combinations that the soundings determine better than the prior. Each has its
# pattern, a shape of the profile. The first is nearly the mean of the column; later ones oscillate; combinations below
# 1 keep their prior values.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4))
left.semilogy(1 + np.arange(nodes.size), np.maximum(fit.singular_values, 1e-3), "o")
left.axhline(1, color="0.6")
left.set_xlabel("pattern")
left.set_ylabel("singular value")
for k in (0, 1, 2, nodes.size - 1):
    right.plot(fit.patterns[k], nodes, label=f"{k + 1}: {fit.singular_values[k]:.2g}")
right.set_ylim(46, 0)
right.set_xlabel("[m/s]")
right.legend(title="pattern, value", fontsize=8)
plt.show()
seen = int((fit.singular_values > 1).sum())
print(f"{seen} of {nodes.size} numbers were seen")
assert 6 <= seen < nodes.size

# %% [markdown]
# ## A level bed
#
# The same lines over a bed of 40 to 41 m, apart from its relief. Times and angles of rays down to one depth depend on
# how much of the water has which speed, and not on the depth of that water. The fit reports this with an example:
# other layers that fit the times equally well. `fit.profile` raises an error. The mean of the column is determined to
# 0.1 m/s.

# %%
level = fit_profile(surveyed(many, bed(40, 41)), start, noise=NOISE, prior=prior)
column = np.linspace(HEAD, level.bed_depths[1], 1000)
try:
    level.profile
    refused = ""
except ValueError as error:
    refused = str(error)
print(refused)
assert "do not tell a profile" in refused
assert abs(level.column_mean - water.at(column).mean()) < 0.15
assert level.rival is not None and level.rival_misfit < 1.05 * level.misfit[-1]
figure, axes = plt.subplots(figsize=(5, 5))
drawn(axes, level)
axes.plot(level.rival, nodes, "C3--", label="meets the times as well")
axes.legend(fontsize=8, loc="lower right")
plt.show()

# %% [markdown]
# ## One line alone
#
# One line measures each place of its bed from one direction only, so that some bed fits the times in any water.
# Nothing is determined then, unless the bed is known from another survey: pass it as `bed=`, with its standard
# deviation in the prior.

# %%
single = surveyed(lines(along=(0,), across=()), slope)
alone = fit_profile(single, start, noise=NOISE, prior=prior)
print(alone.verdict)
assert not alone.is_overlapping
known = fit_profile(single, start, noise=NOISE, prior=replace(prior, bed_deviation=0.05), bed=slope)
print(known.verdict)
assert known.is_profile

# %% [markdown]
# From here: `fit.to_dataset()` returns all results as a dataset; `mitsonar.hydrography.resounded` reduces the line
# again with `fit.profile`. `mitsonar.io.survey_lines.reading.read("LINE.all")` reads a line of your own, and
# `tests/benchmarks/profile_from_soundings.py` does all this with real lines.
