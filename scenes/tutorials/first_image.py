# %% [markdown]
# # From a first image to labels
#
# A sidescan sonar is towed over a small minefield. We render its record, look at the record and at the truth behind
# it, write it to a file, turn it into labels for training a detector, and then do the same for a whole set of images.
#
# An `assert` checks every number in the text. Change a parameter and see which of them fail.

# %%
import json
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import mitsonar
from mitsonar.dataset import labels

SCALE = float(os.environ.get("TUTORIAL_SCALE", 1))         # 1: a few seconds; 4: the pictures of a real survey line
PINGS, RAYS = round(120 * SCALE), round(40_000 * SCALE)
RANGE, BINS = 24.0, 600                                    # [m], of slant range; time bins on each side
folder = Path(tempfile.mkdtemp(prefix="first_image_"))

# %% [markdown]
# ## A scene
#
# A scene is an XML file: a seabed, objects, water, a sonar. `minefield` comes with mitsonar (`mitsonar scenes` lists
# all scenes, and `mitsonar describe minefield` explains the parameters). Any parameter that the file gives a default
# can be set when it is loaded. Here the track is short, so we let the objects lie close to it. `area` is west, south,
# east, north in metres; the sonar runs north along x = 0. By default the sonar moves as a towed fish does. Here it
# does not (`motion` is none), so that simple formulas hold.

# %%
along = 0.5 * 0.05 * PINGS - 1                             # [m]: a ping every 5 cm, and objects a metre from the ends
small = {"pings": PINGS, "rays": RAYS, "range": RANGE, "bins": BINS, "bed_spacing": 0.2, "motion": "none"}
field = {"area": f"-20, {-along}, 20, {along}", "count": 3, "clutter_count": 3, "burial": 0, "target_seed": 4,
         "clutter_species": "anchor, boulder, clump, crate, drum, lobster_pot, tyre"}
scene = mitsonar.load_file("minefield", **small, **field)
image = mitsonar.render(scene, seed=1)
image

# %% [markdown]
# The result is an `xarray.Dataset`. Its axes have names and units: `ping` counts transmissions, `side` is port or
# starboard, `range` is slant range: half the travel time of the echo times the speed of sound at the sonar.
#
# `level` is the echo level at the receiver, in dB re 1 µPa. We draw it as sonar operators see it: port to the left,
# starboard to the right, the newest ping on top. The picture has a gain over range; the data never do.

# %%
assert image["level"].dims == ("ping", "side", "range") and image["level"].shape == (PINGS, 2, BINS)


def show(path, size=(11, 6)):
    """Show a picture that was written to a file."""
    plt.figure(figsize=size)
    plt.imshow(Image.open(path))
    plt.axis("off")
    plt.tight_layout()
    plt.show()


mitsonar.plots.preview(image, folder / "waterfall.png")
show(folder / "waterfall.png")

# %% [markdown]
# The dark strip in the middle is the water column. The first echo of the seabed comes from straight below, so the
# strip is as wide as the sonar is high. The ripples of the sand follow. Objects are bright where they face the sonar,
# and behind each lies a shadow, where it blocks the sound. Two objects lie almost under the track: they are nearer
# than the seabed, so their echoes appear in the water column.
#
# Where nothing is nearer, the first bin with an echo in the main lobe must lie at the sonar's altitude.

# %%
seabed = next(int(number) for number, name in image.attrs["labels"].items() if name == "seabed")
first = (image["label"] > 0).argmax("range")                               # number of a bin, for every ping and side
free = (image["label"].isel(range=first) == seabed).all("side")            # pings that meet nothing before the seabed
off = image["range"].isel(range=first).min("side") - image["altitude"]     # [m]
print(f"{int(free.sum())} of {PINGS} pings meet the seabed first, at most {float(abs(off[free]).max()):.3f} m off the "
      "altitude")
assert free.sum() > PINGS / 4 and abs(off[free]).max() < 0.1
assert off[~free].min() < -0.3                                             # and what is nearer is heard before

# %% [markdown]
# ## Speckle
#
# An echo of rough sand is the sum of very many wavelets from within one resolution cell, and their phases are random.
# The pressure is therefore a complex Gaussian number, and its intensity has an exponential distribution: the level
# varies by many decibels from bin to bin. This is speckle. `mean_level` is the level without it. The ratio of both
# intensities has the mean 1 and the standard deviation 1.

# %%
heard = (image["mean_level"] > image.attrs["noise_db"] + 20) & (image["range"] > 8)
ratio = 10 ** (0.1 * (image["level"] - image["mean_level"]).values[heard.values].astype(float))
print(f"{ratio.size:,} bins: mean {ratio.mean():.3f}, standard deviation {ratio.std():.3f}")
assert abs(ratio.mean() - 1) < 0.02 and abs(ratio.std() - 1) < 0.05

edges = np.linspace(0, 6, 49)
plt.figure(figsize=(7, 3.5))
plt.hist(ratio, edges, density=True, color="0.75", label="rendered")
plt.plot(edges, np.exp(-edges), "k", label="exponential distribution")
plt.xlabel("intensity over its mean")
plt.ylabel("probability density")
plt.legend()
plt.show()

# %% [markdown]
# ## The sonar equation
#
# The echo level EL of a bin is the source level SL, less the losses on the way out and back, plus the scattering
# strength of the seabed times the area A that one bin holds:
#
# $$EL = SL - 40 \log_{10} r - 2 \alpha r + S_b(\theta) + 10 \log_{10} A + DI$$
#
# * $40 \log_{10} r$: the sound spreads over a sphere, out and back; $\alpha$ [dB/m] is absorbed by the water.
# * $S_b = \mu \sin^2\theta$: the sand is given Lambert's law with µ = -24 dB; θ is the grazing angle, $\sin\theta = h
#   / r$ for a sonar that is h above the seabed.
# * $A = r \psi \cdot c\tau/2 / \cos\theta$: the pulse of length τ covers cτ/2 of slant range. ψ is the width of a
#   beam with sharp edges that receives as much energy as the real one along the track, out and back: $\psi = \int
#   \mathrm{sinc}^4 (L\phi/\lambda)\,d\phi = 2\lambda/3L$ for a face of length L.
# * DI: the face looks 20 degrees down, and is loudest there. Across the track its pattern is again a sinc.

# %%
sonar = mitsonar.sonar.presets()["towed_400khz"]                          # that of the scene
wavelength = image.attrs["sound_speed"] / image.attrs["frequency"]
length, height = (mitsonar.sonar.length_for_beam_width(np.deg2rad(sonar[name]), wavelength)
                  for name in ("beam_width_deg", "vertical_beam_width_deg"))
r = image["range"].values
h = float(image["altitude"].mean())
on_bed = r > h
sine = np.where(on_bed, h / r, 1.0)
grazing = np.arcsin(sine)
psi = 2 / 3 * wavelength / length
area = r * psi * 0.5 * image.attrs["sound_speed"] * image.attrs["pulse_length"] / np.maximum(np.cos(grazing), 1e-3)
pattern = np.sinc(height / wavelength * np.sin(grazing - np.deg2rad(sonar["depression_deg"]))) ** 4
expected = (image.attrs["source_level_db"] - 40 * np.log10(r) - 2 * image.attrs["absorption_db"] * r
            + -24 + 20 * np.log10(sine) + 10 * np.log10(area) + 10 * np.log10(pattern))

bed_only = (image["label"] == seabed) & (image["hidden"] == 0)
intensity = (10 ** (0.1 * image["mean_level"].astype(float))).where(bed_only)
measured = 10 * np.log10(intensity.mean(("ping", "side")))
far = r > 1.3 * h
error = (measured - expected)[far].values
print(f"rendered less expected: {error.mean():.2f} dB")
assert abs(error.mean()) < 0.6 and abs(error).max() < 3

plt.figure(figsize=(7, 3.5))
plt.plot(r, measured, "0.6", label="rendered, mean over pings")
plt.plot(r[on_bed], expected[on_bed], "k", label="sonar equation, level bed")
plt.ylim(70, None)
plt.xlabel("slant range [m]")
plt.ylabel("level [dB re 1 µPa]")
plt.legend()
plt.show()

# %% [markdown]
# The curves agree on the mean, though ripples make the rendered one rise and fall: a slope that faces the sonar is
# brighter, and most of the energy comes from there. At ranges close to the altitude the equation for a level bed is of
# little use: a bin then covers a large patch, seen from above, at the edge of the beam.
#
# ## The truth
#
# For each bin the record holds the truth: the object with most of the echo (`label`, with the names in its
# attributes), the depth of what was hit, the position of the seabed, the number of rays, and what objects take away:
# `object_shadow` is the number of the object that hides the seabed there.

# %%
mitsonar.plots.plot(image, "objects", folder / "objects.png")
show(folder / "objects.png")

# %% [markdown]
# A shadow's length follows from similar triangles. A sonar h above the seabed looks over an edge at the horizontal
# distance x and the height t; the shadow ends where that ray meets the seabed, at $x\,h / (h - t)$. We do not know
# which edge of the turned crate casts it, but it lies between the nearest and the farthest.

# %%
number, crate = next((number, one) for number, one in image.attrs["objects"].items() if one["class"] == "crate")
ping = int(np.abs(image["y"].values - 0.5 * (crate["lower"][1] + crate["upper"][1])).argmin())
h, t = 18.0 + float(image["z"][ping]), 18.0 + crate["upper"][2]           # [m] above the seabed, which is 18 m deep
across = np.sort(np.abs([crate["lower"][0], crate["upper"][0]]) + float(image["x"][ping]))
shadow_ends = np.hypot(across * h / (h - t), h)
shadow = image["object_shadow"].isel(ping=ping).sel(side="port") == int(number)
print(f"the crate's shadow ends at {float(shadow['range'][shadow].max()):.2f} m; "
      f"geometry says {shadow_ends[0]:.2f} to {shadow_ends[1]:.2f} m")
assert shadow_ends[0] - 0.1 < shadow["range"][shadow].max() < shadow_ends[1] + 0.1

# %% [markdown]
# ## A file
#
# An image is stored as an EXR: a format from the film industry with any number of named channels, which many programs
# open. Reading returns what was written, bit for bit, and the file includes the scene with all its parameters.

# %%
mitsonar.write(image, folder / "first.exr")
again = mitsonar.read(folder / "first.exr")
print(f"{(folder / 'first.exr').stat().st_size / 1e6:.1f} MB; made of {again.attrs['parameters']}")
assert again.identical(image)

# %% [markdown]
# ## Labels
#
# A detector learns from pictures and from boxes around what it should find. Both come from the record: a highlight is
# where an object has most of the energy, a shadow where it hides most of the seabed's energy. COCO is a format that
# most training code reads. The masks hold, for every picture element, the number of its object.

# %%
rules = labels.Labels(coco=True, masks=True)
print(labels.write(folder / "first.exr", folder / "labels", rules))
coco = json.loads((folder / "labels" / "annotations.json").read_text())
names = {one["id"]: one["name"] for one in coco["categories"]}


def draw(coco, number, pictures):
    """Draw a picture of a COCO file with its boxes."""
    record = next(one for one in coco["images"] if one["id"] == number)
    axes = plt.figure(figsize=(11, 3)).gca()
    axes.imshow(Image.open(pictures / record["file_name"]), cmap="gray", aspect="auto")
    for one in coco["annotations"]:
        if one["image_id"] == number:
            x, y, width, height = one["bbox"]
            name = names[one["category_id"]]
            colour = "deepskyblue" if name.endswith("shadow") else "orange"
            axes.add_patch(plt.Rectangle((x, y), width, height, fill=False, edgecolor=colour))
            if colour == "orange":
                axes.text(x, y - 4, name, color=colour, fontsize=8, bbox={"facecolor": "black", "pad": 1})
    axes.set_xlabel("column: port mirrored, then starboard")
    axes.set_ylabel("row: newest ping on top")
    plt.tight_layout()
    plt.show()


draw(coco, coco["images"][0]["id"], folder / "labels" / "images")

# %% [markdown]
# A box is counted in picture elements: a column is a bin, a row a ping. We turn the crate's back into slant range and
# ping and compare with where the crate is: the highlight begins where its nearest edge is, and lasts as long as it is
# abeam.

# %%
box = next(one["bbox"] for one in coco["annotations"]
           if one["instance"].startswith("crate") and names[one["category_id"]] == "crate")
nearest = (BINS - box[0] - box[2]) * image.attrs["bin_width"]             # [m]; the port side is mirrored
middle_y = float(image["y"][round(PINGS - 1 - box[1] - 0.5 * box[3])])
print(f"highlight from {nearest:.2f} m on, about y = {middle_y:.2f} m")
assert np.hypot(across[0], h - t) - 0.1 < nearest < np.hypot(across[1], h)
assert crate["lower"][1] < middle_y < crate["upper"][1]

# %% [markdown]
# ## A set of images
#
# A detector needs many images. A *sweep* is a plan, written as TOML: which scene, and which values its parameters
# take. Values of `[list]` go side by side, values of `[grid]` are combined with all others, and `[draw]` is random.
# Here two fields of targets on two seabeds are seen on soft and on hard sand, the steel a little different each time.

# %%
(folder / "plan.toml").write_text(f"""
scene = "minefield"
output = "{{index:03}}.exr"
seed = 7
seeds = [1]

[set]
pings = {PINGS}
rays = {RAYS // 2}
range = {RANGE}
bins = {BINS}
bed_spacing = 0.2
area = "{field['area']}"
count = "3"
clutter_count = "3"

[list]
target_seed = [4, 5]
bed_seed = [1, 2]

[grid]
sand_db = [-30, -24]

[draw]
steel_db = {{ uniform = [-20, -14] }}
""")
plan = mitsonar.sweep.load_plan(folder / "plan.toml")
outcome = mitsonar.sweep.run(plan, folder / "fields", processes=1)
print(f"{len(plan)} renders, {outcome.done} done in {outcome.seconds:.0f} s, {outcome.failed} failed")
assert outcome.done == len(plan) == 4 and outcome.failed == 0

# %% [markdown]
# Run the same plan again, and finished images are kept. On a cluster, workers share the same plan, and the bytes stay
# the same.
#
# `dataset.open` reads a finished sweep. An image is read when you ask for it.

# %%
assert mitsonar.sweep.run(plan, folder / "fields", processes=1).kept == 4
images = mitsonar.dataset.open(folder / "fields")
sand, bed = images.parameters["sand_db"], images.parameters["bed_seed"]    # an entry for each image
print(images.names, sand, bed, images.object_classes)

# %% [markdown]
# Harder sand by 6 dB must give a seabed that is 6 dB louder, bin by bin: rays, targets and seabed are the same.

# %%
soft, hard = (images[int(np.argmax((sand == value) & (bed == 1)))] for value in (-30, -24))
seabed = next(int(number) for number, name in soft.attrs["labels"].items() if name == "seabed")
both = ((soft["label"] == seabed) & (hard["label"] == seabed)).values
difference = (hard["mean_level"] - soft["mean_level"]).values[both]
print(f"median {np.median(difference):.2f} dB, of {difference.size:,} bins")
assert abs(np.median(difference) - 6) < 0.01

# %% [markdown]
# A detector that is tested on the seabed of its training looks better than it is. Images are therefore split by their
# seabeds; images of one seabed stay together.

# %%
subsets = images.split("train=0.5,val=0.5")
assert not set(subsets["train"].seabeds) & set(subsets["val"].seabeds)
levels = subsets["train"].stack("level")["level"]                         # NumPy: (image, ping, side, range)
print({name: len(part) for name, part in subsets.items()}, levels.shape)
assert levels.shape == (2, PINGS, 2, BINS)

# %% [markdown]
# Finally the labels of all images, also for YOLO, with the same split:

# %%
rules = labels.Labels(coco=True, yolo="boxes", split={"train": 0.5, "val": 0.5})
counts = labels.write(folder / "fields", folder / "training", rules)
print(counts)
train, val = (json.loads(path.read_text()) for path in sorted((folder / "training").glob("annotations_*.json")))
assert counts["pictures"] == len(train["images"]) + len(val["images"]) == 4
names = {one["id"]: one["name"] for one in train["categories"]}
draw(train, train["images"][0]["id"], folder / "training" / "images")

# %% [markdown]
# From here: `mitsonar labels` and `mitsonar sweep` do the same from the command line; `images.torch()` is a data set
# for PyTorch; `scenes/minefield.toml` is a plan of a hundred fields, no two alike.
