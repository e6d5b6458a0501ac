# %% [markdown]
# # A detector trained on rendered images only
#
# If rendered pictures are realistic enough, a detector trained on them should work at sea. We train a small detector
# on rendered fields of targets only, and test it on three things that it has not seen: other kinds of targets on other
# beds, a rendered wreck, and a wreck that a real sonar recorded.
#
# This needs PyTorch (`pip install "mitsonar[detector]"`) and five minutes of CPU time: four to render, one to train.
# The test suite does not run it. All draws are seeded.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import torch
from scipy import ndimage
from torch import nn

import mitsonar
from mitsonar.imaging.picture_statistics import first_return
from mitsonar.io.xtf import read_amplitudes

SCALE = float(os.environ.get("TUTORIAL_SCALE", 1))         # 1: 24 fields and 16 epochs; 4: four times the fields
FIELDS, OTHERS, EPOCHS, SEED = round(24 * SCALE), 8, 16, 7
CELL = 30 / 256                                            # [m] of slant range, and about a ping
REAL = Path(os.environ.get("REAL_RECORD", "../shared/data/measured/sidescan/scotsman_600khz.xtf"))
folder = Path(os.environ.get("DETECTOR_FOLDER") or tempfile.mkdtemp(prefix="detector_"))


def minutes():
    """CPU minutes of this process and of those that rendered for it."""
    return sum(os.times()[:4]) / 60


started = minutes()

# %% [markdown]
# ## Fields
#
# Each field has another bed, other targets, another height, sonar and motion. Fields for training hold mines,
# boulders, crates, tyres and clumps, up to four times their real size, so that size carries no information. Fields for
# testing hold torpedoes, drums, anchors and lobster pots, which never occur in training.

# %%
PLAN = """
scene = "minefield"
output = "{{index:03}}.exr"
seed = {seed}
samples = {samples}

[set]
pings = 260
rays = 60000
range = 30
bins = 512
bed_spacing = 0.2
area = "-28, -15, 28, 15"
species = "{species}"
clutter_species = "{clutter}"
count = "3, 7"
clutter_count = "3, 7"

[draw]
target_seed = {{ integer = [0, 1000000] }}
bed_seed = {{ integer = [0, 1000000] }}
altitude = {{ uniform = [3, 9] }}
speed_knots = {{ uniform = [4, 8] }}
ripple_heading_deg = {{ uniform = [0, 180] }}
ripple_wavelength = {{ log_uniform = [0.9, 2.5] }}
ripple_height = {{ uniform = [0, 0.05] }}
roughness = {{ uniform = [0.03, 0.15] }}
sand_db = {{ normal = [-25, 3] }}
steel_db = {{ uniform = [-22, -13] }}
clutter_db = {{ uniform = [-22, -14] }}
scale = {{ choice = {scales} }}
motion = {{ choice = ["tow", "auv", "none"] }}
preset = {{ choice = ["towed_600khz", "towed_400khz", "auv_450khz"], weights = [2, 1, 1] }}
"""


def fields(name, samples, seed, species, clutter, scales):
    """Render fields, or take those that are there."""
    plan = folder / f"{name}.toml"
    plan.write_text(PLAN.format(samples=samples, seed=seed, species=species, clutter=clutter, scales=scales))
    outcome = mitsonar.sweep.run(mitsonar.sweep.load_plan(plan), folder / name, processes=1)
    assert outcome.failed == 0
    return mitsonar.dataset.open(folder / name)


learned = fields("learned", FIELDS, SEED, "cylinder, truncated_cone, sphere, wedge", "boulder, crate, tyre, clump",
                 '["0.8, 1.3", "1.5, 4"]')
asked = fields("asked", OTHERS, SEED + 1, "torpedo, drum", "anchor, lobster_pot", '["0.9, 1.1", "1, 2"]')
assert not set(learned.seabeds) & set(asked.seabeds)
assert not set(learned.object_classes) & set(asked.object_classes)
print(f"{len(learned)} fields to learn from, {len(asked)} to be asked about; "
      f"{minutes() - started:.1f} minutes of CPU for those that were not there")

# %% [markdown]
# ## The input of the detector
#
# The gains of real recorders are unknown. We therefore convert a picture to decibels above the median of each range,
# over all pings, in cells of 12 cm; this removes any gain. The water column is left out. The same function prepares
# rendered and real pictures.

# %%


def prepared(amplitude, spacing):
    """Give decibels over the bed's median (pings, cells), clipped and scaled, and what is bed."""
    per_cell = max(1, round(CELL / spacing))
    first = first_return(amplitude, spacing) // per_cell + 2
    cells = amplitude.shape[1] // per_cell
    power = (amplitude[:, :cells * per_cell] ** 2).reshape(len(amplitude), cells, per_cell).mean(2)
    level = 10 * np.log10(np.maximum(power, 1e-30 + 1e-12 * power.max()))
    bed = np.arange(cells) >= first[:, None]
    some = bed.sum(0) >= 8
    middle = np.zeros(cells)
    middle[some] = np.nanmedian(np.where(bed, level, np.nan)[:, some], 0)
    bed &= some
    return np.where(bed, np.clip((level - middle) / 10, -2.5, 2.5), 0).astype(np.float32), bed


def sides_of(image):
    """Give for both sides: picture, bed, and the number of the object that a cell shows or that hides it (0: none)."""
    own = np.array([int(number) for number in image.attrs["objects"]])
    spacing = image.attrs["bin_width"]
    for side in range(2):
        level = image["level"].values[:, side].astype(float)
        picture, bed = prepared(10 ** (level / 20), spacing)
        label, hides = (image[name].values[:, side] for name in ("label", "object_shadow"))
        number = np.where(np.isin(label, own), label, np.where(np.isin(hides, own), hides, 0)).astype(int)
        per_cell = number.shape[1] // picture.shape[1]
        number = number[:, :picture.shape[1] * per_cell].reshape(*picture.shape, per_cell).max(2)
        yield picture, bed, number * bed


known = [side for image in learned for side in sides_of(image)]
unknown = [side for image in asked for side in sides_of(image)]
share = np.mean([np.mean(number[bed] > 0) for _, bed, number in known])
print(f"objects and their shadows take {100 * share:.1f} % of the bed")
assert 0.003 < share < 0.3

plt.figure(figsize=(11, 4))
for place, (picture, _, number) in enumerate(known[:3]):
    plt.subplot(1, 3, place + 1)
    plt.imshow(picture, cmap="gray", vmin=-1.5, vmax=1.5, aspect="auto")
    plt.contour(number > 0, [0.5], colors="orange", linewidths=0.7)
plt.tight_layout()
plt.show()

# %% [markdown]
# ## The detector
#
# The detector is a U-shaped network. It works on four scales of the picture, up to some 6 m, and estimates for every
# cell the probability that an object or its shadow lies there. It has 60,000 parameters. It is trained on pieces of
# 128 x 128 cells, mirrored along the track at random, sometimes with a drifting gain or with shadows filled by noise.

# %%


class Detector(nn.Module):
    """A small U-Net, (B, 1, P, N) to logits (B, 1, P, N)."""

    def __init__(self, widths=(10, 16, 24, 32)):
        super().__init__()

        def pair(before, after):
            layers = []
            for start in (before, after):
                layers += [nn.Conv2d(start, after, 3, padding=1, bias=False), nn.BatchNorm2d(after), nn.ReLU()]
            return nn.Sequential(*layers)

        self.down = nn.ModuleList(pair(a, b) for a, b in zip((1, *widths), widths))
        self.up = nn.ModuleList(pair(a + b, a) for a, b in zip(widths, widths[1:]))
        self.last = nn.Conv2d(widths[0], 1, 1)

    def forward(self, picture):
        """Give a logit for each cell; sides are multiples of 8."""
        kept = []
        for stage, layers in enumerate(self.down):
            picture = layers(picture if stage == 0 else nn.functional.max_pool2d(picture, 2))
            kept.append(picture)
        for layers, beside in zip(reversed(self.up), reversed(kept[:-1])):
            picture = layers(torch.cat((beside, nn.functional.interpolate(picture, scale_factor=2.0)), 1))
        return self.last(picture)


random = np.random.default_rng(SEED)
torch.manual_seed(SEED)
torch.use_deterministic_algorithms(True)
torch.set_num_threads(1)                                   # pieces are small; threads would wait for each other


def piece(size=128):
    """Draw a piece of a known picture, around an object as often as not, disturbed as recorders disturb."""
    picture, bed, number = known[random.integers(len(known))]
    ping, cell = (random.integers(0, limit - size + 1) for limit in picture.shape)
    if random.random() < 0.6 and number.any():
        at = random.choice(np.argwhere(number))
        ping, cell = (int(np.clip(a - random.integers(size), 0, limit - size)) for a, limit in zip(at, picture.shape))
    cut = np.s_[ping:ping + size, cell:cell + size]
    seen, wanted, counts = picture[cut].copy(), (number[cut] > 0).astype(np.float32), bed[cut].astype(np.float32)
    if random.random() < 0.5:
        seen, wanted, counts = seen[::-1].copy(), wanted[::-1].copy(), counts[::-1].copy()
    drift = np.linspace(-1, 1, size, dtype=np.float32)
    seen += 0.15 * random.standard_normal() + 0.2 * random.standard_normal() * drift
    slow = ndimage.gaussian_filter(random.standard_normal((size, size)), random.uniform(8, 20))
    seen += (random.uniform(0, 0.25) * slow / slow.std()).astype(np.float32)             # beds change slowly
    if random.random() < 0.3:
        seen = np.maximum(seen, random.uniform(-2, -0.8))
    return seen * counts, wanted, counts


network = Detector()
steps = round(3 * len(known) * EPOCHS / 8)
rate = torch.optim.AdamW(network.parameters(), lr=3e-3, weight_decay=1e-4)
slowing = torch.optim.lr_scheduler.OneCycleLR(rate, 6e-3, total_steps=steps)
losses = []
training = minutes()
for step in range(steps):
    seen, wanted, counts = (torch.from_numpy(np.stack(parts))[:, None] for parts in zip(*(piece() for _ in range(8))))
    logits = network(seen)
    heavier = torch.where(wanted > 0, 2.0, 1.0) * counts
    loss = nn.functional.binary_cross_entropy_with_logits(logits, wanted, weight=heavier, reduction="sum")
    loss = loss / heavier.sum()
    rate.zero_grad()
    loss.backward()
    rate.step()
    slowing.step()
    losses.append(loss.item())
    if step % 40 == 39:
        print(f"step {step + 1} of {steps}: loss {np.mean(losses[-40:]):.3f}", flush=True)
network.eval()
print(f"{sum(p.numel() for p in network.parameters()):,} numbers, {steps} steps, loss {np.mean(losses[:20]):.3f} to "
      f"{np.mean(losses[-20:]):.3f}; {minutes() - training:.1f} minutes of CPU")
assert np.mean(losses[-20:]) < 0.6 * np.mean(losses[:20])


def score(picture):
    """Give the probability of an object for every cell."""
    pad = [(0, -size % 8) for size in picture.shape]
    with torch.no_grad():
        logits = network(torch.from_numpy(np.pad(picture, pad))[None, None])
    return torch.sigmoid(logits)[0, 0, :picture.shape[0], :picture.shape[1]].numpy()


# %% [markdown]
# ## Other targets, other beds
#
# The average precision is the area under the curve of precision over recall, cell by cell. What counts at sea is
# whole objects: a detection is a connected patch of at least 12 cells above a threshold. It is right where it touches
# an object or a shadow; an object is found where a detection touches it. Objects of fewer than 12 cells do not count.

# %%
SMALLEST = 12


def average_precision(scores, wanted):
    """Area under precision over recall."""
    order = np.argsort(-scores, kind="stable")
    right = np.cumsum(wanted[order])
    precision = right / np.arange(1, right.size + 1)
    return float(precision[wanted[order]].mean())


def patches(mask):
    """Number connected patches of a mask, small ones left out."""
    number, _ = ndimage.label(mask, np.ones((3, 3)))
    size = np.bincount(number.ravel())
    size[0] = 0
    return np.where(size[number] >= SMALLEST, number, 0)


def counted(scored, threshold):
    """Count objects, found ones, detections, and right ones over pictures."""
    objects = found = detections = right = 0
    for probability, bed, number in scored:
        detected = patches((probability > threshold) & bed)
        for one in np.unique(number[number > 0]):
            if np.count_nonzero(number == one) >= SMALLEST:
                objects, found = objects + 1, found + bool(detected[number == one].any())
        for one in np.unique(detected[detected > 0]):
            detections, right = detections + 1, right + bool(number[detected == one].any())
    return objects, found, detections, right


scored = [(score(picture), bed, number) for picture, bed, number in unknown]
cells = [np.concatenate([a[bed] for a, bed, _ in scored]), np.concatenate([n[bed] > 0 for _, bed, n in scored])]
precision_of_all = average_precision(*cells)
print(f"average precision, cell by cell: {precision_of_all:.2f}; by chance: {cells[1].mean():.3f}")
metres = sum(float(np.hypot(*(np.ptp(image[axis].values) for axis in "xy"))) for image in asked)
table = {}
for threshold in (0.3, 0.5, 0.7, 0.9):
    objects, found, detections, right = table[threshold] = counted(scored, threshold)
    print(f"threshold {threshold}: {found} of {objects} objects, recall {found / objects:.2f}; {right} of {detections} "
          f"detections right, precision {right / max(detections, 1):.2f}; "
          f"{100 * (detections - right) / metres:.1f} false alarms in 100 m of track")
assert precision_of_all > 5 * cells[1].mean()
THRESHOLD = 0.7

plt.figure(figsize=(11, 4))
for place in range(3):
    plt.subplot(1, 3, place + 1)
    plt.imshow(unknown[place][0], cmap="gray", vmin=-1.5, vmax=1.5, aspect="auto")
    plt.contour(unknown[place][2] > 0, [0.5], colors="orange", linewidths=0.7)
    plt.contour(scored[place][0], [THRESHOLD], colors="cyan", linewidths=0.7)
plt.tight_layout()
plt.show()

# %% [markdown]
# ## A rendered wreck
#
# There was no wreck in the training data. Here is one of 24 m, on a bed of several sediments.

# %%
kept = folder / "wreck.exr"
if not kept.is_file():
    scene = mitsonar.load_file("sidescan_wreck", rays=80000, bins=512)
    mitsonar.write(mitsonar.render(scene, seed=SEED), kept)
wreck = mitsonar.read(kept)
port, starboard = sides_of(wreck)
number = next(int(number) for number, one in wreck.attrs["objects"].items() if one["class"] == "wreck")
high = score(starboard[0])
on_wreck, on_bed = high[starboard[2] == number], high[starboard[1] & (starboard[2] == 0)]
print(f"mean score on the wreck and its shadow {on_wreck.mean():.2f}, on open bed {on_bed.mean():.3f}; "
      f"{100 * np.mean(on_wreck > THRESHOLD):.0f} % and {100 * np.mean(on_bed > THRESHOLD):.2f} % above {THRESHOLD}")
assert on_wreck.mean() > 2 * on_bed.mean()

# %% [markdown]
# ## A real wreck
#
# A record at 600 kHz, 30 m a side, some 56 m long; the wreck's place is marked by hand. The rest is not labelled: a
# few stones lie there, and detections on them count as false alarms.

# %%
WRECK = {"pings": (165, 372), "metres": (3.8, 17.5)}       # to starboard, its shadows with it
MAST = {"pings": (355, 380), "metres": (11.0, 30.0)}       # the long shadow of a post


def judged(path, length):
    """Print scores of a real record, and draw them."""
    record = read_amplitudes(path)
    spacing = float(record["range"].diff("range").mean())
    plt.figure(figsize=(11, 3.5))
    alarms, means = 0, {}
    for place, side in enumerate(("port", "starboard")):
        picture, bed = prepared(record["amplitude"].sel(side=side).values.astype(float), spacing)
        probability = score(picture)
        marked = np.zeros(bed.shape, bool)
        if side == "starboard":
            for box in (WRECK, MAST):
                near, far = (round(metre / CELL) for metre in box["metres"])
                marked[slice(*box["pings"]), near:far] = True
            inside = slice(*WRECK["pings"]), slice(*(round(metre / CELL) for metre in WRECK["metres"]))
            means["wreck"] = probability[inside][bed[inside]]
        means[side] = probability[bed & ~marked]
        detected = patches((probability > THRESHOLD) & bed)
        hits = set(np.unique(detected[marked])) - {0}
        others = set(np.unique(detected)) - hits - {0}
        alarms += len(others)
        print(f"{side}: {len(hits)} detections on the wreck, {len(others)} elsewhere; mean score of the bed "
              f"{means[side].mean():.3f}, {100 * np.mean(means[side] > THRESHOLD):.2f} % above {THRESHOLD}")
        plt.subplot(1, 2, place + 1)
        plt.imshow(picture[:, ::-1] if side == "port" else picture, cmap="gray", vmin=-1.5, vmax=1.5, aspect="auto")
        plt.contour(probability[:, ::-1] if side == "port" else probability, [THRESHOLD], colors="cyan", linewidths=0.6)
    plt.tight_layout()
    plt.savefig(folder / "real.png", dpi=130)
    plt.show()
    bed_score = np.concatenate((means["port"], means["starboard"]))
    above = 100 * np.mean(means["wreck"] > THRESHOLD)
    print(f"the box of the wreck: mean score {means['wreck'].mean():.2f}, {above:.0f} % above {THRESHOLD}; average "
          "precision against the bed "
          f"{average_precision(*both(means['wreck'], bed_score)):.2f}, by chance "
          f"{means['wreck'].size / (means['wreck'].size + bed_score.size):.2f}")
    print(f"{100 * alarms / length:.0f} false alarms in 100 m of track")
    return means["wreck"].mean(), bed_score.mean()


def both(wanted, others):
    """Scores of two kinds, and which is which."""
    return np.concatenate((wanted, others)), np.arange(wanted.size + others.size) < wanted.size


if REAL.is_file():
    on_wreck, on_bed = judged(REAL, 55.7)
    assert on_wreck > on_bed
else:
    print(f"{REAL} is not here: set REAL_RECORD to the file scotsman_600khz.xtf of OpenSidescan")
print(f"{minutes() - started:.1f} minutes of CPU in all")

# %% [markdown]
# ## Results
#
# With 24 fields: of other kinds of targets 81 % are found, and 90 % of detections are right (average precision 0.83 by
# cells, 0.04 by chance; 3 false alarms in 100 m). The rendered wreck has a mean score of 0.86 and its bed 0.10.
#
# The real wreck has 0.46 in its box, which holds much open bed inside the hull, and the bed around it 0.08: an average
# precision of 0.61, 0.12 by chance. Its large shadow, that of the post, and the holes within the hull are found; the
# highlights of the planks are mostly missed. There are 18 false alarms in 100 m. About half of them are stones with
# shadows that were not marked; the others lie where the bed changes with the altitude, and at an empty first ping.
# Such changes of the bed are missing from the training fields.
