"""Element signals of point scatterers in homogeneous water, written down in float64: no rays, no kernels."""
import numpy as np
import xarray as xr

SOUND_SPEED, FREQUENCY, SAMPLING_RATE = 1500.0, 300e3, 40e3
WAVELENGTH = SOUND_SPEED / FREQUENCY


def line(elements, pitch=0.5 * WAVELENGTH, axis=(0, 1, 0)):
    """Positions (E, 3) of a uniform line about the origin."""
    return (np.arange(elements) - (elements - 1) / 2)[:, None] * pitch * np.array(axis, float)


def narrow(time):
    """A pulse of 1.5 ms: an array of 32 elements is crossed in 3 % of it."""
    return np.exp(-0.5 * (time / 0.0015) ** 2)


def wide(time):
    """A pulse whose band ends 80 dB down at a third of the sampling rate."""
    return np.exp(-0.5 * (2 * np.pi * 3.1e3 * time) ** 2)


def signals(receivers, points, amplitudes=None, *, transmitters=((0, 0, 0),), pulse=wide, samples=640, sample=320):
    """Record echoes a s_b(t - τ) exp(-2πi f0 τ), the first point's echo by way of the
    transmitters' middle at `sample`.


    `receivers`, `transmitters` (rx, 3), (tx, 3) or with pings before; `points` (P, 3).
    """
    points = np.atleast_2d(np.asarray(points, float))
    amplitudes = np.ones(len(points)) if amplitudes is None else amplitudes
    receivers, transmitters = (np.asarray(place, float).reshape(-1, *np.shape(place)[-2:])
                               for place in (receivers, transmitters))
    pings = max(len(receivers), len(transmitters))
    receivers, transmitters = (np.broadcast_to(place, (pings, *place.shape[1:])) for place in (receivers, transmitters))
    start = 2 * np.linalg.norm(points[0] - transmitters.mean(axis=(0, 1))) / SOUND_SPEED - sample / SAMPLING_RATE
    time = start + np.arange(samples) / SAMPLING_RATE
    values = np.zeros((pings, transmitters.shape[1], receivers.shape[1], samples), complex)
    for point, amplitude in zip(points, amplitudes, strict=True):
        out, back = (np.linalg.norm(point - place, axis=-1) for place in (transmitters, receivers))
        delay = (out[:, :, None] + back[:, None]) / SOUND_SPEED
        values += amplitude * pulse(time - delay[..., None]) * np.exp(-2j * np.pi * FREQUENCY * delay[..., None])
    places = {f"{name}_{axis}": (("ping", name), place[..., k]) for name, place in
              (("rx", receivers), ("tx", transmitters)) for k, axis in enumerate("xyz")}
    return xr.DataArray(values, dims=("ping", "tx", "rx", "sample"), coords={"time": ("sample", time), **places},
                        attrs={"frequency": FREQUENCY, "sound_speed": SOUND_SPEED})
