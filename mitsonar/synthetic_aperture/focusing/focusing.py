"""Raw echoes to a focused image: compression, then back-projection, ping after ping.

    image = 10^(-SL/20) Σ v w R_t R_r 10^(α (R_t + R_r)/20) m(τ) e^(i2πf₀τ) / Σ v w g          see `back_projection`

g -> sinc(L_t u/λ) sinc(L_r u/λ), the beams of the elements' lengths; v -> `overlap_shares`, w -> the aperture's weights
over |u| <= ``aperture``:

    window none      w = 1                  the beams themselves taper the aperture
    another          w = W(u / aperture) / g        it is tapered by the window alone

A point target has |image|² = 10^(TS/10) at its peak; beams across the track are not undone, so that one off the axis of
look comes out weaker by them. ``aperture`` λ/2L, L the longer of the two, gives L/2 along the track: with no window
0.50 L, with a boxcar 0.44 L, with a Hann window 0.72 L at -3 dB.
"""
from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

from mitsonar.device.types import DrJitArray
from mitsonar.signal.beamforming.alignment import device_arrays
from mitsonar.sonar.arrays.shading import window_weights
from mitsonar.sonar.pulses.pulses import pulse_of
from mitsonar.units import amplitude_from_db, db_from_amplitude
from mitsonar.water.profile import SoundSpeedProfile

from ..record import IMAGE_VARIABLES, check_image, check_raw
from .back_projection import WEIGHTS, BackProjection, ImageAperture, ImageWater, Sender
from .compression import Compressor, window_of
from .delays import TravelTables, bends
from .grids import Grid, default_grid
from .motion import ApertureMotion

STEPS = 257                        # of the mean heading
STRAIGHT = np.deg2rad(20.0)        # that headings may differ by on a straight strip
WIDEST = 0.9                       # sine of the angle that an aperture may reach to either side
LEAST_BEAM = 0.15                  # of the elements' beams, that a window divides by
REACH = 1.02                       # of the tables beyond the grid's farthest point


def focus(raw: xr.Dataset, grid: Grid | None = None, profile: SoundSpeedProfile | float | None = None, *,
          window: str | tuple | None = "taylor 4 30", range_window: str | tuple | None = "taylor 4 30",
          trajectory: xr.Dataset | None = None, aperture: float | None = None,
          like: DrJitArray | type | None = None) -> xr.Dataset:
    """Focus raw echoes.

    Parameters
    ----------
    raw : xarray.Dataset
        See `record`.
    grid : Grid or None
        None: `grids.default_grid`.
    profile : SoundSpeedProfile, float [m/s] or None
        Water that delays are made with, along exact eigenrays; a number: straight lines at one sound speed; None: the
        record's own.
    window, range_window : None, str or tuple
        Over the aperture's angles and over the pulse's sweep; "none" or None leave the beams and the sweep as they are.
    trajectory : xarray.Dataset or None
        Another than the record's, such as a navigated one: ``motion_time``, ``motion_x`` and the like.
    aperture : float or None [-]
        Sine of the largest angle from abreast that is used; None: as the module says.
    like : Dr.Jit array or type, optional
        Where to compute; by default on a GPU if there is one, else on the CPU.

    Returns
    -------
    xarray.Dataset
        A focused image of `record`; one bank after the other. Points that no ping saw are 0, their level -inf.

    Raises
    ------
    ValueError
        If `raw` holds no raw echoes or fewer than two pings, numbers are not finite, a window is unknown, the
        trajectory does not cover the pings, or no ping sees the grid.
    """
    check_raw(raw)
    if raw.sizes["ping"] < 2:
        raise ValueError(f"an aperture is made of two or more pings, got {raw.sizes['ping']}")
    if grid is None:
        grid = default_grid(raw if trajectory is None else raw.assign(_as_variables(trajectory)))
    focuser = Focuser(raw, grid, profile, window=window, range_window=range_window, trajectory=trajectory,
                      aperture=aperture, like=like)
    focuser.add(raw)
    return focuser.image()


class Focuser:
    """Focus pings one after the other: memory does not grow with their number."""

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
        self._about = {name: raw.attrs[name] for name in raw.attrs if name not in ("sampling_rate",)}
        self._about |= {"window": _text(window), "range_window": _text(range_window),
                        "aperture": self.aperture.widest}

    @property
    def _moved(self) -> tuple[float, float]:
        """Window of reception [s] after a transmission: a ping is where it is when its pulse's middle passes."""
        half = 0.5 * self.pulse.duration
        return self.window[0] + half, self.window[1] + half

    def _travel_tables(self, place: np.ndarray) -> TravelTables | None:
        """Tables for bent rays; None where sound goes straight."""
        if not bends(self.profile):
            self.sound_speed = float(self.profile.sound_speed[0])
            return None
        low, high = float(self.grid.depth.min()), float(self.grid.depth.max())
        between = np.linspace(min(low, place[:, 2].min()), max(high, place[:, 2].max()), 201)
        self.sound_speed = float(1 / np.mean(1 / self.profile.at(between)))
        x, y = (one[[0, 0, -1, -1], [0, -1, 0, -1]] for one in (self.grid.x, self.grid.y))
        farthest = float(np.hypot(x[:, None] - place[:, 0], y[:, None] - place[:, 1]).max())
        heard = 0.55 * self.sound_speed * (self.time[-1] + self.pulse.duration)
        nearest = 0.0
        return TravelTables(self.profile, self.sound_speed, (low, high),
                            (nearest, min(farthest * REACH + 1.0, heard + 5.0)))

    def add(self, raw: xr.Dataset) -> None:
        """Add pings of the same strip, in their order."""
        signals = raw["signal"]
        if signals.shape[1:] != (len(self.places[0]), len(self.time)):
            raise ValueError(f"pings have {signals.shape[1]} receivers and {signals.shape[2]} samples, and the strip "
                             f"{len(self.places[0])} and {len(self.time)}; give pings of one strip")
        times = np.asarray(raw["ping_time"].values, float)
        senders = np.asarray(raw["transmitter"].values)
        if not np.all(np.isfinite(times)):
            raise ValueError("ping_time holds numbers that are not finite; leave those pings out")
        if not np.all((senders >= 0) & (senders < len(self.places[1]))):
            raise ValueError(f"transmitter holds {senders.min()} to {senders.max()}, and there are "
                             f"{len(self.places[1])}; count them from 0")
        self.motion.check_covers(float(times.min()), float(times.max()) + self._moved[1])
        for ping, start in enumerate(times):
            heard = np.asarray(signals[ping].values)
            if not np.all(np.isfinite(heard)):
                raise ValueError(f"ping {self.pings} of those to focus, counted from 0, holds signals that are not "
                                 "finite; leave it out")
            self._next(float(start), int(senders[ping]), heard)

    def _next(self, start: float, number: int, heard: np.ndarray) -> None:
        """Add a ping, once the way from the one before it of its transmitter is known, or for the first to the next."""
        self.pings += 1
        place, rotation = self.motion.place(np.array(start)), self.motion.rotation(np.array(start))
        before = self._before.get(number)
        self._before[number] = place
        if before is None:
            self._waiting[number] = start, heard
            return
        step = float(abs((place - before) @ rotation[:, 0]))
        first = self._waiting.pop(number, None)
        for one in (first, (start, heard)):
            if one is not None:
                self._add(one[0], self.places[1][number], one[1], step)

    def _add(self, start: float, transmitter: np.ndarray, heard: np.ndarray, step: float) -> None:
        sent = start + 0.5 * self.pulse.duration
        at = self.motion.of_point(np.array([sent, sent - 1e-4, sent + 1e-4]), transmitter)
        sender = Sender(place=at[0], velocity=(at[2] - at[1]) / 2e-4, rotation=self.motion.rotation(np.array(sent)))
        compressed = self.compressor.compressed(heard)
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
        """Where the body looks ahead on the mean, level: unit vector (3,); of a strip that turns over an aperture."""
        motion, reach = self.motion, 2 * self._sailed
        between = (motion.first, motion.last) if self._straight else (
            max(start - reach, motion.first), min(start + reach, motion.last))
        forward = motion.rotation(np.linspace(*between, STEPS))[:, :2, 0]
        forward = np.hanning(STEPS + 2)[1:-1] @ forward if not self._straight else forward.mean(0)
        return np.append(forward / np.linalg.norm(forward), 0.0)

    def image(self) -> xr.Dataset:
        """Return the image of the pings so far; see `focus`."""
        for number, (start, heard) in self._waiting.items():        # alone with its transmitter
            self._add(start, self.places[1][number], heard, np.inf)
        self._waiting.clear()
        shape = self.grid.depth.shape
        values, loudness = [], amplitude_from_db(self.source_level_db)
        for one in self._images:
            weight = one.weight.numpy()
            total = one.real.numpy() + 1j * one.imaginary.numpy()
            seen = weight > 0
            scale = np.divide(1, weight, out=np.zeros(len(weight)), where=seen) / loudness
            values.append((total * scale).astype(np.complex64).reshape(shape))
        if not any(one.weight.numpy().any() for one in self._images):
            raise ValueError(f"none of {self.pings} pings sees the grid within its beam and record; lay the grid where "
                             "the record looks, or give none")
        image = np.stack(values)
        unseen = np.mean([one.weight.numpy() == 0 for one in self._images])
        if unseen:
            warnings.warn(f"no ping sees {100 * unseen:.2g} % of the grid's points: their level is -inf; check the "
                          "trajectory, or lay the grid where the record looks", stacklevel=2)
        if not np.all(np.isfinite(image)):
            raise ValueError(f"levels overflow, with an absorption of {self.absorption_db:g} dB/m undone and a source "
                             f"level of {self.source_level_db:g} dB; mend these attributes, or lay the grid nearer")
        grid = self.grid
        arrays = {"image": image, "level": db_from_amplitude(np.abs(image)).astype(np.float32),
                  "along_track": grid.along_track, "across_track": grid.across_track, "x": grid.x, "y": grid.y,
                  "depth": grid.depth}
        record = xr.Dataset({name: (IMAGE_VARIABLES[name].dims, some, {
            "units": IMAGE_VARIABLES[name].unit, "long_name": IMAGE_VARIABLES[name].meaning})
            for name, some in arrays.items()}, attrs={
            **self._about, "grid": grid.kind, "grid_origin_x": grid.origin[0], "grid_origin_y": grid.origin[1],
            "grid_heading": grid.heading, "pings": self.pings})
        check_image(record)
        return record


def overlap_shares(along: np.ndarray, step: float) -> np.ndarray:
    """Return the receivers' weights v that make an even aperture of pings that overlap."""
    # along [m]; step [m]
    apart = np.diff(np.unique(np.round(along, 6)))
    if not len(apart):
        return np.ones(len(along))
    spacing = 0.5 * float(np.median(apart))
    middle = 0.5 * (0.5 * (along.max() + along.min()) - along)
    filled = 0.5 * float(np.ptp(along)) + spacing
    if not 1e-3 * spacing < step < filled - 1e-3 * spacing:
        return np.ones(len(along))
    shorter = min(step, filled - step)
    return np.clip((0.5 * filled - np.abs(middle)) / shorter, 0.0, 1.0)


def _as_variables(trajectory: xr.Dataset) -> dict[str, tuple[str, np.ndarray]]:
    ApertureMotion(trajectory)             # refuses what is none
    return {str(name): ("other_motion", np.asarray(trajectory[name].values)) for name in trajectory.variables
            if str(name).startswith("motion_")}


def _profile(raw: xr.Dataset, profile: SoundSpeedProfile | float | None) -> SoundSpeedProfile:
    if isinstance(profile, SoundSpeedProfile):
        return profile
    if profile is None:
        return SoundSpeedProfile(raw["cast_depth"].values, raw["cast_sound_speed"].values)
    return SoundSpeedProfile.constant(profile)


def _aperture(raw: xr.Dataset, wavelength: float, widest: float | None, window: str | tuple | None) -> ImageAperture:
    """The angles that are used, and their weights."""
    lengths = float(raw.attrs["tx_length"]), float(raw.attrs["rx_length"])
    if widest is None:
        widest = min(0.5 * wavelength / max(*lengths, 1e-9), WIDEST)
    if not 0 < widest <= WIDEST:
        raise ValueError(f"aperture is {widest}, the sine of the largest angle from abreast; give one above 0 and up "
                         f"to {WIDEST}")
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
