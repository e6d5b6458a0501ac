"""Responses and signals of an array survey's pings, as labelled arrays.

    h[tx, rx](t)    pressure at rx per unit pressure that tx makes at 1 m [-], complex baseband
    s[rx](t) = 10^(SL/20) Σ_tx w_tx (h[tx, rx] * s_b)(t - τ_tx) + noise                                     [µPa]

SL source level, w_tx and τ_tx weight and delay of the transmit elements, Σ |w_tx| made 1, s_b the pulse's envelope:
the level is that of the steered transmission on its axis. Squares are mean squares: no factor √2.
"""
import warnings

import drjit as dr
import numpy as np
import xarray as xr

from ..signal.doppler import doppler_classes, pieces_of
from ..signal.reception import absorbed, check_record, delayed, received
from ..units import amplitude_from_db
from .cost import sentence

__all__ = ["LEAD", "pair_responses", "received_signals"]

LEAD = 1.05                        # pulses that records must begin earlier: a slow Doppler factor stretches them


def pair_responses(survey, pings, *, kernel, return_path, seed=0, paths=None, progress=None, say=None):
    """Responses of every pair of elements: DataArray (ping, tx, rx, sample), complex64.

    Parameters
    ----------
    survey : ArraySurvey
    pings : sequence of int
    kernel, return_path, seed, paths, progress, say
        As of `mitsonar.impulse_response`.
    """
    _say(say, survey, pings, return_path, all_transmit=True)
    blocks, total = [], len(pings) * survey.transmit.elements
    for number, one in enumerate(pings):
        def told(done, of, before=number):
            if progress is not None:
                progress(before * of + done, total)

        blocks.append(survey.responses(one, kernel=kernel, return_path=return_path, seed=seed, paths=paths,
                                       progress=told))
    values = np.stack(blocks)
    values[:, ~survey.transmit.working] = 0
    values[:, :, ~survey.receive.working] = 0
    return _labelled(values, survey, pings, "impulse response", "1", transmitters=True)


def received_signals(survey, pings, *, kernel, return_path, seed=0, paths=None, progress=None, say=None):
    """Signals of every receive element: DataArray (ping, tx, rx, sample), complex64 [µPa], tx of size 1.

    The survey's record must lead by a pulse; arguments as of `mitsonar.element_signals`.

    Raises
    ------
    ValueError
        If the sampling rate is below the pulse's bandwidth, or the pulse longer than the record.
    """
    pulse, kept, noise = survey.pulse, survey.samples - survey.lead, survey.noise
    try:
        check_record(pulse, survey.sampling_rate, kept)
    except ValueError as error:
        raise ValueError(f"{error} In a scene the film's sample_rate_khz or bins set the rate, and its range the "
                         "record.") from None
    _say(say, survey, pings, return_path)
    blocks = []
    for number, one in enumerate(pings):
        signals = np.zeros((survey.receive.elements, survey.samples), np.complex64)      # there may be no echo
        (fastest, faster), speed = _fastest(survey, one), survey.sound_speed(one)
        pieces = pulse.pieces(pieces_of(pulse, fastest, speed, _nearest(survey, one), faster))
        for done, (begin, piece) in enumerate(pieces):
            def told(share, before=number, done=done):
                progress(before + (done + share) / len(pieces), len(pings))

            for factor, response in survey.transmissions(one, _doppler(piece, fastest, speed), piece=(begin, piece),
                                                         kernel=kernel, return_path=return_path, seed=seed,
                                                         paths=paths, told=progress and told):
                if survey.absorption_db is not None:
                    # as long as the way, not from the beginning of the pulse on
                    response = absorbed(response, survey.sampling_rate, survey.frequency, survey.absorption_db, speed,
                                        survey.start - begin)
                signals = signals + received(response, piece, survey.sampling_rate, factor)
        signals = amplitude_from_db(survey.source_level_db) * signals
        if noise is not None:
            signals = signals + noise.drawn(survey.samples, seed, int(one))
        if survey.receive.delay.any():
            signals = delayed(signals, survey.receive.delay, survey.sampling_rate, survey.frequency)
        signals[~survey.receive.working] = 0
        blocks.append(signals[:, -kept:].astype(np.complex64))
        if progress is not None:
            progress(number + 1, len(pings))
    array = _labelled(np.stack(blocks)[:, None], survey, pings, "element signals", "µPa", transmitters=False)
    return array.assign_attrs(seed=seed, source_level_db=survey.source_level_db)


def _say(say, survey, pings, return_path, **how):
    """Tell how much there is to do, where that is worth a sentence."""
    if say is not None:
        words = sentence(survey, pings, return_path=return_path, threads=dr.thread_count(), **how)
        if words:
            say(words)


def _labelled(values, survey, pings, name, unit, *, transmitters):
    """Responses or signals with their coordinates; tells of arrivals that were lost."""
    lost, arrivals = survey.lost
    if lost:
        warnings.warn(f"{lost:,} of {arrivals:,} arrivals at elements are missing: the echoes meet the array's centre, "
                      "but no direct or once-turned ray leads to those elements", stacklevel=4)
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
                               "lost_arrivals": lost, "sound_speed": survey.sound_speed(pings[0]),
                               "pulse": survey.pulse.numbers})


def _fastest(survey, ping):
    """Speed of the fastest element [m/s], and its largest acceleration [m/s²], while echoes come in."""
    travel, radius = survey.travel(ping, np.zeros(3)), max(survey.transmit.radius, survey.receive.radius)
    # what stands off the track's point is carried round it as the platform turns
    moved, turned = ([float(travel.peak(powers, order)[0]) for order in (1, 2)]
                     for powers in (travel.displacement, travel.turn))
    return moved[0] + turned[0] * radius, moved[1] + (turned[1] + turned[0] ** 2) * radius


def _nearest(survey, ping):
    """Range from which on echoes matter [m]: of the record's beginning, or half of that of bed and surface."""
    beginning = 0.5 * survey.sound_speed(ping) * survey.time[survey.lead]
    return max(beginning, 0.5 * min(float(survey.depth_below[ping]), -survey.track.position[ping, 2]), 1.0)


def _doppler(pulse, fastest, speed):
    """Factors that stand for all echoes of a ping."""
    if fastest == 0:
        return np.ones(1)
    highest = (speed + fastest) / (speed - fastest)
    return doppler_classes(pulse, 1 / highest, highest)
