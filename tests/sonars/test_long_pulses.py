"""Pulses of 100 ms under way: echoes of a point against its kinematics, instant by instant of what was sent.

What a platform of constant velocity v sends at t_s reaches the point p at t_s + |p - x(t_s)| / c, and the element at
t_r by the closed quadratic; with t_s(t_r) by interpolation, an element hears

    y(t) = s_b(t_s(t)) e^{i2πf0 (t_s(t) - t)} / r²

The time scale changes from echo to echo, from element to element, and while the pulse lasts. Coherence of both is what
a matched filter keeps; 0.02 cycles at the ends of pieces, of classes and of neighbours each allow 0.1 dB.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.signal.doppler import pieces_of
from mitsonar.sonar import cw, hfm, lfm
from mitsonar.units import KNOT
from mitsonar.validation.scenes import array_sonar, buried_bed, point_target

C, PULSE = 1500.0, 0.1


def heard(where, speed, **sensor):
    """Signals of the elements, and what they should be."""
    distance = np.linalg.norm(where - [0, 0, -10])
    scene = array_sonar({"bed": buried_bed(200.0), "ball": point_target(where)}, water={"absorption_db_per_km": 0.0},
                        film={"range": distance + 90, "range_min": distance - 5}, integrator={"cell": 50.0},
                        sensor={"pulse_ms": 1e3 * PULSE, "speed_knots": speed / KNOT, "pings": 1, **sensor})
    signals = mitsonar.element_signals(scene)
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    time, velocity, wanted = signals["time"].values, survey.velocity[0], []
    sent = np.linspace(-0.2, 1.2, 30_001) * PULSE
    for element in survey.receive.position @ survey.track.rotation()[0].T:
        out = np.linalg.norm(where - survey.track.position[0] - velocity * sent[:, None], axis=1) / C
        way = survey.track.position[0] + element + velocity * (sent + out)[:, None] - where
        along, rest = way @ velocity, C ** 2 - velocity @ velocity
        received = sent + out + (along + np.sqrt(along ** 2 + rest * np.sum(way ** 2, axis=1))) / rest
        when = np.interp(time, received, sent, left=-1, right=-1)
        wanted.append(survey.pulse.envelope(when) * np.exp(2j * np.pi * survey.frequency * (when - time)))
    level = 10 ** (signals.attrs["source_level_db"] / 20) / distance ** 2
    return signals.values[0, 0].astype(complex), level * np.array(wanted)


def kept_db(got, wanted):
    return 20 * np.log10(np.abs(np.sum(got * wanted.conj(), -1))
                         / np.linalg.norm(got, axis=-1) / np.linalg.norm(wanted, axis=-1))


@pytest.mark.parametrize("where, speed, pulse", [
    ((20.0, 0.0, -15.0), 5.0, {"pulse": "cw"}), ((30.0, 30.0, -15.0), 5.0, {"pulse": "cw"}),
    ((30.0, 30.0, -15.0), 5.0, {"pulse": "lfm", "bandwidth_khz": 2.0})])
def test_an_echo_has_its_own_time_scale(variant, where, speed, pulse):
    """A point abeam, whose factor changes while the pulse is sent; off the bow; the same of a sweep."""
    got, wanted = heard(np.array(where), speed, **pulse)
    assert kept_db(got, wanted).min() > -0.1
    assert 20 * np.log10(np.linalg.norm(got) / np.linalg.norm(wanted)) == pytest.approx(0, abs=0.05)
    peak = np.sum(got * wanted.conj()) / np.sum(np.abs(wanted) ** 2)
    assert abs(np.angle(peak)) / (2 * np.pi) < 0.03


def test_so_has_each_element(variant):
    """Receivers over 2 m: neighbours are heard with one factor, others with another."""
    line = {"pulse": "cw", "receive": "line", "receive_elements": 5, "receive_pitch": 0.5, "receive_axis": "0, 1, 0"}
    got, wanted = heard(np.array([20.0, 20.0, -15.0]), 2.5, **line)
    assert kept_db(got, wanted).min() > -0.1
    assert np.abs(np.angle(np.sum(got * wanted.conj(), -1))).max() / (2 * np.pi) < 0.03


def test_a_pulse_is_the_sum_of_its_pieces():
    for pulse in (cw(1e5, 0.1, "hann"), lfm(1e5, 2e3, 0.1), hfm(1e5, 2e3, 0.1)):
        time, eta = np.linspace(0, 0.0999, 5001), 1.003
        total = 0
        for begin, piece in pulse.pieces(3):
            late = begin / eta
            # the last instant of one piece is the first of the next
            part = piece.envelope(time - late, eta) * (time - late < piece.duration / eta - 1e-9)
            total = total + part * np.exp(-2j * np.pi * np.mod(pulse.frequency * late, 1.0))
            assert piece.band == pulse.band
        inside = time < pulse.duration / eta
        np.testing.assert_allclose(total[inside], pulse.envelope(time, eta)[inside], atol=1e-6)


def test_short_pulses_are_one_piece_and_pieces_keep_the_bound():
    assert pieces_of(lfm(1e5, 2e4, 2e-3), 3.0, C, 5.0) == 1
    pulse = cw(1e5, 0.1)
    count = pieces_of(pulse, 5.0, C, 20.0)
    bend = 2 * 5.0 ** 2 / (20.0 * C)
    assert (pulse.frequency + pulse.band[1]) * bend * (pulse.duration / count) ** 2 / 8 <= 0.02
    assert count == 4
