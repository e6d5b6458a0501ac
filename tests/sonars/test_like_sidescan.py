"""A scene like a recorded sidescan line.

The record is one that this program rendered, with a recorder of known constants, written as XTF. What the file holds
(track, altitude, range, samples, rate) comes back to the digits of the format; what is found by statistics within
tolerances that the tests tell.
"""
import functools
import re
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import mitsonar
from mitsonar.cli.main import main
from mitsonar.io import sidescan_lines
from mitsonar.io.sidescan_lines import jsf_file
from mitsonar.io.xtf import xtf
from mitsonar.planning.twins.like_sidescan import like_sidescan
from mitsonar.planning.twins.sidescan_line import line_of
from mitsonar.planning.twins.sidescan_recorder import recorder_of

PINGS, BINS, RANGE, ALTITUDE, RATE = 128, 400, 40.0, 8.0, 9.0
SCENE = """<scene version="3.0.0">
    <integrator type="sonar_path"><integer name="rays" value="20000"/></integrator>
    <sensor type="sidescan" id="sonar">
        <string name="preset" value="towed_400khz"/>
        <point name="start" x="5" y="7" z="-12"/> <float name="heading_deg" value="30"/>
        <float name="speed_knots" value="3"/> <integer name="pings" value="{pings}"/>
        <float name="ping_rate_hz" value="{rate}"/> {recorder}
        <medium type="seawater"><float name="sound_speed" value="1490"/></medium>
        <film type="sonar_film"><float name="range" value="{range}"/><integer name="bins" value="{bins}"/></film>
    </sensor>
    <shape type="seabed" id="seabed">
        <float name="depth" value="20"/> <float name="length" value="200"/> <float name="width" value="200"/>
        <float name="spacing" value="2"/>
        <bsdf type="lambert">
            <float name="mu_db" value="-27"/> <float name="glints" value="{glints}"/>
        </bsdf>
    </shape>
</scene>"""
RECORDER = {"recorder_bits": 12, "recorder_peak": 0.25, "recorder_low_pass": 0.12, "recorder_tvg": 22.0,
            "recorder_noise_db": -45.0, "recorder_common_noise_db": -51.0, "recorder_line_db": -6.0,
            "recorder_line_ms": 0.5, "recorder_ringing_ms": 0.3, "recorder_row_gain_db": 0.0,
            "recorder_stripe_db": 0.0, "recorder_lost": 0.0, "recorder_bright": 0.0, "recorder_headroom_db": 12.0}


@functools.cache
def record(glints=0.0, **other):
    """A line over an even bed, rendered with the recorder above but for other constants."""
    written = "".join(f'<{"integer" if isinstance(value, int) else "float"} name="{name}" value="{value}"/>'
                      for name, value in {**RECORDER, **other}.items())
    written += '<string name="recorder" value="sidescan_16bit"/><string name="recorder_sectors_db" value="1.5, -1.5"/>'
    text = SCENE.format(pings=PINGS, bins=BINS, range=RANGE, rate=RATE, glints=glints, recorder=written)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "line.xml").write_text(text)
        return mitsonar.render(mitsonar.load_file(Path(folder) / "line.xml"), seed=3)


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    """The folder of a twin, its words, and the numbers of its sensor."""
    folder = tmp_path_factory.mktemp("twin")
    xtf.write(record(), folder / "line.xtf", tvg="counts", start=1.7e9)
    words: list[str] = []
    like_sidescan(folder / "line.xtf", folder / "twin.xml", say=words.append)
    return folder, "; ".join(words), numbers(folder / "twin.xml")


def numbers(path, part="sensor"):
    """The attributes of a part of a scene, with parameters put in."""
    root = ElementTree.parse(path).getroot()
    given = {f"${one.get('name')}": one.get("value") for one in root.iter("default")}
    return {one.get("name"): given.get(one.get("value", ""), one.get("value")) for one in root.find(part).iter()
            if one.get("name")}


def test_what_the_file_holds_comes_back(twin):
    """The header's steps: times of 0.01 s over 14 s make a rate of 1e-4; positions of double precision are smoothed by
    splines, which a straight track passes; the altitude is a float32."""
    folder, words, found = twin
    assert (int(found["pings"]), int(found["bins"])) == (PINGS, BINS)
    assert float(found["range"]) == pytest.approx(RANGE, rel=1e-6)
    assert float(found["ping_rate_hz"]) == pytest.approx(RATE, rel=3e-4)
    assert float(found["frequency_khz"]) == 400 and float(found["sound_speed"]) == 1490
    track = np.loadtxt(folder / "twin_track.csv", delimiter=",", skiprows=1, usecols=range(1, 7))[:PINGS]
    along = np.hypot(*(track[:, :2] - track[0, :2]).T)
    speed = 3 * 1852 / 3600
    assert np.allclose(along, speed * np.arange(PINGS) / RATE, atol=0.03)          # 0.01 s of a ping's time is 15 mm
    assert np.allclose(track[:, 2], -12, atol=1e-3) and np.allclose(track[:, 5], 30, atol=1e-3)
    assert "the altitude is the recorded one, 8" in words


def test_the_recorder_s_constants_are_found(twin):
    """Bits are exact. k of 0.12 makes r1 0.30, which 100 patches of 32 x 32 give to 0.005: 0.01 of k, and a bed that is
    seen by neighbouring pings adds as much. Levels of noise are medians of some 10,000 samples, 0.1 dB, but the low
    pass raises the median of Rayleigh amplitudes by 0.3 dB, and the receiver's own noise lies below. The line ends
    within a sample of 0.13 ms. The gain has the ray noise and speckle of the bed: 2 dB per factor of 10."""
    _, _, found = twin
    assert int(found["recorder_bits"]) == 12 and found["recorder_detector"] == "linear"
    assert float(found["recorder_low_pass"]) == pytest.approx(0.12, abs=0.03)
    assert float(found["recorder_tvg"]) == pytest.approx(22, abs=2)
    both = 10 * np.log10(10 ** -4.5 + 10 ** -5.1)
    own, common = (float(found[f"recorder_{name}noise_db"]) for name in ("", "common_"))
    assert 10 * np.log10(10 ** (own / 10) + 10 ** (common / 10)) == pytest.approx(both, abs=1)
    assert common == pytest.approx(-51, abs=2)
    assert float(found["recorder_line_db"]) == pytest.approx(-6, abs=1)
    assert float(found["recorder_line_ms"]) == pytest.approx(0.5, abs=0.14)
    port, starboard = map(float, found["recorder_sectors_db"].split(","))
    assert port - starboard == pytest.approx(3, abs=0.3)
    assert float(found["recorder_lost"]) == float(found["recorder_repeated"]) == float(found["recorder_bright"]) == 0


def test_glints_and_peaks_are_found_together(tmp_path):
    """Glints spread echoes by s² / β (K of the shape β A / s²): the kurtosis of 128 x 800 samples of bed and a grid of
    shares tell that within a factor of 2. Peaks of a bin have few dark samples, which glints cannot take away."""
    xtf.write(record(glints=60.0, recorder_peak=1.0, recorder_bits=8), tmp_path / "line.xtf", tvg="counts")
    like_sidescan(tmp_path / "line.xtf", tmp_path / "twin.xml")
    found = numbers(tmp_path / "twin.xml")
    bed = numbers(tmp_path / "twin.xml", "bsdf")
    assert int(found["recorder_bits"]) == 8 and float(found["recorder_peak"]) == 1
    assert float(found["recorder_low_pass"]) == pytest.approx(0.12, abs=0.03)
    assert 0.5 < (float(bed["glint_share"]) ** 2 / float(bed["glints"])) / (0.3 ** 2 / 60) < 2


def test_faults_of_pings_are_counted(tmp_path):
    line = record().copy(deep=True)
    counts = line["recorded"].values
    counts[10], counts[40], counts[71] = 0, counts[39], np.minimum(2 * counts[71].astype(int), 4095)
    xtf.write(line, tmp_path / "line.xtf", tvg="counts")
    like_sidescan(tmp_path / "line.xtf", tmp_path / "twin.xml")
    found = numbers(tmp_path / "twin.xml")
    assert [float(found[f"recorder_{name}"]) for name in ("lost", "repeated", "bright")] == [1 / PINGS] * 3
    assert float(found["recorder_bright_db"]) == pytest.approx(6, abs=0.5)


def test_the_twin_has_the_record_s_pings_and_its_counts_by_range(twin):
    """Means of 32 ranges over all pings have 400 looks at 0.5 of their level, 0.2 dB; ray noise adds 0.4 dB."""
    folder, _, _ = twin
    image = mitsonar.render(mitsonar.load_file(folder / "twin.xml", rays=20000), seed=4)
    assert image["recorded"].shape == record()["recorded"].shape
    real, ours = (one["recorded"].values.astype(float).reshape(PINGS, 2, -1, 16).mean((0, 3))
                  for one in (record(), image))
    bed = (np.arange(real.shape[1]) + 0.5) * 16 * RANGE / BINS > 1.15 * ALTITUDE
    assert np.abs(20 * np.log10(ours / real))[:, bed].max() < 1.0
    assert np.abs(20 * np.log10(ours / real))[:, ~bed][:, 1:-1].max() < 2.0


def test_strong_and_weak_places_stay_where_they_are(tmp_path):
    """Counts doubled in one corner of the record are brighter in the same corner of the twin, and nowhere else."""
    line = record().copy(deep=True)
    line["recorded"].values[20:50, 1, 250:330] //= 4
    xtf.write(line, tmp_path / "line.xtf", tvg="counts")
    like_sidescan(tmp_path / "line.xtf", tmp_path / "twin.xml")
    image = mitsonar.render(mitsonar.load_file(tmp_path / "twin.xml", rays=20000), seed=4)["recorded"].values
    even = np.median(image[:, 1, 250:330])
    assert np.median(image[25:45, 1, 260:320]) < 0.45 * even
    assert np.median(image[25:45, 0, 260:320]) > 0.7 * even and np.median(image[80:100, 1, 260:320]) > 0.9 * even


def changed(folder, **columns):
    """Write a line with other columns of its record's pings, and return its path."""
    line = record().isel(ping=slice(0, 80)).copy(deep=True)
    for name, values in columns.items():
        line[name].values[:] = values
    xtf.write(line, folder / "line.xtf", tvg="counts")
    return folder / "line.xtf"


def test_a_missing_or_wrong_altitude_is_that_of_the_first_return(tmp_path):
    """The steepest rise of means of 16 samples lies within two samples of 0.1 m of the first return."""
    for altitude, words in ((0.0, "has no altitude"), (11.0, "is -3.1 m off the recorded altitude")):
        said: list[str] = []
        like_sidescan(changed(tmp_path, altitude=altitude), tmp_path / "twin.xml", say=said.append)
        assert words in "; ".join(said)
        image = mitsonar.load_file(tmp_path / "twin.xml", pings=2)
        depth = image.sensors()[0].film() and mitsonar.render(image)["altitude"]
        assert np.allclose(depth, ALTITUDE, atol=0.25)


def test_a_detector_of_the_root_is_told_by_its_speckle(tmp_path):
    """The root of Rayleigh amplitudes has CV 0.28 and hardly any skewness, -0.1; the low pass before it leaves that."""
    read = sidescan_lines.read(changed(tmp_path))
    for law, power in (("root", 0.5), ("linear", 1.0)):
        counts = np.rint(255 * (read["amplitude"] / 4095.0) ** power).astype(np.uint8)
        assert recorder_of(line_of("line.xtf", read.assign(amplitude=counts)), 5e-5).law == law


def test_a_jsf_makes_the_same_twin(tmp_path, twin):
    """JSF keeps times to the millisecond and places to 0.18 m, which smoothing evens out."""
    jsf_file.write(record(), tmp_path / "line.jsf", tvg="counts", start=1.7e9)
    like_sidescan(tmp_path / "line.jsf", tmp_path / "twin.xml")
    found, same = numbers(tmp_path / "twin.xml"), twin[2]
    for name in ("pings", "bins", "recorder_bits", "recorder_peak", "frequency_khz"):
        assert found[name] == same[name]
    for name, within in (("range", 1e-3), ("ping_rate_hz", 1e-3), ("recorder_tvg", 1.0), ("recorder_low_pass", 0.01),
                         ("recorder_noise_db", 0.5)):
        assert float(found[name]) == pytest.approx(float(same[name]), abs=within)


def test_bad_lines_are_refused_in_a_sentence(tmp_path, capsys):
    line = changed(tmp_path)
    for arguments, words in ((["--pings", "1"], "--pings is 1"), (["-o", str(tmp_path / "twin.txt")], "xml")):
        assert main(["like", str(line), "-o", str(tmp_path / "twin.xml"), *arguments]) == 2
        assert words in capsys.readouterr().err
    assert main(["like", str(line), "-o", str(tmp_path / "twin.xml"), "--frequency", "900"]) == 2
    assert "900 kHz was asked for" in capsys.readouterr().err and not (tmp_path / "twin.xml").exists()
    read = sidescan_lines.read(line)
    cases = [(read.isel(side=slice(0, 1)), "only a side to port"), (read.isel(ping=slice(0, 1)), "has 1 ping"),
             (read.assign(x=read["x"] * np.nan), "needs the navigation"),
             (read.assign(ping_time=read["ping_time"] * np.nan), "no dates"),
             (read.assign(amplitude=read["amplitude"] * 0), "nothing but zeros"),
             (read.assign(amplitude=read["amplitude"].astype(int) - 9), "samples below 0"),
             (read.assign(amplitude=read["amplitude"] * 0.5), "which are whole numbers"),
             (read.assign(amplitude=read["amplitude"] * 0 + 7, altitude=read["altitude"] * np.nan), "no first return")]
    for one, words in cases:
        with pytest.raises(ValueError, match=words) as caught:
            line_of("line.xtf", one)
        assert "\n" not in str(caught.value)


def test_the_command_writes_what_it_found_at_the_head_of_the_scene(tmp_path, capsys):
    line = changed(tmp_path)
    assert main(["like", str(line), "-o", str(tmp_path / "twin.xml"), "--pings", "70", "--cell", "2"]) == 0
    out = capsys.readouterr()
    assert "twin_strength.pfm" in out.out and "recorder: 12 bits" in out.err
    text = (tmp_path / "twin.xml").read_text()
    assert re.search("<!-- recorder: 12 bits", text) and "beams of 0.4 by 50 degrees" in text
    assert "cells of 2 m" in text and numbers(tmp_path / "twin.xml")["pings"] == "70"


def test_a_line_of_one_fix_a_second_is_smooth(tmp_path):
    """Positions repeated for nine pings are used once: steps from ping to ping are within 2 % of their mean."""
    line = record().isel(ping=slice(0, 126))
    held = np.repeat(np.stack([line[axis].values for axis in "xy"])[:, ::9], 9, axis=1)
    xtf.write(line.assign_coords(x=("ping", held[0]), y=("ping", held[1])), tmp_path / "line.xtf", tvg="counts")
    said: list[str] = []
    like_sidescan(tmp_path / "line.xtf", tmp_path / "twin.xml", say=said.append)
    track = np.loadtxt(tmp_path / "twin_track.csv", delimiter=",", skiprows=1, usecols=(1, 2))
    steps = np.hypot(*np.diff(track[9:110], axis=0).T)
    assert "14 fixes" in "; ".join(said) and np.ptp(steps) < 0.04 * steps.mean()
