"""Raw files of echo sounders: made byte by byte, with powers and directions in closed form.

A signal of quadrants whose phases are ±φ/2 fore and aft gives the electrical angle φ, and one of three sectors with a
plane wave's phases that of the wave. An echo that is the filtered pulse itself, a times as strong and n samples late,
is a after compression, at sample n.

The reader was compared with echopype 0.11 on nine recorded files (31 channels of WBT, WBT Mini, WBT Tube and GPT
transceivers; power, angles, signals of 4, 3 and 1 sectors, and chirps): alike to the rounding of 32 bits, 1.3e-5 dB and
1.1e-5 degrees.
"""
import struct

import echo_sounder_by_bytes as by_bytes
import numpy as np
import pytest
from flipped_bits import COPIES, refusals

import mitsonar
from mitsonar.io import echo_sounder_lines

START = 1_700_000_000.125
RNG = np.random.default_rng(8)
STEPS = RNG.integers(-30_000, -2_000, (3, 25))
ANGLES = RNG.integers(-128, 128, (3, 25, 2))


@pytest.fixture
def line(tmp_path):
    """The path of a file of three pings of power and angles at 38 kHz, and of signals at 120 kHz, with navigation."""
    parts = [by_bytes.configuration(START, low=(38_000, 1), high=(120_000, 1)),
             by_bytes.xml(START, by_bytes.ENVIRONMENT), by_bytes.datagram("TAG0", START, b"a mark")]
    for number in range(4):
        time = START + number
        parts.append(by_bytes.datagram("NME0", time, b"$GPGGA,1,47%09.6f,N,00806.0,W,1,,,,M,,M,,*00" % (0.06 * number)))
        parts.append(by_bytes.motion(time, 0.1 * number, number, -number, (358 + number) % 360))
        if number < 3:
            parts += [by_bytes.parameter(time + 0.5, "low"),
                      by_bytes.ping(time + 0.5, "low", power=STEPS[number], angle=ANGLES[number]),
                      by_bytes.parameter(time + 0.5, "high", 16e-6, 'PulseForm="0" Frequency="120000"'),
                      by_bytes.ping(time + 0.5, "high", signal=np.full((40, 4), 2e-3))]
    (tmp_path / "line.raw").write_bytes(b"".join(parts))
    return tmp_path / "line.raw"


def test_power_and_angles_come_back_with_range_time_and_calibration(line):
    with pytest.warns(UserWarning, match="several channels, and the first with pings was read: low .38 kHz., high"):
        got = mitsonar.read(line)
    np.testing.assert_allclose(got["level"], STEPS * 10 * np.log10(2) / 256, rtol=1e-6)
    for number, (way, sensitivity, offset) in enumerate((("athwart", 20, -0.2), ("along", 23, 0.1))):
        expected = ANGLES[..., number] * 180 / 128 / sensitivity - offset
        np.testing.assert_allclose(np.degrees(got[f"angle_{way}"]), expected, atol=1e-5)
    np.testing.assert_allclose(got["range"], np.arange(25) * 64e-6 * 740)
    np.testing.assert_allclose(got["ping_time"], START + 0.5 + np.arange(3), rtol=0, atol=3e-7)
    assert (got.attrs["gain_db"], got.attrs["area_correction_db"], got.attrs["pulse_length"]) == (27.5, -0.2, 1.024e-3)
    assert got.attrs["frequency"] == 38e3 and got.attrs["channels"] == ["low", "high"]
    assert got.attrs["environment"]["Temperature"] == 9.5 and got.attrs["left_out"] == ["1 datagrams of type TAG0"]
    np.testing.assert_allclose(got["latitude"], 47 + 0.001 * (np.arange(3) + 0.5), rtol=1e-12)
    np.testing.assert_allclose(got["longitude"], -8.1)
    for name, values in (("heave", 0.1 * (np.arange(3) + 0.5)), ("roll", np.radians(np.arange(3) + 0.5)),
                         ("pitch", -np.radians(np.arange(3) + 0.5)), ("heading", np.radians([358.5, 359.5, 0.5]))):
        np.testing.assert_allclose(got[name], values, rtol=1e-5)


def test_power_of_signals_is_that_of_their_mean_into_the_impedances(line):
    got = echo_sounder_lines.read(line, frequency=119e3)
    assert got["signal"].dims == ("ping", "rx", "range") and got["signal"].shape == (3, 4, 40)
    expected = 4 * 2e-3**2 / 8 * (5475 / 5400) ** 2 / 75
    np.testing.assert_allclose(got["level"], 10 * np.log10(expected), rtol=1e-6)
    np.testing.assert_allclose(np.degrees(got["angle_along"]), -0.1, atol=1e-6)         # no phase: the offset alone
    np.testing.assert_allclose(np.degrees(got["angle_athwart"]), 0.2, atol=1e-6)


@pytest.mark.parametrize(("beam", "half"), [(1, False), (1, True), (17, False), (65, False)])
def test_phases_of_sectors_are_directions(beam, half, tmp_path):
    along, athwart = 0.5, -0.3                           # [rad], electrical angles of a plane wave
    if beam == 1:                                        # aft-starboard, aft-port, fore-port, fore-starboard
        fore, starboard = np.array([-1, -1, 1, 1]) / 2, np.array([1, -1, -1, 1]) / 2
        phases = fore * along + starboard * athwart
    else:                                                # fore - starboard = α, fore - port = β
        first, second = (np.sqrt(3) * along - athwart) / 2, (np.sqrt(3) * along + athwart) / 2
        phases = np.array([-first, -second, 0.0])
    signal = np.tile(np.exp(1j * phases), (30, 1))
    if beam == 65:                                       # a middle of equal phase halves the phase of a pair
        signal = np.concatenate([np.exp(2j * phases - 0j)[None].repeat(30, 0), np.ones((30, 1))], 1)
        signal[:, 2] = 1.0
    (tmp_path / "a.raw").write_bytes(
        by_bytes.configuration(START, one=(38_000, beam)) + by_bytes.parameter(START, "one")
        + by_bytes.ping(START, "one", signal=signal, half=half))
    got = echo_sounder_lines.read(tmp_path / "a.raw")
    slack = 1e-3 if half else 1e-6
    np.testing.assert_allclose(got["angle_along"], along / 23 - np.radians(0.1), atol=slack)
    np.testing.assert_allclose(got["angle_athwart"], athwart / 20 + np.radians(0.2), atol=slack)


def test_chirps_are_compressed_with_the_filtered_pulse(tmp_path):
    """Pulse of 1.024 ms, 34 to 45 kHz, at 500 kHz, through filters of 7 and 5 coefficients that leave 50 kHz."""
    rate, length, slope, late, strength = 500e3, 1.024e-3, 0.1, 60, 3e-3
    stages = [(RNG.normal(size=7) + 1j * RNG.normal(size=7), 5), (RNG.normal(size=5) + 1j * RNG.normal(size=5), 2)]
    time = np.arange(512) / rate
    sent = np.cos(2 * np.pi * 34e3 * time + np.pi * 11e3 / length * time ** 2)
    ramps = np.hanning(102)
    sent[:51], sent[-51:] = sent[:51] * ramps[:51], sent[-51:] * ramps[51:]
    sent /= sent.max()
    for coefficients, decimation in stages:
        sent = np.convolve(sent, coefficients.astype(np.complex64))[::decimation]
    rows = np.zeros((200, 4), complex)
    rows[late:late + sent.size] = strength * sent[:, None] * np.exp(0.2j * np.array([-1, -1, 1, 1]))
    parts = [by_bytes.configuration(START, one=(38_000, 1)),
             *(by_bytes.stage(START, "one", number + 1, *stage) for number, stage in enumerate(stages)),
             by_bytes.parameter(START, "one", 10 / rate, f'PulseForm="1" FrequencyStart="34000" FrequencyEnd="45000" '
                                                         f'Slope="{slope}"'), by_bytes.ping(START, "one", signal=rows)]
    (tmp_path / "a.raw").write_bytes(b"".join(parts))
    got = echo_sounder_lines.read(tmp_path / "a.raw")
    np.testing.assert_allclose(got["replica"], sent, atol=1e-5 * np.abs(sent).max())
    amplitude = strength * np.cos(0.2)
    assert int(got["level"][0].argmax("range")) == late and got.attrs["pulse_form"] == "FM"
    np.testing.assert_allclose(got["level"][0, late], 10 * np.log10(4 * amplitude**2 / 8 * (5475 / 5400) ** 2 / 75),
                               atol=1e-4)
    np.testing.assert_allclose(got["angle_along"][0, late], 0.4 / 23 - np.radians(0.1), atol=1e-5)
    without = [part for part in parts if part[4:8] != b"FIL1"]
    (tmp_path / "b.raw").write_bytes(b"".join(without))
    raw = echo_sounder_lines.read(tmp_path / "b.raw")
    assert "angle_along" not in raw and "replica" not in raw
    parts[1] = by_bytes.stage(START, "one", 1, *stages[0]).replace(struct.pack("<hh", 7, 5), struct.pack("<hh", 7, 0))
    (tmp_path / "c.raw").write_bytes(b"".join(parts))
    with pytest.raises(ValueError, match="7 coefficients and a decimation of 0"):
        echo_sounder_lines.read(tmp_path / "c.raw")


def test_shorter_pings_end_in_nan_and_ranges_of_pings_are_read_alone(tmp_path):
    parts = [by_bytes.configuration(START, one=(38_000, 0)), by_bytes.parameter(START, "one")]
    for number, length in enumerate((25, 10, 20)):
        parts.append(by_bytes.ping(START + number, "one", power=STEPS[0, :length]))
    (tmp_path / "a.raw").write_bytes(b"".join(parts))
    got = echo_sounder_lines.read(tmp_path / "a.raw")
    assert np.isnan(got["level"].values).sum(1).tolist() == [0, 15, 5] and "angle_along" not in got
    some = echo_sounder_lines.read(tmp_path / "a.raw", pings=slice(1, 3))
    np.testing.assert_array_equal(some["level"], got["level"][1:, :20])
    for pings, words in ((slice(9, 12), "has 3 pings, and none"), (slice(2, 1), "give a slice")):
        with pytest.raises(ValueError, match=words):
            echo_sounder_lines.read(tmp_path / "a.raw", pings=pings)


def test_changes_of_pulse_and_wrong_channels_are_told(line, tmp_path):
    raw = line.read_bytes() + by_bytes.parameter(START + 9, "low", 128e-6) + by_bytes.ping(
        START + 9, "low", power=STEPS[0], angle=ANGLES[0])
    (tmp_path / "a.raw").write_bytes(raw)
    with pytest.raises(ValueError, match="SampleInterval of channel low changes at ping 3.*slice.0, 3"):
        echo_sounder_lines.read(tmp_path / "a.raw", channel="low")
    assert echo_sounder_lines.read(tmp_path / "a.raw", channel="low", pings=slice(0, 3)).sizes["ping"] == 3
    for choice, words in (({"channel": "none"}, "low .38 kHz., high .120 kHz."), ({"frequency": 200e3}, "200 kHz was"),
                          ({"channel": "low", "frequency": 38e3}, "give one of them")):
        with pytest.raises(ValueError, match=words):
            echo_sounder_lines.read(line, **choice)


def test_an_echogram_is_drawn_and_stored(line, tmp_path):
    got = echo_sounder_lines.read(line, channel="high")
    axes = mitsonar.plots.plot(got, path=tmp_path / "line.png", tvg="target")
    assert any("dB re 1 W" in ax.get_ylabel() for ax in axes.figure.axes)
    mitsonar.write(got, tmp_path / "line.nc")
    back = mitsonar.read(tmp_path / "line.nc")
    np.testing.assert_array_equal(back["signal"], got["signal"])
    assert back.attrs["environment"] == got.attrs["environment"]


BOMB = '<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;&b;">]><Environment Depth="&c;"/>'


@pytest.mark.parametrize(("change", "words"), [
    (lambda raw: raw[:-5], "cut off"),
    (lambda raw: raw + by_bytes.xml(START, BOMB), "declares a document type"),
    (lambda raw: raw + by_bytes.xml(START, "<Environment"), "is broken"),
    (lambda raw: raw.replace(struct.pack("<HHii", 3, 0, 0, 25), struct.pack("<HHii", 3, 0, 0, 2**31 - 1), 1),
     "samples take|samples, more than"),
    (lambda raw: raw.replace(struct.pack("<HHii", 3, 0, 0, 25), struct.pack("<HHii", 3, 0, 0, -7), 1), "-7 samples"),
    (lambda raw: raw[:16] + b"?" + raw[17:], "is broken"),
    (lambda raw: by_bytes.configuration(START, low=(38_000, 1)), "no pings"),
])
def test_cut_hostile_and_broken_datagrams_are_refused_in_one_sentence(line, change, words):
    line.write_bytes(change(line.read_bytes()))
    with pytest.raises(ValueError, match=words) as caught:
        echo_sounder_lines.read(line, channel="low")
    assert "\n" not in str(caught.value)


def test_flipped_bits_of_datagrams_end_in_a_record_or_a_sentence(line):
    rng = np.random.default_rng(9)
    refused = refusals(line, echo_sounder_lines.read,
                       "cannot read the echo sounder's file",
                       lambda size: rng.integers(0, size, 4), rng)
    assert 5 < refused < COPIES
