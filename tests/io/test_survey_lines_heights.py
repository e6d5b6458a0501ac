"""Tide, heights, heads and swaths in KMALL and GSF files: fields by other readers, and round trips."""
import io
import struct
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from soundings_line import blocks_of, soundings_line

from mitsonar.device.rotations import mounting_matrix
from mitsonar.hydrography.record import variable
from mitsonar.io import survey_lines
from mitsonar.io.survey_lines import reading

MEASURED = Path(__file__).resolve().parents[3] / "shared" / "data" / "measured" / "multibeam"
SEPARATION, START = 44.0, 1_777_629_600                # [m]; 2026-05-01T10:00:00Z
SLOPE = 1e-4                                           # [m/s] of the tide: 0.36 m an hour


def tidal(**changes) -> xr.Dataset:
    """Return the line, its depths below LAT: the water stands 1.2 m above it and rises."""
    line = soundings_line(pings=6)
    tide = 1.2 + SLOPE * line["ping_time"].values
    values = {"tide": tide, "true_tide": tide, "ping_height": SEPARATION - line["ping_depth"].values,
              "separation": np.full(tide.size, SEPARATION), **changes}
    return line.assign({name: variable(name, value) for name, value in values.items()}).assign_attrs(
        vertical_datum="LAT")


def two_heads() -> xr.Dataset:
    """Return the line of two heads that receive the same transmissions: pings in pairs, starboard first."""
    line = soundings_line(pings=6, snippets=False)
    time = np.repeat(line["ping_time"].values[::2], 2)
    arms = np.array([[1.0, -1.2, 0.95], [1.0, 1.3, 0.95]])
    return line.assign({name: variable(name, value) for name, value in {
        "ping_time": time, "head": np.tile([1, 0], 3), "head_receive_offset": arms,
        "head_receive_mounting": np.radians([[30.0, 0, 0], [-30.0, 0, 0]])}.items()})


def frames(path, kind):
    """Return the contents of the datagrams of a kind."""
    data, at = path.read_bytes(), 0
    while at < len(data):
        length, name = struct.unpack_from("<I4s", data, at)
        if name.decode() == kind:
            yield data[at + 20:at + length - 4]
        at += length


def pings_of(path):
    """Return the #MRZ as pykmall reads them."""
    from KMALL.kmall import kmall

    for content in frames(path, "#MRZ"):
        reader = kmall(None)
        head = struct.pack("<I4s2BH2I", len(content) + 24, b"#MRZ", 3, 0, 2040, 0, 0)
        reader.FID = io.BytesIO(head + content + bytes(4))
        yield reader.read_EMdgmMRZ()


def body(content, offset=4):
    """Counter, fans, fan, swaths, swath, transmitter, receiver and receivers of a ping's datagram."""
    return struct.unpack_from("<2H8B", content, offset)[1:9]


@pytest.mark.parametrize("suffix, error", [(".kmall", 1e-5), (".gsf", 0.006)])         # GSF: centimetres
def test_tide_heights_and_depths_come_back(suffix, error, tmp_path):
    line = tidal()
    written = survey_lines.write(blocks_of(line), tmp_path / f"a{suffix}")
    assert "tide" not in " ".join(written.words).replace("true_tide", "") and "ping_height" not in str(written.words)
    back = reading.read(tmp_path / f"a{suffix}")
    assert back.attrs["vertical_datum"] == "LAT"
    for name in ("tide", "ping_height", "ping_depth"):
        assert np.abs(back[name].values - line[name].values).max() < error, name
    valid = line["valid"].values[:, :back.sizes["beam"]]
    assert np.abs((back["depth"].values - line["depth"].values[:, :back.sizes["beam"]])[valid]).max() < 1e-4
    # Motion is below the datum, too: between pings as linear as the tide is.
    shift = line["ping_time"].values[0] - back["ping_time"].values[0]
    motion = np.interp(line["motion_time"].values, back["motion_time"].values + shift, back["motion_depth"].values)
    assert np.abs(motion - line["motion_depth"].values).max() < error + SLOPE * 1.0


def test_kmall_states_depths_below_the_surface_and_the_tide_beside_them(tmp_path):
    line = tidal()
    survey_lines.write(blocks_of(line), tmp_path / "a.kmall")
    below = line["ping_depth"].values + line["tide"].values
    for number, ping in enumerate(pings_of(tmp_path / "a.kmall")):
        info = ping["pingInfo"]
        assert info["z_waterLevelReRefPoint_m"] == pytest.approx(-below[number], abs=1e-6)
        assert info["ellipsoidHeightReRefPoint_m"] == pytest.approx(float(line["ping_height"][number]), abs=1e-5)
        valid = line["valid"].values[number, np.isfinite(line["angle"].values[number])]
        depth = line["depth"].values[number][np.isfinite(line["angle"].values[number])] + line["tide"].values[number]
        under = np.array(ping["sounding"]["z_reRefPoint_m"]) - info["z_waterLevelReRefPoint_m"]
        assert np.abs(under - depth)[valid].max() < 1e-5
    tides = list(frames(tmp_path / "a.kmall", "#SHI"))
    assert [struct.unpack_from("<f", content, 10)[0] for content in tides] == pytest.approx(line["tide"].values)
    assert {content[14:] for content in tides} == {b"tide above LAT\0"}
    samples = b"".join(content[12:] for content in frames(tmp_path / "a.kmall", "#SKM"))
    height = np.frombuffer(samples, "<f4").reshape(-1, 33)[:, 9]
    assert np.abs(height - (SEPARATION - line["motion_depth"].values)).max() < 1e-4


def test_kmall_has_the_clock_and_the_fields_of_the_older_format(tmp_path):
    line = tidal()
    survey_lines.write(blocks_of(line), tmp_path / "a.kmall")
    clocks = list(frames(tmp_path / "a.kmall", "#SCL"))
    assert len(clocks) == 4 and clocks[1][16:] == b"$INZDA,100001.00,01,05,2026,,*74\r\n"
    positions, compatible = (list(frames(tmp_path / "a.kmall", kind)) for kind in ("#SPO", "#CPO"))
    assert len(positions) == len(compatible) > 20
    for one, other in zip(positions, compatible):
        place, old = (struct.unpack_from("<2I1f2d3f", content, 8) for content in (one, other))
        assert place[:7] == old[:7]
        # Of the surface, where the older format has its positions.
        level = 1.2 + SLOPE * (place[0] + 1e-9 * place[1] - START)
        assert old[7] == pytest.approx(SEPARATION + level, abs=2 * SLOPE + 1e-5)
    arm, draught = line["transmit_offset"].values, line["motion_depth"].values.mean() + line["tide"].values[0]
    for number, content in enumerate(frames(tmp_path / "a.kmall", "#CHE")):
        roll, pitch = (float(line[f"ping_{name}"][number]) for name in ("roll", "pitch"))
        deeper = -np.sin(pitch) * arm[0] + np.cos(pitch) * (np.sin(roll) * arm[1] + np.cos(roll) * arm[2]) - arm[2]
        depth = float(line["ping_depth"][number] + line["tide"][number])
        assert struct.unpack_from("<f", content, 12)[0] == pytest.approx(depth - draught + deeper, abs=1e-6)


def test_gsf_states_correctors_and_heights_by_the_official_library(tmp_path):
    pytest.importorskip("gsfpy3_09", reason="gsfpy, with the official library, is not installed")
    line = tidal()
    for heights, tide, gps in (("tide", -1, 0), ("gnss", 0, -1)):
        path = tmp_path / f"{heights}.gsf"
        survey_lines.write(blocks_of(line.assign_attrs(heights=heights)), path)
        pings = list(_pings(path))
        assert len(pings) == 6
        for number, (tide_corrector, gps_corrector, height, separation) in enumerate(pings):
            level = float(line["tide"][number])
            assert (tide_corrector, gps_corrector) == pytest.approx((tide * level, gps * level), abs=0.0051)
            assert (height, separation) == pytest.approx((float(line["ping_height"][number]), SEPARATION), abs=6e-4)
        assert reading.read(path).attrs.get("heights") == (None if heights == "tide" else "gnss")


def _pings(path):
    """Yield the correctors and heights of pings as the official library reads them."""
    import gsfpy3_09 as gsfpy

    with gsfpy.open_gsf(str(path)) as file:
        while True:
            try:
                about, found = file.read()
            except gsfpy.GsfException:
                return
            if about.recordID == 2:
                ping = found.mb_ping
                yield ping.tide_corrector, ping.gps_tide_corrector, ping.height, ping.sep


def test_heads_of_a_cycle_share_a_counter(tmp_path):
    line = two_heads()
    survey_lines.write(blocks_of(line), tmp_path / "a.kmall")
    bodies = [body(content) for content in frames(tmp_path / "a.kmall", "#MRZ")]
    # Fans from port: head 0 is fan 0, though it comes second.
    assert bodies == [(cycle, 2, head, 1, 0, head, head, 2) for cycle in (1, 2, 3) for head in (1, 0)]
    assert [body(content) for content in frames(tmp_path / "a.kmall", "#MWC")] == bodies
    text = b"".join(frames(tmp_path / "a.kmall", "#IIP")).decode("ascii", "replace")
    assert "Dual Tx dual Rx" in text and "TRAI_TX2:N=2;X=1.2000" in text and "TRAI_RX2:N=2;X=1.0000;Y=1.3000" in text
    back = reading.read(tmp_path / "a.kmall")
    assert back["head"].values.tolist() == [1, 0] * 3 or sorted(back["head"].values[:2].tolist()) == [0, 1]
    np.testing.assert_allclose(back["head_receive_offset"], line["head_receive_offset"], atol=1e-4)


def test_swaths_of_a_cycle_are_counted_from_aft(tmp_path):
    line = soundings_line(pings=4, snippets=False)
    time = np.repeat(line["ping_time"].values[::2], 2) + np.tile([0.0, 1e-3], 2)
    tilt = line["sector_angle"].values + np.tile(np.radians([2.0, -2.0]), 2)[:, None]
    line = line.assign(ping_time=variable("ping_time", time), sector_angle=variable("sector_angle", tilt))
    survey_lines.write(blocks_of(line), tmp_path / "a.kmall")
    assert [body(content) for content in frames(tmp_path / "a.kmall", "#MRZ")] == [
        (cycle, 2, swath, 2, swath, 0, 0, 1) for cycle in (1, 2) for swath in (1, 0)]


def test_rejected_beams_lie_between_their_neighbours(tmp_path):
    line = soundings_line(pings=2)
    survey_lines.write(line, tmp_path / "a.kmall")
    beams = next(pings_of(tmp_path / "a.kmall"))["sounding"]
    assert beams["detectionType"][2:5] == [0, 2, 0]
    for name in ("twoWayTravelTime_sec", "x_reRefPoint_m", "y_reRefPoint_m", "z_reRefPoint_m"):
        assert beams[name][3] == pytest.approx(np.mean(beams[name][2:5:2]), rel=1e-6)
    assert not reading.read(tmp_path / "a.kmall")["valid"].values[0, 3]


def test_widths_of_beams_and_strengths_are_stated(tmp_path):
    line = soundings_line(pings=2)
    survey_lines.write(line, tmp_path / "a.kmall")
    for number, ping in enumerate(pings_of(tmp_path / "a.kmall")):
        own = line.isel(ping=number)
        down = (own["depth"] - own["ping_depth"]).values
        across = np.hypot(own["across_track"].values, own["along_track"].values)
        slant, steep = np.hypot(down, across), np.arctan2(across, down) < np.radians(15)
        # Footprints of the line are 1 and 2 % of the depth.
        along, aside = (np.degrees(share * own["depth"].values / slant) for share in (0.01, 0.02))
        info, receiver = ping["pingInfo"], ping["rxInfo"]
        assert info["transmitArraySizeUsed_deg"] == pytest.approx(np.nanmedian(along), rel=1e-6)
        assert info["receiveArraySizeUsed_deg"] == pytest.approx(np.median((aside * down / slant)[steep]), rel=1e-6)
        assert receiver["BSnormal_dB"] == pytest.approx(np.median(own["backscatter_db"].values[steep]), rel=1e-6)
        assert receiver["BSoblique_dB"] < receiver["BSnormal_dB"] - 1
    bare = line.drop_vars(["footprint_across", "footprint_along", "backscatter_db"])
    survey_lines.write(bare, tmp_path / "b.kmall")
    assert next(pings_of(tmp_path / "b.kmall"))["pingInfo"]["transmitArraySizeUsed_deg"] == 0.0


def test_parts_of_the_transmit_array_come_back(tmp_path):
    parts = np.array([[0.0, -0.055, -0.012], [0.0, 0.0, -0.006], [0.0, 0.055, -0.012]])
    mounting = np.radians([1.0, -2.0, 3.0])
    offsets = np.broadcast_to(parts[[2, 1, 0]] @ mounting_matrix(*mounting).T, (3, 3, 3))
    line = soundings_line(pings=3).assign(sector_offset=variable("sector_offset", offsets),
                                          transmit_mounting=variable("transmit_mounting", mounting))
    assert "sector_offset" not in str(survey_lines.write(line, tmp_path / "a.kmall").words)
    assert next(pings_of(tmp_path / "a.kmall"))["txSectorInfo"]["txSubArray"] == [2, 1, 0]
    back = reading.read(tmp_path / "a.kmall")          # its transmit_offset is that of the middle part
    np.testing.assert_allclose(back["transmit_offset"].values + back["sector_offset"].values,
                               line["transmit_offset"].values + offsets, atol=6e-5)
    other = line.assign(sector_offset=variable("sector_offset", offsets + np.arange(3)[:, None, None]))
    assert "sector_offset" in str(survey_lines.write(other, tmp_path / "b.kmall").words)


def test_snippets_come_back_from_kmall(tmp_path):
    line = soundings_line(pings=3, column=False)
    survey_lines.write(line, tmp_path / "a.kmall")
    back = reading.read(tmp_path / "a.kmall")
    valid = line["valid"].values[:, :back.sizes["beam"]]
    ours, others = (one["snippet_db"].values[:, :back.sizes["beam"], :9] for one in (back, line))
    assert np.array_equal(np.isfinite(ours), np.isfinite(others) & valid[..., None])
    assert np.nanmax(np.abs(ours - others)) < 0.0501                      # steps of 0.1 dB
    start = np.abs(back["snippet_start"].values - line["snippet_start"].values[:, :back.sizes["beam"]])
    reaching = np.isfinite(others).sum(-1) >= 5                           # the sounding is 4 samples after the first
    assert np.nanmax(start[valid & reaching]) < 0.5 / 20e3 and np.allclose(back["snippet_rate"], 20e3)
    assert "snippet_db" not in reading.read(tmp_path / "a.kmall", water_column=False)
    # A count beyond the end of the datagram is refused before anything is reserved for it.
    data = (tmp_path / "a.kmall").read_bytes()
    counts = data.index(b"#MRZ") - 4 + 24 + 12 + 152 + 3 * 48 + 32 + 118
    (tmp_path / "b.kmall").write_bytes(data[:counts] + b"\xff\xff" + data[counts + 2:])
    with pytest.raises(ValueError, match="#MRZ at byte .* is too short"):
        reading.read(tmp_path / "b.kmall")


def test_a_real_line_comes_back_from_kmall(tmp_path):
    theirs = MEASURED / "em2042_os01.kmall"
    if not theirs.exists():
        pytest.skip(f"there is no {theirs}")
    line = reading.read(theirs)
    survey_lines.write(line, tmp_path / "a.kmall")
    back, kept = reading.read(tmp_path / "a.kmall"), np.isfinite(line["travel_time"].values).any(axis=1)
    line = line.isel(ping=kept)
    assert np.isfinite(line["ping_height"].values).all()
    for name in ("travel_time", "depth", "across_track", "backscatter_db", "ping_height", "snippet_db"):
        ours, others = (one[name].values[np.isfinite(one[name].values)] for one in (back, line))
        np.testing.assert_allclose(ours, others, atol=1e-6, err_msg=name)


def test_a_height_that_is_no_tide_is_not_read(tmp_path):
    line = tidal()
    survey_lines.write(blocks_of(line), tmp_path / "a.kmall")
    other = (tmp_path / "a.kmall").read_bytes().replace(b"tide above LAT\0", b"$PDQUARTZ,1.23\0")
    (tmp_path / "b.kmall").write_bytes(other)
    back = reading.read(tmp_path / "b.kmall")
    assert "tide" not in back and "SHI" in back.attrs["left_out"]
    assert np.allclose(back["ping_depth"], line["ping_depth"] + line["tide"], atol=1e-5)
    place = other.index(b"#SHI") - 4
    short = struct.pack("<I4s", 30, b"#SHI") + bytes(18) + struct.pack("<I", 30)
    (tmp_path / "c.kmall").write_bytes(other[:place] + short)
    with pytest.raises(ValueError, match="#SHI at byte .* is too short"):
        reading.read(tmp_path / "c.kmall")
