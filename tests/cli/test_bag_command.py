"""The command `bag`: bags of records, and one sentence about what is wrong."""
import sys

import numpy as np
import pytest
from read_bag import one, picture, read
from soundings_line import soundings_line
from synthetic_fan import fan
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.device.extras import MissingExtra
from mitsonar.io.bags import bag

pytest.importorskip("rosbags", reason="rosbags is not installed")


@pytest.fixture
def records(folder):
    """A sidescan's image and a line of soundings in the current folder."""
    image, line = sidescan(pings=4, bins=20), soundings_line(pings=2)
    mitsonar.io.write(image, "side.exr")
    mitsonar.io.write(line, "line.nc")
    return image, line


def test_a_record_becomes_a_bag_and_what_is_in_it_is_said(records, capfd):
    assert cli.main(["bag", "side.exr", "-o", "a.mcap", "--start", "2026-05-01T10:00:00Z"]) == 0
    out, err = capfd.readouterr()
    assert out == "a.mcap\n" and err.count("\n") == 1 and "4 of /sonar/image" in err
    stamp, message = read("a.mcap")["/sonar/image"][1]
    assert stamp == round((bag.seconds_of("2026-05-01T10:00:00Z") + 0.1) * 1e9)
    np.testing.assert_array_equal(picture(message.image), records[0]["level"].values[1].T)


def test_topics_of_several_records_have_their_names(records, capfd):
    assert cli.main(["bag", "side.exr", "line.nc", "-o", "a.mcap"]) == 0
    messages = read("a.mcap")
    assert {"/side/image", "/line/detections", "/line/odometry", "/side/odometry", "/tf"} <= set(messages)
    assert one(messages, "/side/image").header.frame_id == "side/sonar"
    assert one(messages, "/line/odometry").child_frame_id == "line/base_link"


def test_what_is_wrong_is_said_in_one_sentence_and_leaves_no_file(records, refusal, folder):
    (folder / "notes.txt").write_text("notes")
    (folder / "cut.exr").write_bytes((folder / "side.exr").read_bytes()[:2000])
    (folder / "empty.nc").write_bytes(b"")
    for words, *arguments in (("must end in .mcap", "side.exr", "-o", "a.bag"),
                              ("there is no such file", "none.nc", "-o", "a.mcap"),
                              ("notes.txt", "notes.txt", "-o", "a.mcap"),
                              ("cut.exr", "cut.exr", "-o", "a.mcap"),
                              ("empty.nc", "empty.nc", "-o", "a.mcap"),
                              ("cut.exr", "side.exr", "cut.exr", "-o", "a.mcap"),
                              ("/side/", "side.exr", "side.exr", "-o", "a.mcap"),
                              ("--cell draws fans", "side.exr", "-o", "a.mcap", "--cell", "1"),
                              ("--start", "side.exr", "-o", "a.mcap", "--start", "1800-01-01"),
                              ("does not exist", "side.exr", "-o", "none/a.mcap")):
        assert words in refusal("bag", *arguments)


def test_signals_have_no_message(folder, refusal):
    import xarray as xr

    signals = xr.DataArray(np.ones((1, 1, 2, 4), np.complex64), dims=("ping", "tx", "rx", "sample"), name="signals")
    mitsonar.io.write(signals, "signals.nc")
    assert "signals of elements have no message" in refusal("bag", "signals.nc", "-o", "a.mcap")


def test_without_rosbags_the_command_says_what_to_install(records, monkeypatch):
    """By an error that the set-up of a checkout mends, and `mitsonar.__main__` prints elsewhere."""
    bag.typestore.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(MissingExtra, match=r"run pip install 'mitsonar\[ros\]'") as caught:
        cli.main(["bag", "side.exr", "-o", "a.mcap"])
    assert caught.value.extra == "ros"


def test_a_bag_that_fails_midway_leaves_the_older_file(records, folder, monkeypatch):
    (folder / "a.mcap").write_bytes(b"older")

    def fails(*_, **__):
        yield from bag.messages(records[0])
        raise ValueError("no more pings")
    monkeypatch.setattr(bag, "of_parts", fails)
    assert cli.main(["bag", "side.exr", "-o", "a.mcap"]) == 2
    assert (folder / "a.mcap").read_bytes() == b"older"
    assert {path.name for path in folder.iterdir()} == {"scene.xml", "side.exr", "line.nc", "a.mcap"}


@pytest.fixture
def own_bag(folder):
    """A bag of a fan that moves north at 1 m/s, two pings a second, 5 m deep; the image's last beam is to starboard."""
    record = fan(pings=5, beams=9, bins=12)
    pings = np.arange(5)
    values = {**dict.fromkeys(("x", "roll", "pitch", "heading"), 0 * pings), "ping_time": 0.5 * pings,
              "y": -4 + 0.5 * pings, "z": 0 * pings - 5.0}
    record = record.assign_coords({name: ("ping", value.astype(float)) for name, value in values.items()})
    bag.write(record, "run.mcap", start=bag.seconds_of("2026-05-01T10:00:00Z"))
    return record


def test_a_scene_sails_the_track_of_a_bag_at_the_pings_of_its_sonar(own_bag, folder, capfd):
    (folder / "twins").mkdir()
    assert cli.main(["bag", "run.mcap", "--like", "scene.xml", "-o", "twins/twin.xml", "--shift", "1", "0", "-3"]) == 0
    assert capfd.readouterr().out == "twins/twin.xml\ntwins/twin_track.csv\n"
    image = mitsonar.render("twins/twin.xml", rays=500)
    np.testing.assert_allclose(image["ping_time"] - image["ping_time"][0], 0.5 * np.arange(5), atol=1e-4)
    assert float(image["ping_time"][0]) == bag.seconds_of("2026-05-01T10:00:00Z")
    for name, values in (("x", 1.0), ("y", own_bag["y"]), ("z", -8.0), ("heading", 0.0)):
        np.testing.assert_allclose(image[name], values, atol=1e-3, err_msg=name)


def test_images_of_a_bag_become_a_record(own_bag, folder, capfd):
    assert cli.main(["bag", "run.mcap", "-o", "real.nc", "--topic", "/sonar/image"]) == 0
    assert capfd.readouterr().out == "real.nc\n"
    image = mitsonar.read("real.nc")
    np.testing.assert_array_equal(image["level"], own_bag["level"])
    np.testing.assert_allclose(image["y"], own_bag["y"], atol=1e-9)
    assert cli.main(["bag", "run.mcap", "-o", "real.exr", "--topic", "/sonar/image", "--pings", "1:3"]) == 0
    np.testing.assert_array_equal(mitsonar.read("real.exr")["level"], own_bag["level"][1:3])
    assert cli.main(["raster", "real.exr", "-o", "real.png"]) == 0        # to lay beside a rendered one


def test_options_that_do_not_go_together_are_refused(own_bag, records, refusal, folder):
    (folder / "camera.xml").write_text('<scene version="3.0.0"><sensor type="perspective"/></scene>')
    for words, *arguments in (("give --like", "run.mcap", "-o", "a.xml"),
                              ("--topic reads a bag", "side.exr", "-o", "a.mcap", "--topic", "/a"),
                              ("--cell writes a bag", "run.mcap", "-o", "a.nc", "--cell", "1"),
                              ("--shift makes a scene", "run.mcap", "-o", "a.nc", "--shift", "0", "0", "0"),
                              ("--pings is 'a'", "run.mcap", "-o", "a.nc", "--topic", "/sonar/image", "--pings", "a"),
                              ("no such images", "run.mcap", "-o", "a.nc", "--topic", "/sonar/image", "--pings", "9:"),
                              ("--pings reads images", "run.mcap", "--like", "scene.xml", "-o", "a.xml", "--pings",
                               ":1"),
                              ("one is read at a time", "run.mcap", "run.mcap", "-o", "a.nc"),
                              ("above the sea surface", "run.mcap", "--like", "scene.xml", "-o", "a.xml", "--shift",
                               "0", "0", "9"),
                              ("sails no track", "run.mcap", "--like", "camera.xml", "-o", "a.xml"),
                              ("scene nothing does not exist", "run.mcap", "--like", "nothing", "-o", "a.xml"),
                              ("choose one by --topic", "run.mcap", "-o", "a.nc"),
                              ("the name of a bag ends in", "side.exr", "-o", "a.nc")):
        assert words in refusal("bag", *arguments)


@pytest.mark.filterwarnings("ignore:the track is cut by pings")
def test_fixes_without_depth_take_the_scenes_altitude_or_a_depth(folder, refusal):
    def fix(number):
        return bag.BagMessage(topic="/fix", type="sensor_msgs/msg/NavSatFix", stamp=10 ** 9 * (1 + number), fields={
            "header": {"stamp": {"sec": 1 + number}, "frame_id": "gps"}, "latitude": 54.0 + 1e-5 * number,
            "longitude": 8.0, "altitude": 41.0})
    bag.write_messages(map(fix, range(8)), "run.mcap")
    assert "do not say how deep" in refusal("bag", "run.mcap", "--like", "scene.xml", "-o", "a.xml")
    assert "in latitude and longitude; give 0 0 UP" in refusal("bag", "run.mcap", "--like", "scene.xml", "-o", "a.xml",
                                                               "--shift", "1", "0", "-5")
    text = (folder / "scene.xml").read_text()
    high = text.replace('<integer name="pings"', '<float name="altitude" value="12"/><integer name="pings"')
    (folder / "high.xml").write_text(high)
    for scene, shift, z in (("scene.xml", ["--shift", "0", "0", "-5"], -5.0), ("high.xml", [], -18.0)):
        assert cli.main(["bag", "run.mcap", "--like", scene, "-o", "twin.xml", *shift]) == 0
        image = mitsonar.render("twin.xml", pings=4, rays=500)          # pings still limits
        assert image.sizes["ping"] == 4
        np.testing.assert_allclose(image["z"], z, atol=1e-3)
        np.testing.assert_allclose(image["heading"], 0, atol=1e-3)       # the course: there is no Imu
        # a hundred-thousandth of a degree of latitude is 1.113 m; the fixes are a second apart
        speed = np.diff(image["y"]) / np.diff(image["ping_time"])
        np.testing.assert_allclose(speed, 1.113, rtol=2e-3)
