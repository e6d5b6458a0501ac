"""Focusing of raw echoes to an image: compression, then back-projection, ping after ping.

    image = 10^(-SL/20) Σ v w R_t R_r 10^(α (R_t + R_r)/20) m(τ) e^(i2πf₀τ) / Σ v w g          see `back_projection`

g -> sinc(L_t u/λ) sinc(L_r u/λ), the beams of the elements' lengths; v -> `overlap_shares`, w -> the aperture's weights
over |u| <= ``aperture``:

    no window        w = 1                        the beams themselves taper the aperture
    a window W       w = W(u / aperture) / g      the window alone tapers it

A point target has |image|² = 10^(TS/10) at its peak. Beams across the track are not undone: a target off the axis of
look is weaker by them. The default ``aperture`` λ/2L, where L is the longer element, resolves L/2 along the track: at
-3 dB 0.50 L with no window, 0.44 L with a boxcar, 0.72 L with a Hann window.
"""
from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

from mitsonar.device.turns import one_at_a_time
from mitsonar.device.types import DrJitArray
from mitsonar.signal.beamforming.alignment import device_arrays
from mitsonar.sonar.arrays.shading import window_weights
from mitsonar.sonar.pulses.pulses import pulse_of
from mitsonar.units import amplitude_from_db, db_from_amplitude
from mitsonar.water.profile import SoundSpeedProfile

from ..record import check_image, check_raw
from .back_projection import WEIGHTS, BackProjection, ImageAperture, ImageWater, Sender
from .compression import Compressor, window_of
from .delays import TravelTables, bends
from .geometry import image_variables
from .grids import Grid, default_grid
from .motion import ApertureMotion

STEPS = 257                        # of the mean heading
STRAIGHT = np.deg2rad(20.0)        # range of headings on a straight strip
WIDEST = 0.9                       # sine of the largest angle of an aperture, to either side
LEAST_BEAM = 0.15                  # least value of the elements' beams that a window divides by
REACH = 1.02                       # reach of the tables over the distance of the grid's farthest point


@one_at_a_time
def focus(raw: xr.Dataset, grid: Grid | None = None, profile: SoundSpeedProfile | float | None = None, *,
          window: str | tuple | None = "taylor 4 30", range_window: str | tuple | None = "taylor 4 30",
          trajectory: xr.Dataset | None = None, aperture: float | None = None,
          like: DrJitArray | type | None = None) -> xr.Dataset:
    """Focus raw echoes.

    Parameters
    ----------
    raw : xarray.Dataset
        Raw echoes, as `record` describes them.
    grid : Grid or None
        Points to focus at. None: `grids.default_grid`.
    profile : SoundSpeedProfile, float [m/s] or None
        Water that delays are computed with, along exact eigenrays. A number: straight lines at this sound speed. None:
        the record's own profile.
    window, range_window : None, str or tuple
        Windows over the aperture's angles and over the pulse's sweep. "none" or None: no window.
    trajectory : xarray.Dataset or None
        Trajectory to use instead of the record's, such as a navigated one: ``motion_time``, ``motion_x`` and so on.
    aperture : float or None [-]
        Sine of the largest angle from abreast that is used. None: λ/2L, see the module.
    like : Dr.Jit array or type, optional
        Where to compute; by default on a GPU if there is one, else on the CPU.

    Returns
    -------
    xarray.Dataset
        Focused image as `record` describes it, every bank apart. Points that no ping saw are 0, their level -inf.

    Raises
    ------
    ValueError
        If `raw` has no raw echoes or fewer than two pings, numbers are not finite, a window is unknown, the
        trajectory does not cover the pings, or no ping sees the grid.
    """
    check_raw(raw)
    if raw.sizes["ping"] < 2:
        raise ValueError(f"an aperture needs two or more pings, got {raw.sizes['ping']}; give a longer strip")
    if grid is None:
        grid = default_grid(raw if trajectory is None else raw.assign(_as_variables(trajectory)))
    focuser = Focuser(raw, grid, profile, window=window, range_window=range_window, trajectory=trajectory,
                      aperture=aperture, like=like)
    focuser.add(raw)
    return focuser.image()


class Focuser:
    """Focusing of pings one after the other; memory does not grow with their number."""

    def __init__(self, raw: xr.Dataset, grid: Grid, profile: SoundSpeedProfile | float | None = None, *,
                 window: str | tuple | None = "taylor 4 30", range_window: str | tuple | None = "taylor 4 30",
                 trajectory: xr.Dataset | None = None, aperture: float | None = None,
                 like: DrJitArray | type | None = None):
        check_raw(raw)
        self.grid, self.pings = grid, 0
        self.motion = ApertureMotion(raw if trajectory is None else trajectory)
        self.profile = _profile(raw, profile)
        self.pulse = pulse_of(raw.attrs["pulse"])
        self.time = np.asarray(raw["time"].values, float)
        self.frequency = float(raw.attrs["frequency"])
        self.source_level_db, self.absorption_db = (float(raw.attrs[name])
                                                    for name in ("source_level_db", "absorption_db"))
        self.places = np.asarray(raw["rx_position"].values, float), np.asarray(raw["tx_position"].values, float)
        self.banks = [np.flatnonzero(raw["rx_bank"].values == bank) for bank in np.unique(raw["rx_bank"].values)]
        self.compressor = Compressor(self.pulse, float(raw.attrs["sampling_rate"]), len(self.time), range_window)
        place = self.motion.place(np.linspace(self.motion.first, self.motion.last, 1001))
        wavelength = float(self.profile.at(float(place[:, 2].mean()))) / self.frequency
        self.aperture = _aperture(raw, wavelength, aperture, window)
        self._tables = self._travel_tables(place)
        self.window = float(self.time[0]), float(self.time[0] + self.compressor.samples / self.compressor.rate)
        way = self.motion.velocity(np.linspace(self.motion.first, self.motion.last, 1001))
        speed = max(float(np.median(np.linalg.norm(way, axis=1))), 1e-3)
        self._sailed = self.aperture.widest * self.sound_speed * 0.5 * self.window[1] / speed
        heading = (raw if trajectory is None else trajectory)["motion_heading"].values
        self._straight = bool(np.ptp(heading) < STRAIGHT)
        self._degree = self.motion.degree(self._moved, np.zeros(3))
        sweep = self.pulse.sweep
        coupling = 0.0 if sweep is None else self.frequency * self.pulse.duration / (sweep[1] - sweep[0])
        lib = device_arrays(like)
        self._images = [BackProjection(
            lib, grid, self.aperture, frequency=self.frequency, rate=self.compressor.rate, first=self.window[0],
            samples=self.compressor.samples, coupling=coupling, look=np.asarray(raw.attrs["look"], float))
            for _ in self.banks]
        self._before: dict[int, np.ndarray] = {}
        self._waiting: dict[int, tuple[float, np.ndarray]] = {}
        self._about = {name: value for name, value in raw.attrs.items() if name != "sampling_rate"} | {
            "window": _text(window), "range_window": _text(range_window), "aperture": self.aperture.widest}

    @property
    def _moved(self) -> tuple[float, float]:
        """Window of reception [s] after a transmission; the pulse's middle counts for the place of a ping."""
        half = 0.5 * self.pulse.duration
        return self.window[0] + half, self.window[1] + half

    def _travel_tables(self, place: np.ndarray) -> TravelTables | None:
        """Return tables for bent rays, or None where sound travels along straight lines."""
        if not bends(self.profile):
            self.sound_speed = float(self.profile.sound_speed[0])
            return None
        low, high = float(self.grid.depth.min()), float(self.grid.depth.max())
        between = np.linspace(min(low, place[:, 2].min()), max(high, place[:, 2].max()), 201)
        self.sound_speed = float(1 / np.mean(1 / self.profile.at(between)))
        x, y = (axes[[0, 0, -1, -1], [0, -1, 0, -1]] for axes in (self.grid.x, self.grid.y))
        farthest = float(np.hypot(x[:, None] - place[:, 0], y[:, None] - place[:, 1]).max())
        recorded = 0.55 * self.sound_speed * (self.time[-1] + self.pulse.duration)
        reach = min(farthest * REACH + 1.0, recorded + 5.0)
        return TravelTables(self.profile, self.sound_speed, (low, high), (0.0, reach))

    def add(self, raw: xr.Dataset) -> None:
        """Add pings of the same strip, in their order."""
        signals = raw["signal"]
        if signals.shape[1:] != (len(self.places[0]), len(self.time)):
            raise ValueError(f"the pings have {signals.shape[1]} receivers and {signals.shape[2]} samples, the strip "
                             f"{len(self.places[0])} and {len(self.time)}; give pings of one strip")
        times = np.asarray(raw["ping_time"].values, float)
        senders = np.asarray(raw["transmitter"].values)
        if not np.all(np.isfinite(times)):
            raise ValueError("ping_time holds numbers that are not finite; leave those pings out")
        if not np.all((senders >= 0) & (senders < len(self.places[1]))):
            raise ValueError(f"`transmitter` ranges from {senders.min()} to {senders.max()}, and there are "
                             f"{len(self.places[1])} transmitters; number them from 0")
        self.motion.check_covers(float(times.min()), float(times.max()) + self._moved[1])
        for ping, start in enumerate(times):
            signal = np.asarray(signals[ping].values)
            if not np.all(np.isfinite(signal)):
                raise ValueError(f"ping {self.pings}, counted from 0, holds signals that are not finite; leave it out")
            self._next(float(start), int(senders[ping]), signal)

    def _next(self, start: float, number: int, signal: np.ndarray) -> None:
        """Add a ping, once the step from the previous ping of its transmitter is known (for the first, to the next)."""
        self.pings += 1
        place, rotation = self.motion.place(np.array(start)), self.motion.rotation(np.array(start))
        before = self._before.get(number)
        self._before[number] = place
        if before is None:
            self._waiting[number] = start, signal
            return
        step = float(abs((place - before) @ rotation[:, 0]))
        for waiting in (self._waiting.pop(number, None), (start, signal)):
            if waiting is not None:
                self._add(waiting[0], self.places[1][number], waiting[1], step)

    def _add(self, start: float, transmitter: np.ndarray, signal: np.ndarray, step: float) -> None:
        sent = start + 0.5 * self.pulse.duration
        at = self.motion.of_point(np.array([sent, sent - 1e-4, sent + 1e-4]), transmitter)
        sender = Sender(place=at[0], velocity=(at[2] - at[1]) / 2e-4, rotation=self.motion.rotation(np.array(sent)))
        compressed = self.compressor.compressed(signal)
        for image, bank in zip(self._images, self.banks, strict=True):
            places = self.places[0][bank]
            centre = places.mean(0)
            receivers = self.motion.moving(sent, self.window, centre, self._degree)
            planes = {} if self._tables is None else {"sender": self._tables.at(float(sender.place[2])),
                                                      "receivers": self._tables.at(float(receivers.place[2]))}
            water = ImageWater(sound_speed=self.sound_speed, absorption_db=self.absorption_db, **planes)
            image.add(compressed[bank], sender, receivers, places - centre, overlap_shares(places[:, 0], step),
                      self._ahead(start), water)

    def _ahead(self, start: float) -> np.ndarray:
        """Return the mean direction ahead, level, unit vector (3,); over one aperture where the strip turns."""
        motion, reach = self.motion, 2 * self._sailed
        between = (motion.first, motion.last) if self._straight else (
            max(start - reach, motion.first), min(start + reach, motion.last))
        forward = motion.rotation(np.linspace(*between, STEPS))[:, :2, 0]
        forward = np.hanning(STEPS + 2)[1:-1] @ forward if not self._straight else forward.mean(0)
        return np.append(forward / np.linalg.norm(forward), 0.0)

    def image(self) -> xr.Dataset:
        """Return the image of the pings so far; see `focus`."""
        for number, (start, signal) in self._waiting.items():        # the only ping of its transmitter
            self._add(start, self.places[1][number], signal, np.inf)
        self._waiting.clear()
        shape = self.grid.depth.shape
        values, loudness = [], amplitude_from_db(self.source_level_db)
        for sums in self._images:
            weight = sums.weight.numpy()
            total = sums.real.numpy() + 1j * sums.imaginary.numpy()
            seen = weight > 0
            scale = np.divide(1, weight, out=np.zeros(len(weight)), where=seen) / loudness
            values.append((total * scale).astype(np.complex64).reshape(shape))
        if not any(sums.weight.numpy().any() for sums in self._images):
            raise ValueError(f"the grid lies outside the beam and the record of all {self.pings} pings; lay it on the "
                             "side and range of the record, or leave it out")
        image = np.stack(values)
        unseen = np.mean([sums.weight.numpy() == 0 for sums in self._images])
        if unseen:
            warnings.warn(f"no ping sees {100 * unseen:.2g} % of the grid's points: their level is -inf; check the "
                          "trajectory, or lay the grid on the side and range of the record", stacklevel=2)
        if not np.all(np.isfinite(image)):
            raise ValueError(f"levels overflow: an absorption of {self.absorption_db:g} dB/m and a source level of "
                             f"{self.source_level_db:g} dB are undone; correct them, or move the grid nearer")
        grid = self.grid
        record = xr.Dataset(image_variables({
            "image": image, "level": db_from_amplitude(np.abs(image)).astype(np.float32),
            "along_track": grid.along_track, "across_track": grid.across_track, "x": grid.x, "y": grid.y,
            "grid_depth": grid.depth}), attrs={
            **self._about, "grid": grid.kind, "grid_origin_x": grid.origin[0], "grid_origin_y": grid.origin[1],
            "grid_heading": grid.heading, "pings": self.pings})
        check_image(record)
        return record


def overlap_shares(along: np.ndarray, step: float) -> np.ndarray:
    """Return the weights v of receivers at `along` [m] that make overlapping pings, `step` [m] apart, even."""
    gaps = np.diff(np.unique(np.round(along, 6)))
    if not len(gaps):
        return np.ones(len(along))
    spacing = 0.5 * float(np.median(gaps))
    middle = 0.5 * (0.5 * (along.max() + along.min()) - along)
    filled = 0.5 * float(np.ptp(along)) + spacing
    if not 1e-3 * spacing < step < filled - 1e-3 * spacing:
        return np.ones(len(along))
    shorter = min(step, filled - step)
    return np.clip((0.5 * filled - np.abs(middle)) / shorter, 0.0, 1.0)


def _as_variables(trajectory: xr.Dataset) -> dict[str, tuple[str, np.ndarray]]:
    ApertureMotion(trajectory)             # refuses a broken trajectory
    return {str(name): ("other_motion", np.asarray(trajectory[name].values)) for name in trajectory.variables
            if str(name).startswith("motion_")}


def _profile(raw: xr.Dataset, profile: SoundSpeedProfile | float | None) -> SoundSpeedProfile:
    if isinstance(profile, SoundSpeedProfile):
        return profile
    if profile is None:
        return SoundSpeedProfile(raw["cast_depth"].values, raw["cast_sound_speed"].values)
    return SoundSpeedProfile.constant(profile)


def _aperture(raw: xr.Dataset, wavelength: float, widest: float | None, window: str | tuple | None) -> ImageAperture:
    """Return the range of angles and its weights."""
    lengths = float(raw.attrs["tx_length"]), float(raw.attrs["rx_length"])
    if widest is None:
        widest = min(0.5 * wavelength / max(*lengths, 1e-9), WIDEST)
    if not 0 < widest <= WIDEST:
        raise ValueError(f"aperture is {widest}; give the sine of the largest angle from abreast, above 0 and at most "
                         f"{WIDEST}")
    reach = min(2 * widest, 1.0)
    sine = np.linspace(0, reach, WEIGHTS) / wavelength
    beam = np.sinc(lengths[0] * sine) * np.sinc(lengths[1] * sine)
    shape = window_of(window)
    taper = np.ones(WEIGHTS) if shape is None else window_weights(shape, 2 * WEIGHTS - 1)[WEIGHTS - 1:]
    weight = (beam > LEAST_BEAM).astype(float)
    if shape is not None:
        weight /= np.maximum(beam, LEAST_BEAM)
    return ImageAperture(widest=float(widest), taper=taper.astype(np.float32), beam_reach=reach,
                    beams=np.stack([weight, weight * beam], -1).astype(np.float32),
                    fall=float((np.pi / wavelength) ** 2 * (lengths[0] ** 2 + lengths[1] ** 2) / 6))


def _text(window: str | tuple | None) -> str:
    return "none" if window is None else window if isinstance(window, str) else " ".join(map(str, window))
