"""What the elements of an array hear: the verbs `impulse_response` and `element_signals`.

    h[tx, rx](t)    pressure at rx per unit pressure that tx makes at 1 m [-], complex baseband
    s[rx](t) = 10^(SL/20) Σ_tx w_tx (h[tx, rx] * s_b)(t - τ_tx) + noise                                     [µPa]

SL source level, w_tx and τ_tx weight and delay of the transmit elements, Σ |w_tx| made 1, s_b the pulse's envelope:
the level is that of the steered transmission on its axis. Squares are mean squares: no factor √2.
"""
import operator

import numpy as np
import xarray as xr

from .plugins.errors import as_exception
from .propagation.vector_approximation import DIFFERENCES
from .rendering import checked_seed, opened, provenance
from .signal.doppler import doppler_classes
from .signal.impulses import KERNELS
from .signal.noise import ElementNoise
from .signal.reception import absorbed, check_record, delayed, received
from .sonar import directivity_index_db, element_array
from .units import amplitude_from_db, db_from_power

__all__ = ["RETURN_PATHS", "element_signals", "impulse_response", "pings"]

RETURN_PATHS = (*DIFFERENCES, "eigenray")
LONGEST_FACE = 64                  # wavelengths: beyond, the directivity index follows from that of a smaller face


def impulse_response(scene, ping=0, kernel="band_limited", return_path="vector", seed=0, *, sensor=0, progress=None):
    """Compute the response of every pair of transmit and receive elements.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        With a sensor that has arrays, such as ``array_sonar``.
    ping : int or sequence of int
        Which of the track's pings, from 0.
    kernel : str
        How an echo is put on samples: ``band_limited`` (-55 dB within a third of the sampling rate of the carrier),
        ``peterson`` (low-pass impulse centred on the exact delay) or ``nearest`` (shifted impulse).
    return_path : str
        How delays to elements are found: ``vector``, ``paper`` or ``eigenray`` (exact, an eigenray for every hit and
        element; slow).
    seed : int
        Of rays, where they light the scatterers; the scatterers themselves belong to the scene.
    sensor : int
        Which of the scene's sensors.
    progress : callable(done, total) or None

    Returns
    -------
    xarray.DataArray
        (ping, tx, rx, sample), complex64: pressure per unit pressure at 1 m. ``time`` [s] of the samples since the
        transmission, element positions ``tx_x`` ... ``rx_z`` [m] in the body frame, and of the pings ``x``, ``y``,
        ``z``, ``roll``, ``pitch``, ``heading`` and ``ping_time``.

    Raises
    ------
    ValueError
        If scene and sensor do not fit together, there is no such ping, or kernel or return path is unknown.
    """
    _known(kernel, return_path)
    scene, sensor, integrator = opened(scene, sensor)
    survey, chosen = _survey(integrator, scene, sensor, ping)
    blocks, total = [], len(chosen) * survey.transmit.elements
    for number, one in enumerate(chosen):
        def told(done, of, before=number):
            if progress is not None:
                progress(before * of + done, total)

        blocks.append(survey.responses(one, kernel=kernel, return_path=return_path, seed=checked_seed(seed),
                                       progress=told))
    values = np.stack(blocks)
    values[:, ~survey.transmit.working] = 0
    values[:, :, ~survey.receive.working] = 0
    array = _labelled(values, survey, chosen, "impulse response", "1", transmitters=True)
    array.attrs.update(kernel=kernel, return_path=return_path, **provenance(scene, sensor))
    return array


def element_signals(scene, ping=0, kernel="band_limited", return_path="vector", seed=0, *, sensor=0, progress=None):
    """Compute what every receive element hears of a ping: echoes of the pulse, and noise.

    All transmit elements send together, with their weights and delays. Doppler from the platform's motion stretches
    every echo; absorption is that of each frequency of the pulse; noise is that of the sea and of the receivers.

    Parameters
    ----------
    scene, ping, kernel, return_path, sensor, progress
        As of `impulse_response`.
    seed : int
        Of noise, and of rays where they light the scatterers.

    Returns
    -------
    xarray.DataArray
        (ping, tx, rx, sample), complex64 [µPa], tx of size 1: the whole transmit array. An echo of delay t begins at
        time t, later by the element's own delay where the receive array is steered or focused. Coordinates as of
        `impulse_response`, and ``rx_weight``, ``rx_delay`` [s].

    Notes
    -----
    The record has the band of its sampling rate: kernels are flat to a third of it either side of the carrier. At the
    rate taken where the scene writes none, what an unshaded pulse has beyond costs its echoes 0.1 to 0.3 dB of energy
    (an lfm of 10 kHz and 1 ms 0.12 dB, a cw of 0.1 ms 0.25 dB); ``sample_rate_khz`` of the film keeps more of it.

    Raises
    ------
    ValueError
        As `impulse_response`, or if the sampling rate is below the pulse's bandwidth, or the pulse longer than the
        record.
    """
    _known(kernel, return_path)
    scene, sensor, integrator = opened(scene, sensor)
    pulse = sensor.pulse
    survey, chosen = _survey(integrator, scene, sensor, ping, lead=1.05 * pulse.duration)
    kept = survey.samples - survey.lead
    check_record(pulse, survey.sampling_rate, kept)
    seed, noise = checked_seed(seed), _noise(sensor, survey)
    correction = _absorption(sensor, survey)
    blocks = []
    for number, one in enumerate(chosen):
        signals = np.zeros((survey.receive.elements, survey.samples), np.complex64)      # there may be no echo
        factors = _doppler(survey, one, pulse)
        classes = survey.transmissions(one, factors, pulse, kernel=kernel, return_path=return_path, seed=seed)
        for factor, response in classes:
            if correction is not None:
                response = absorbed(response, survey.sampling_rate, survey.frequency, correction,
                                    survey.sound_speed(one), survey.start)
            signals = signals + received(response, pulse, survey.sampling_rate, factor)
        signals = amplitude_from_db(sensor.source_level_db) * signals
        if noise is not None:
            signals = signals + noise.drawn(survey.samples, seed, int(one))
        if survey.receive.delay.any():
            signals = delayed(signals, survey.receive.delay, survey.sampling_rate, survey.frequency)
        signals[~survey.receive.working] = 0
        blocks.append(signals[:, -kept:].astype(np.complex64))
        if progress is not None:
            progress(number + 1, len(chosen))
    array = _labelled(np.stack(blocks)[:, None], survey, chosen, "element signals", "µPa", transmitters=False)
    array.attrs.update(kernel=kernel, return_path=return_path, seed=seed, source_level_db=sensor.source_level_db,
                       **provenance(scene, sensor))
    return array


def pings(scene, *, sensor=0):
    """Number of pings of a scene's sensor with arrays."""
    scene, sensor, integrator = opened(scene, sensor)
    return integrator.array_survey(scene, sensor).track.pings


def _known(kernel, return_path):
    for name, value, known in (("kernel", kernel, KERNELS), ("return_path", return_path, RETURN_PATHS)):
        if value not in known:
            raise ValueError(f"{name} is {value!r}; give one of {', '.join(known)}")


def _survey(integrator, scene, sensor, ping, lead=0.0):
    """Plan the run, and say which pings are meant."""
    try:
        survey = integrator.array_survey(scene, sensor, lead)
    except RuntimeError as error:
        raise as_exception(error) from error
    wanted = [operator.index(one) for one in np.atleast_1d(ping).tolist()]
    for one in wanted:
        if not 0 <= one < survey.track.pings:
            raise ValueError(f"ping {one} was asked for, but the track has {survey.track.pings}, counted from 0")
    if not wanted:
        raise ValueError("no ping was asked for; give at least one number")
    return survey, wanted


def _labelled(values, survey, pings, name, unit, *, transmitters):
    """Responses or signals with their coordinates."""
    samples, track = values.shape[-1], survey.track
    coords = {"ping": pings, "time": ("sample", survey.time[-samples:], {"units": "s"})}
    for prefix, array in (("tx", survey.transmit), ("rx", survey.receive))[0 if transmitters else 1:]:
        for axis, column in zip("xyz", array.position.T):
            coords[f"{prefix}_{axis}"] = (prefix, column, {"units": "m", "frame": "body: forward, starboard, down"})
    if not transmitters:
        coords["rx_weight"] = ("rx", survey.receive.weight, {"units": "1", "long_name": "shading for beamformers"})
        coords["rx_delay"] = ("rx", survey.receive.delay, {"units": "s", "long_name": "delay of the signals"})
    for axis, column in zip("xyz", track.position[pings].T):
        coords[axis] = ("ping", column, {"units": "m"})
    for angle in ("roll", "pitch", "heading"):
        coords[angle] = ("ping", getattr(track, angle)[pings], {"units": "rad"})
    coords["ping_time"] = ("ping", track.time[pings], {"units": "s"})
    return xr.DataArray(values, dims=("ping", "tx", "rx", "sample"), coords=coords, name=name,
                        attrs={"units": unit, "frequency": survey.frequency, "sampling_rate": survey.sampling_rate,
                               "sound_speed": survey.sound_speed(pings[0])})


def _doppler(survey, ping, pulse):
    """Factors that stand for all echoes of a ping."""
    fastest, speed = float(np.linalg.norm(survey.velocity[ping])), survey.sound_speed(ping)
    if fastest == 0:
        return np.ones(1)
    highest = (speed + fastest) / (speed - fastest)
    return doppler_classes(pulse, 1 / highest, highest)


def _noise(sensor, survey):
    """Noise of the sea, less what the elements' own beams keep out, and of the receivers."""
    if not sensor.noise and sensor.self_noise_db is None:
        return None
    wavelength = survey.sound_speed(0) / survey.frequency
    ambient_db = None
    if sensor.noise:
        ambient_db = sensor.noise_level_db() - _element_directivity_index_db(survey.receive, wavelength)
    return ElementNoise(position=survey.receive.position, wavelength=wavelength, sampling_rate=survey.sampling_rate,
                        ambient_db=ambient_db, self_noise_db=sensor.self_noise_db)


def _element_directivity_index_db(array, wavelength):
    """Gain of one element of an array against noise from everywhere [dB]."""
    longest = LONGEST_FACE * wavelength
    length, height = min(array.length, longest), min(array.height, longest)
    one = element_array([[0.0, 0.0, 0.0]], normal=array.normal[0], along=array.along[0], length=length, height=height,
                        pattern=array.pattern, baffle=array.baffle)
    gain_db = directivity_index_db(one, array.normal[0], wavelength)
    # from there on the gain grows as the sides do
    longer, higher = array.length / length if length else 1.0, array.height / height if height else 1.0
    return gain_db + float(db_from_power(longer ** 2 if array.pattern == "circular" else longer * higher))


def _absorption(sensor, survey):
    """Absorption [dB/m] against frequency [Hz], mean over the water column; None where it is the same for all."""
    water = sensor.water
    if water.given_absorption_db is not None:
        return None
    top = -float(survey.track.position[:, 2].mean())
    depth = np.linspace(top, max(survey.geometry.depth_range[1], top + 1), 33)

    def absorption_db(frequency):
        grid = np.linspace(frequency.min(), frequency.max(), 33)
        column = [float(np.mean(water.absorption_column(f).at(depth))) for f in np.maximum(grid, 1.0)]
        return np.interp(frequency, grid, column)

    return absorption_db
