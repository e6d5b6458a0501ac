"""What a page of records shows, read back from its recording by rerun's own reader: entities, times, places."""
import urllib.request

import numpy as np
import pytest
from read_view import pixels
from synthetic_fan import fan, head
from synthetic_sidescan import sidescan

import mitsonar

pytest.importorskip("rerun", reason="rerun-sdk is not installed")


def test_every_ping_of_a_fan_is_a_frame_at_its_time(shown):
    read = shown(fan(pings=3))
    assert {"/fan/fan/level", "/fan/fan/label", "/fan/fan/objects", "/fan/fan/share_of_objects", "/fan/fan/shadow",
            "/fan/fan/seabed_depth", "/fan/fan/ranges"} <= set(read)
    assert read["/fan/fan/level"].times == [0.0, 1.0, 2.0]         # numbers of pings, since the record has no times


def test_an_object_stands_where_it_is_in_metres(shown):
    """The middle of box.1 is at x = -3, y = 8 m and 0.5 m nearer in each ping; tolerance: a cell and a bin."""
    read = shown(fan(pings=3), cell=0.1)["/fan/fan/objects"]
    for ping in range(3):
        rows, columns = np.nonzero(pixels(read.rows[ping]) == 2)
        x, y = (columns.mean() + 0.5) * 0.1 - 20 * np.sin(np.radians(60)), 20 - (rows.mean() + 0.5) * 0.1
        assert x == pytest.approx(-3, abs=0.13) and y == pytest.approx(8 - 0.5 * ping, abs=0.13)


def test_levels_are_those_of_the_record_with_their_gain(shown):
    """Levels without gain are those of raster, to the 16 bits of a page (0.06 dB at 100 dB)."""
    record = fan()
    read = pixels(shown(record, tvg=None, cell=0.1)["/fan/fan/level"].rows[0])
    drawn = mitsonar.imaging.cartesian(record, 0.1, names=["level"])["level"].values[0]
    bright = np.isfinite(drawn) & (drawn > read.min() + 1)
    assert read.shape == drawn.shape and bright.any()
    np.testing.assert_allclose(read[bright], drawn[bright], atol=0.06)


def test_turns_of_a_head_are_frames(shown):
    assert len(shown(head(turns=2, steps=60, bins=80))["/fan/fan/level"].rows) == 2


def test_a_sidescan_is_one_picture_with_a_line_at_each_ping(shown):
    record = sidescan(pings=7, bins=40)
    read = shown(record)
    assert not read["/sidescan/waterfall/level"].rows and not read["/sidescan/waterfall/label"].rows
    assert pixels(read["/sidescan/waterfall/level"].fixed[0]).shape[1] > 40
    np.testing.assert_allclose(read["/sidescan/waterfall/ping"].times, record["ping_time"])
    assert len(read["/world/sidescan/sonar"].times) == 7


def test_the_sonar_and_its_beams_stand_in_the_scene_frame(shown):
    """A northbound sidescan: beams lead east and west, down, and as far as the record."""
    record = sidescan(pings=2, bins=40)
    read = shown(record)
    places = np.array(read["/world/sidescan/sonar"].column("Transform3D:translation")[1], float)[0]
    np.testing.assert_allclose(places, [record[axis].values[1] for axis in "xyz"], atol=1e-4)
    port, starboard = (np.array(strip, float) for strip in
                       read["/world/sidescan/beams"].column("LineStrips3D:strips")[1])
    np.testing.assert_allclose(starboard[0], places, atol=1e-4)
    assert starboard[1, 0] > places[0] > port[1, 0] and starboard[1, 2] <= places[2]
    assert np.linalg.norm(starboard[1] - starboard[0]) == pytest.approx(float(record["range"][-1]), rel=1e-5)


def test_records_of_one_name_are_shown_beside_each_other(shown):
    read = shown(fan(), fan(seed=2))
    assert {"/fan/fan/level", "/fan_2/fan/level"} <= set(read)


def test_what_cannot_be_shown_is_refused_and_leaves_no_file(tmp_path):
    for words, what, options in (("nothing to show", (), {}), ("no image", (fan()[["label"]],), {}),
                                 ("no image", (fan()["level"],), {}), ("cell", (sidescan(pings=2),), {"cell": 1.0}),
                                 ("nothing to show", (sidescan(pings=2).isel(ping=[]),), {}),
                                 ("must end in .rrd", (fan(),), {"save": tmp_path / "run.html"})):
        with pytest.raises(ValueError, match=words):
            mitsonar.view(*what, **{"save": tmp_path / "run.rrd", **options})
    assert not list(tmp_path.iterdir())


def test_a_notebook_shows_the_page_which_is_closed_once_or_twice():
    page = mitsonar.view(fan())
    assert page is not None
    assert f'<iframe src="{page.url}"' in page._repr_html_()
    page.close()
    page.close()
    with pytest.raises(OSError):
        urllib.request.build_opener(urllib.request.ProxyHandler({})).open(page.url, timeout=5)
