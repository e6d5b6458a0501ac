# %% [markdown]
# # From element signals to beams
#
# A forward-looking sonar has one transmitter and a line of receivers across the bow. No part of it points in a
# direction: each receiver records everything ahead of it, and directions are computed afterwards. Here we take the
# signals of the elements, compress the pulse, and form beams. We check each step against its closed form, first with a
# single buoy and then with a whole scene.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image
from scipy.signal import resample

import mitsonar
from mitsonar.signal import matched_filter
from mitsonar.signal.beamforming import delay_and_sum, directions, fan_beams

SCALE = float(os.environ.get("TUTORIAL_SCALE", 1))         # 1: a few seconds; 2: twice as many elements, finer cells
ELEMENTS, CELL = round(32 * SCALE), 0.08 / SCALE           # receivers; [m], side of the seabed's cells
folder = Path(tempfile.mkdtemp(prefix="array_to_beams_"))

# %% [markdown]
# ## One buoy
#
# `forward_looking` comes with mitsonar: a sonar 4 m above a rippled bed, a box, a pipe and a buoy. We make the bed
# silent, switch the noise and the errors of the receivers off, and let the record end before the box, so that only the
# buoy is left: a point target of -15 dB, 2 m to starboard of the sonar, 12 m ahead and 1 m deeper. The vehicle runs
# north at 3 knots.

# %%
scene = mitsonar.load_file("forward_looking", elements=ELEMENTS, cell=1.0, range=14, range_min=10, mu_db=-150,
                           noise=False, shading="boxcar", receive_flaws=0)
signals = mitsonar.element_signals(scene)
signals

# %% [markdown]
# The result is an `xarray.DataArray` over (ping, tx, rx, sample) of complex numbers, in µPa. *Complex baseband* means
# that the carrier of 300 kHz is taken out: what is left varies as slowly as the pulse's band is wide, and the phase
# says how many carrier cycles the echo is late. An echo of delay τ and amplitude a is
#
# $$y(t) = a\,s(t - \tau)\,e^{-i 2\pi f_0 \tau}$$
#
# with the pulse s: here a sweep (lfm) of 20 kHz in half a millisecond.

# %%
rate, carrier = signals.attrs["sampling_rate"], signals.attrs["frequency"]
pulse = signals.pulse
milliseconds = 1e3 * signals["time"].values
element = np.array([signals[f"rx_{axis}"].values.ravel() for axis in "xyz"]).T       # (rx, 3) [m], body frame
assert signals.dims == ("ping", "tx", "rx", "sample") and signals.sizes["rx"] == len(element) == ELEMENTS

start, buoy = np.array([0.0, -16.0, -16.0]), np.array([2.0, -4.0, -17.0])            # east, north, up
distance = np.linalg.norm(buoy - start)
bearing = np.arctan2(2.0, 12.0)                                                      # from the bow to starboard
first = float(signals["time"][np.argmax(abs(signals.values[0, 0, 0]) > 0.5 * abs(signals.values).max())])
print(f"{distance:.2f} m away: the echo begins after about {1e3 * first:.2f} ms")
assert abs(first - 2 * distance / 1490) < 0.2e-3

figure, panels = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True)
panels[0].plot(milliseconds, abs(signals.values[0, 0, 0]), "0.3")
panels[0].set_title("amplitude of one element [µPa], phase of all")
loud = np.abs(signals.values[0, 0]) > 0.05 * np.abs(signals.values).max()
phase = np.where(loud, np.angle(signals.values[0, 0]), np.nan)
panels[1].imshow(phase, aspect="auto", cmap="twilight", origin="lower", interpolation="none",
                 extent=(milliseconds[0], milliseconds[-1], 0, ELEMENTS))
panels[1].set_ylabel("element")
panels[1].set_xlabel("time since transmission [ms]")
plt.tight_layout()
plt.show()

# %% [markdown]
# The lower picture shows the echo's phase by its colour. From left to right it runs through the sweep, which begins
# below the carrier and ends above it. From bottom to top it changes as well: the echo comes from starboard, and
# reaches each element to port a little later. A beamformer uses nothing else.
#
# ## Pulse compression
#
# Two targets that are closer than half a pulse length, 37 cm, cannot be told apart in this record. A matched filter
# correlates it with the pulse. The result is as short as the inverse bandwidth: 1500 m/s / (2 · 20 kHz) = 3.7 cm. It
# is scaled such that an echo keeps its amplitude, at its own delay.

# %%
echoes = signals.copy(data=matched_filter(signals.values, pulse, rate))
middle = np.abs(echoes.values[0, 0]).argmax(-1)                              # the sample of each element's peak
peak = int(np.median(middle))
finer = resample(echoes.values[0, 0], 16 * echoes.sizes["sample"], axis=-1)            # peaks fall between samples
level_db = 20 * np.log10(np.abs(finer).max())
print(f"peak after {milliseconds[peak]:.3f} ms, {level_db:.1f} dB re 1 µPa")

figure, axes = plt.subplots(figsize=(8, 3))
between = milliseconds[0] + 1e3 * np.arange(finer.shape[-1]) / (16 * rate)
axes.plot(milliseconds, 20 * np.log10(abs(signals.values[0, 0, 0]) + 1), "0.7", label="as heard")
axes.plot(between, 20 * np.log10(abs(finer[0]) + 1), "k", label="after the matched filter")
axes.set_xlim(milliseconds[peak] - 0.6, milliseconds[peak] + 0.8)
axes.set_ylim(level_db - 50, level_db + 3)
axes.set_xlabel("time since transmission [ms]")
axes.set_ylabel("level [dB re 1 µPa]")
axes.legend()
plt.tight_layout()
plt.show()

# %% [markdown]
# Which level do we expect? Source level, less spherical spreading and absorption there and back, plus the target
# strength, plus the beam pattern of the transmitter's face in this direction: `beam_pattern` computes it from the
# array of the scene.

# %%
sonar = scene.sensors()[0]
wavelength = signals.attrs["sound_speed"] / carrier
towards = np.array([12.0, 2.0, 1.0]) / distance                             # body frame: forward, starboard, down
face_db = 20 * np.log10(abs(mitsonar.sonar.beam_pattern(sonar.transmit, towards, wavelength)))
absorbed_db = float(mitsonar.water.absorption_db(carrier, depth=16.5)) * 2 * distance
expected_db = signals.attrs["source_level_db"] - 40 * np.log10(distance) - absorbed_db - 15 + float(face_db)
print(f"expected {expected_db:.1f} dB re 1 µPa")
assert abs(level_db - expected_db) < 0.3
assert abs(signals["time"].values[peak] - 2 * distance / 1498) < 1 / rate

# %% [markdown]
# ## A direction from phases
#
# An echo from broadside reaches all elements at once. An echo from the angle ψ reaches the element at y earlier by y
# sin ψ / c, so the phase grows along the line by 2π sin ψ / λ per metre. A straight line through the phases gives the
# bearing.

# %%
phases = np.unwrap(np.angle(echoes.values[0, 0, :, peak]))
slope = np.polyfit(element[:, 1], phases, 1)[0]                                      # [rad/m]
sine = slope * wavelength / (2 * np.pi)
print(f"sin ψ = {sine:.4f}; geometry says {towards[1]:.4f}")
assert abs(sine - towards[1]) < 0.001

# %% [markdown]
# ## Beams
#
# Delay-and-sum takes a direction, shifts each element's signal by the delay that an echo from there would have, and
# adds the signals. Echoes from there add in phase; others largely cancel. For N elements at the pitch d the response
# to an echo from ψ of a beam at ψ' is
#
# $$b = \left|\frac{\sin N x}{N \sin x}\right|, \qquad x = \frac{\pi d}{\lambda} (\sin\psi' - \sin\psi)$$

# %%
angles = np.deg2rad(np.linspace(-60, 60, 481))
depression = np.arcsin(towards[2])
beams = delay_and_sum(echoes, directions(angles, -depression))                       # (ping, beam, sample)
found = np.abs(beams.values[0, :, peak])
pitch = element[1, 1] - element[0, 1]


def line_pattern(count, pitch, cosine):
    """Response to the echo of a line that is steered to a direction, by the cosine between that and the line."""
    x = np.pi * pitch / wavelength * (cosine - sine)
    return np.abs(np.sinc(count * x / np.pi) / np.sinc(x / np.pi))


cosines = np.sin(angles) * np.cos(depression)
theory = line_pattern(ELEMENTS, pitch, cosines)
compared = theory > 0.1                                                              # main lobe and first side lobes
error_db = 20 * np.log10(found[compared] / found.max() / theory[compared])
width = np.ptp(np.rad2deg(angles[found > found.max() * np.sqrt(0.5)]))
print(f"strongest beam at {np.rad2deg(angles[found.argmax()]):.2f} degrees, {width:.2f} degrees wide at -3 dB; "
      f"largest error {abs(error_db).max():.2f} dB")
assert abs(angles[found.argmax()] - bearing) < np.deg2rad(0.3)
assert abs(width - np.rad2deg(0.886 * wavelength / (ELEMENTS * pitch))) < 0.6
assert abs(error_db).max() < 0.3                                                     # it is that of one frequency alone

# %% [markdown]
# Side lobes are 13 dB below the main lobe: a strong echo also appears in directions where there is no target. Shading,
# smaller weights at the ends of the line, lowers them and widens the beam. And elements more than half a wavelength
# apart are worse: other directions than the true one then add up in phase, too, where
#
# $$\sin\psi' = \sin\psi \pm n \lambda / d$$
#
# We make such an array by dropping two elements of three. For a single frequency these *grating lobes* are as strong
# as the beam itself. Our pulse has a band of 20 kHz: in the grating lobe the carrier adds up in phase, but the
# compressed pulses, sinc(B t), are one carrier cycle apart from element to element and overlap only in part.

# %%
shaded = delay_and_sum(echoes, directions(angles, -depression), window="hamming")
sparse = delay_and_sum(echoes.isel(rx=slice(None, None, 3)), directions(angles, -depression))
figure, axes = plt.subplots(figsize=(8, 4))
for some, style, name in ((beams, "k", f"{ELEMENTS} elements"), (shaded, "C0", "the same, hamming window"),
                          (sparse, "C3", "every third element: grating lobes")):
    power = np.abs(some.values[0, :, peak])
    axes.plot(np.rad2deg(angles), 20 * np.log10(power / power.max() + 1e-6), style, label=name)
axes.plot(np.rad2deg(angles), 20 * np.log10(theory + 1e-6), "y--", label="closed form")
axes.set_ylim(-60, 12)
axes.set_xlabel("azimuth [deg]")
axes.set_ylabel("level [dB]")
axes.legend(ncol=2)
plt.tight_layout()
plt.show()

aside = abs(angles - bearing) > np.deg2rad(12)
assert 20 * np.log10(np.abs(shaded.values[0, aside, peak]).max() / np.abs(shaded.values[0, :, peak]).max()) < -35
lobe = np.abs(cosines - (sine - wavelength / (3 * pitch))).argmin()                    # the nearest of the beams
apart = np.arange(len(range(0, ELEMENTS, 3))) / carrier                                # [s], of the pulses
overlap_db = 20 * np.log10(np.abs(np.sinc(20e3 * (apart - apart.mean())).mean()))
lobe_db = 20 * np.log10(np.abs(sparse.values[0, lobe, peak]) / np.abs(sparse.values[0, :, peak]).max())
print(f"grating lobe at {np.rad2deg(angles[lobe]):.1f} degrees: {lobe_db:.1f} dB, by the overlap {overlap_db:.1f} dB")
assert abs(lobe_db - overlap_db) < 0.3

# %% [markdown]
# ## Noise
#
# Noise of the sea comes from all sides, and elements half a wavelength apart receive independent noise. A beam
# averages it: its power falls by the number of elements, less the loss of the shading. We record with the noise
# switched on, and let the record end before any echo.

# %%
quiet = mitsonar.load_file("forward_looking", elements=ELEMENTS, cell=1.0, range=11, range_min=5, mu_db=-150,
                           shading="boxcar")
noise = mitsonar.element_signals(quiet, seed=3)
grid = directions(np.arcsin(np.linspace(-0.8, 0.8, ELEMENTS)))
for window, loss in (("boxcar", 0.0), ("hamming", 1.34)):
    heard = delay_and_sum(noise, grid, window=window)
    gain_db = 10 * np.log10(np.mean(np.abs(noise.values) ** 2) / np.mean(np.abs(heard.values) ** 2))
    print(f"{window}: array gain {gain_db:.2f} dB, 10 lg N - {loss} dB = {10 * np.log10(ELEMENTS) - loss:.2f} dB")
    assert abs(gain_db - 10 * np.log10(ELEMENTS) + loss) < 0.5

# %% [markdown]
# ## The whole scene
#
# Now with the seabed. It is cut into cells, and each holds one scatterer with a random amplitude that is the same for
# every element: the beams therefore have the speckle of a real array. For a line of equally spaced elements,
# `fan_beams` gets all beams at once by a chirp-z transform, at equal steps of the sine.

# %%
scene = mitsonar.load_file("forward_looking", elements=ELEMENTS, cell=CELL, range=22)
signals = mitsonar.element_signals(scene, seed=1)
echoes = signals.copy(data=matched_filter(signals.values, signals.pulse, signals.attrs["sampling_rate"]))
fan = fan_beams(echoes, "forward", beams=4 * ELEMENTS + 1)
mitsonar.plots.fan(fan, folder / "fan.png", title="forward looking")
plt.figure(figsize=(10, 7))
plt.imshow(Image.open(folder / "fan.png"))
plt.axis("off")
plt.tight_layout()
plt.show()

# %% [markdown]
# The scene shades its receivers by a hamming window, which comes with the signals as `rx_weight`. The buoy is the dot
# 12 m ahead, as wide as a beam because the buoy itself has no width. To port the box is bright where its face is
# turned to the sonar, and the bed behind it is dark; to starboard lies the pipe with its shadow.
#
# The fast fan and delay-and-sum agree as long as the targets are far away compared to the array:

# %%
some = slice(None, None, 16)
slow = delay_and_sum(echoes, np.array([fan[f"beam_{axis}"].values[some] for axis in "xyz"]).T)
far = signals["time"].values > 2 * 10 / 1500
difference = np.abs(slow.values[..., far] - fan.values[:, some][..., far]).max() / np.abs(slow.values[..., far]).max()
print(f"largest difference {20 * np.log10(difference):.0f} dB")
assert difference < 0.02

ranges = 0.5 * signals.attrs["sound_speed"] * fan["time"].values
near_box = (ranges > 14.5) & (ranges < 17.5)
brightest = np.abs(fan.values[0][:, near_box]).max(1).argmax()
box_bearing = np.rad2deg(np.arctan2(-4.0, 16.0))
print(f"the box is in the beam at {np.rad2deg(float(fan['angle'][brightest])):.1f} degrees; "
      f"its middle is at {box_bearing:.1f} degrees")
assert abs(np.rad2deg(float(fan["angle"][brightest])) - box_bearing) < 3

# %% [markdown]
# From here: `mitsonar signals` writes the signals of the elements to a netCDF file for other software; `mitsonar
# render` makes the same fan with the truth of each sample; `mvdr` forms adaptive beams; `mitsonar.sonar` makes arrays
# of other shapes.
