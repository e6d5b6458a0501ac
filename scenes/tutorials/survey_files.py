# %% [markdown]
# # A survey from its files
#
# An area was surveyed with a multibeam echo sounder, a CTD was lowered this morning, and the track of the vehicle was
# logged. From these three files we make the sidescan record of the day, and put it on the map.
#
# The files are written here, so that this runs anywhere. To use your own, skip the next three cells and name yours.

# %%
import datetime
import os
import tempfile
from pathlib import Path

import gsw
import matplotlib.pyplot as plt
import numpy as np
import pyproj
import rasterio
from PIL import Image
from rasterio.transform import from_origin
from scipy.ndimage import map_coordinates

import mitsonar

SCALE = float(os.environ.get("TUTORIAL_SCALE", 1))         # 1: a few seconds; 3: a line three times as long, more rays
DURATION, RAYS = 16 * SCALE, round(30_000 * SCALE)         # [s], of the line; rays of a ping
folder = Path(tempfile.mkdtemp(prefix="survey_files_"))

# %% [markdown]
# ## Bathymetry
#
# A BAG (Bathymetric Attributed Grid) is the format that hydrographic offices distribute: HDF5 with elevations on a
# grid in projected coordinates. Ours lies in the North Sea, in UTM zone 32: a bed that falls to the west, sand waves
# of 12 m, and a mound two metres high.

# %%
WEST, NORTH, NODE, NODES = 420_000.0, 6_050_160.0, 0.5, 320                          # [m]; nodes along a side
MOUND = 420_084.0, 6_050_062.0                                                       # easting, northing [m]
easting = WEST + NODE * (0.5 + np.arange(NODES))
northing = NORTH - NODE * (0.5 + np.arange(NODES))
east, north = np.meshgrid(easting, northing)
depth = 24 - 0.015 * (east - WEST) + 0.15 * np.sin(2 * np.pi * (0.9 * (east - WEST) + 0.4 * (north - NORTH)) / 12)
depth -= 2 * np.exp(-((east - MOUND[0]) ** 2 + (north - MOUND[1]) ** 2) / (2 * 2.5 ** 2))
with rasterio.open(folder / "area.bag", "w", driver="BAG", height=NODES, width=NODES, count=1, dtype="float32",
                   nodata=1e6, crs="EPSG:32632", transform=from_origin(WEST, NORTH, NODE, NODE)) as bag:
    bag.write(-depth.astype(np.float32), 1)

# %% [markdown]
# ## The cast
#
# A CTD measures conductivity, temperature and depth. Warm water lies on cold, with a thermocline at about 9 m. Sound
# speed follows from temperature, salinity and pressure by TEOS-10, the equation of state of seawater; so does
# absorption.

# %%
levels = np.arange(0.0, 27.0)                                                        # [m]
temperature = 9 + 7 / (1 + np.exp((levels - 9) / 1.2))
(folder / "today.csv").write_text("depth,temperature,salinity\n" + "".join(
    f"{d:.1f},{t:.3f},34.5\n" for d, t in zip(levels, temperature)))

# %% [markdown]
# ## The track
#
# The vehicle logs time, position, depth and attitude. Here it runs north at 2 m/s, 13 m deep, rolls a little, and
# turns gently to starboard.

# %%
seconds = np.arange(0, DURATION + 0.1, 0.5)
heading = np.radians(5 + 0.1 * seconds)
track_x = 420_055 + np.cumsum(np.sin(heading))                                       # half a second at 2 m/s: a metre
track_y = 6_050_045 + np.cumsum(np.cos(heading))
to_degrees = pyproj.Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
longitude, latitude = to_degrees.transform(track_x, track_y)
begin = datetime.datetime(2024, 7, 3, 9, 30, tzinfo=datetime.timezone.utc)
(folder / "line.csv").write_text("time,latitude,longitude,depth,roll,pitch,heading\n" + "".join(
    f"{(begin + datetime.timedelta(seconds=s)).isoformat()},{lat:.8f},{lon:.8f},13.0,{2 * np.sin(s):.3f},0,"
    f"{np.degrees(h):.3f}\n" for s, lat, lon, h in zip(seconds, latitude, longitude, heading)))

# %% [markdown]
# ## Look before you render
#
# We first look at the data. The sound-speed profile determines the paths of sound.

# %%
cast = mitsonar.io.casts.read(folder / "today.csv")
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), width_ratios=(2, 1))
chart = left.imshow(depth, extent=(WEST, WEST + NODE * NODES, NORTH - NODE * NODES, NORTH), cmap="viridis_r")
left.plot(track_x, track_y, "w", label="track")
left.plot(*MOUND, "r+", label="mound")
left.ticklabel_format(useOffset=False, style="plain")
left.locator_params(axis="x", nbins=3)
left.set_xlabel("easting [m]")
left.set_ylabel("northing [m]")
left.legend()
figure.colorbar(chart, ax=left, label="depth [m]")
right.plot(cast.profile.sound_speed, cast.profile.depth, "k")
right.invert_yaxis()
right.set_xlabel("sound speed [m/s]")
right.set_ylabel("depth [m]")
plt.tight_layout()
plt.show()

pressure = gsw.p_from_z(-levels, cast.pressure_latitude or 54.6)
absolute_salinity = gsw.SA_from_SP(34.5, pressure, 9.0, 54.6)
by_hand = gsw.sound_speed_t_exact(absolute_salinity, temperature, pressure)
print(f"sound speed {cast.profile.sound_speed.min():.1f} to {cast.profile.sound_speed.max():.1f} m/s, "
      f"by hand {by_hand.min():.1f} to {by_hand.max():.1f}")
assert cast.sound_speed_source == "teos-10"
assert abs(np.interp(levels, cast.profile.depth, cast.profile.sound_speed) - by_hand).max() < 0.1

# %% [markdown]
# ## The record
#
# `sidescan_survey` takes all three as parameters. Latitudes and longitudes are projected to the coordinates of the
# bathymetry, its grid is triangulated, and the track is resampled to the pings.

# %%
scene = mitsonar.load_file("sidescan_survey", bathymetry=folder / "area.bag", cast=folder / "today.csv",
                           track=folder / "line.csv", pings=10_000, rays=RAYS, range=45, bins=450)
image = mitsonar.render(scene, seed=1)
mitsonar.plots.preview(image, folder / "waterfall.png")
plt.figure(figsize=(11, 6))
plt.imshow(Image.open(folder / "waterfall.png"))
plt.axis("off")
plt.tight_layout()
plt.show()

# %% [markdown]
# The black strip in the middle is the water under the vehicle. Sand waves run across, and to starboard the mound has a
# bright flank and casts a shadow.
#
# ## Where is everything?
#
# Rays are traced in single precision, and UTM coordinates have seven digits before the decimal point. A scene
# therefore has an origin of its own, in the middle of the grid. The record stores this origin and the name of the
# coordinate system. Adding it gives eastings and northings: first of the vehicle.

# %%
origin, crs = image.attrs["local_origin"], image.attrs["crs"]
print(f"origin {origin} in {crs}, {image.sizes['ping']} pings in {np.ptp(image['ping_time'].values):.1f} s")
ping_seconds = image["ping_time"].values - begin.timestamp()
error = np.hypot(image["x"] + origin[0] - np.interp(ping_seconds, seconds, track_x),
                 image["y"] + origin[1] - np.interp(ping_seconds, seconds, track_y))
print(f"pings lie {float(error.max()) * 100:.1f} cm from the logged track at most")
assert crs == "EPSG:32632" and error.max() < 0.05

# %% [markdown]
# Next, of every bin. `seabed_x`, `seabed_y` and `seabed_depth` are the mean position of the seabed in the bin. There
# we look up the depth in the BAG.

# %%
seen = np.isfinite(image["seabed_x"].values) & (image["rays"].values > 3)
bin_east = image["seabed_x"].values[seen].astype(float) + origin[0]
bin_north = image["seabed_y"].values[seen].astype(float) + origin[1]
surveyed = map_coordinates(depth, [(NORTH - bin_north) / NODE - 0.5, (bin_east - WEST) / NODE - 0.5], order=1)
off = image["seabed_depth"].values[seen] - surveyed
print(f"depth of {off.size:,} bins less that of the survey: {np.mean(off) * 1e3:.2f} mm, "
      f"{np.std(off) * 1e3:.2f} mm rms")
assert abs(np.mean(off)) < 0.002 and np.std(off) < 0.005

# %% [markdown]
# A real sonar cannot measure this. It has the time of each echo, and usually the seabed is assumed to be level: an
# echo of the slant range r from a vehicle that is h above the bed lies $\sqrt{r^2 - h^2}$ across the track. How large
# is the error here?

# %%
slant, h = image["range"], image["altitude"]
level_bed = np.sqrt(np.maximum(slant ** 2 - h ** 2, 0)).transpose("ping", "range")
true_place = np.hypot(image["seabed_x"] - image["x"], image["seabed_y"] - image["y"])
wrong = (level_bed - true_place).transpose("ping", "side", "range")
abeam = int(np.abs(track_y[0] - MOUND[1] + (image["y"] - image["y"][0])).values.argmin())
figure, axes = plt.subplots(figsize=(8, 3.5))
for side, colour in (("port", "C3"), ("starboard", "C2")):
    axes.plot(slant, wrong.isel(ping=abeam).sel(side=side), colour, label=f"{side}, abeam of the mound")
axes.set_xlim(float(h.max()) + 1, None)
axes.set_ylim(-1, 1)
axes.set_xlabel("slant range [m]")
axes.set_ylabel("error of the place [m]")
axes.legend()
plt.tight_layout()
plt.show()
far = slant > 15
print(f"error of the level bed: {float(np.abs(wrong.where(far)).median()):.2f} m in the median, "
      f"{float(np.abs(wrong.where(far)).max()):.2f} m at most")
assert 0.05 < float(np.abs(wrong.where(far)).median()) < 1.0

# %% [markdown]
# To port the bed falls away, to starboard it rises, and on the mound an echo comes from nearer than it would on a
# level bed.
#
# ## A mosaic
#
# To put the record on the map we remove the influence of the sonar: the median level at each angle from nadir, on each
# side (`gain="angle"`). Straight below, a bin covers metres of the seabed; we leave out the bed that is seen steeper
# than 45 degrees. Intensities, not decibels, are averaged in cells of a quarter of a metre. `place="truth"` puts every
# bin where its bed is; "flat" puts it where a level bed would be, as survey software does.

# %%
mosaic = mitsonar.imaging.mosaic(image, 0.25, place="truth", gain="angle", nadir_deg=45)
mosaic["level"] -= mosaic["level"].median()                                          # relative to the bed's
mitsonar.io.geotiff.write(mosaic, folder / "mosaic.tif")

# %%
with rasterio.open(folder / "mosaic.tif") as tif:
    shown, box = tif.read(1), tif.bounds
    assert tif.crs.to_epsg() == 32632
    assert box.left < MOUND[0] < box.right and box.bottom < MOUND[1] < box.top
figure, axes = plt.subplots(figsize=(10, 5))
chart = axes.imshow(shown, extent=(box.left, box.right, box.bottom, box.top), cmap="copper", vmin=-8, vmax=8)
axes.contour(easting, northing, depth, [21, 21.5, 22], colors="w", linewidths=0.8)
axes.plot(track_x, track_y, "c", label="track")
axes.plot(*MOUND, "r+", markersize=12, label="top of the mound")
axes.set_xlim(box.left, box.right)
axes.set_ylim(box.bottom, box.top)
axes.ticklabel_format(useOffset=False, style="plain")
axes.set_xlabel("easting [m]")
axes.set_ylabel("northing [m]")
axes.legend(loc="upper right")
figure.colorbar(chart, ax=axes, shrink=0.6, label="backscatter, relative [dB]")
plt.tight_layout()
plt.show()

# %% [markdown]
# The mosaic lies on the map of the survey: the mound's flank towards the track is bright, and the shadow begins at
# its top.

# %%
intensity = 10 ** (0.1 * image["level"].astype(float))
evened = (intensity / intensity.mean("ping")).values[seen]
near = np.hypot(bin_east - MOUND[0], bin_north - MOUND[1]) < 4
facing = near & (bin_east < MOUND[0] - 1)
behind = np.hypot(east - MOUND[0] - 4, north - MOUND[1]) < 1.5                       # nodes of the survey behind it
flank_db = 10 * np.log10(evened[facing].mean())
print(f"the flank is {flank_db:.1f} dB brighter than the bed at that range")
assert flank_db > 2
south_to_north, west_to_east = NORTH + NODE * np.arange(-NODES, 1), WEST + NODE * np.arange(NODES + 1)
hits = np.histogram2d(bin_north, bin_east, [south_to_north, west_to_east])[0][::-1]
lit = np.mean(hits[behind] > 0)
print(f"{lit:.0%} of the survey's cells behind the mound are seen")
assert lit < 0.3

# %% [markdown]
# The GeoTIFF opens in any geographic information system. From here: `mitsonar render sidescan_survey -D
# bathymetry=area.bag -D cast=today.csv -D track=line.csv` does the same from the command line; `describe
# sidescan_survey` lists the other parameters, and `describe bathymetry` the files that can be read, with sediment maps
# and relief finer than the survey.
