"""`scenes` and `describe`: what there is, with defaults and units, and nothing left without a word."""
import re
import subprocess
import sys
from pathlib import Path

import pytest
from small_scene import TEXT

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.io.scene_files import scene_words, scenes
from mitsonar.sonar.preset_tables import TABLES, instruments, presets


@pytest.fixture
def said(folder, capfd):
    """Run a command that must work, and give what it prints, with its lines joined."""
    def run(*arguments):
        capfd.readouterr()
        assert cli.main(list(arguments)) == 0
        out, err = capfd.readouterr()
        assert err == ""
        return out
    return run


def joined(text):
    return " ".join(text.split())


def test_every_scene_is_listed_on_a_line(said):
    lines = said("scenes").splitlines()
    assert [line.split()[0] for line in lines] == scenes.shipped() and len(lines) > 8
    assert all(20 < len(line) <= 110 and len(line.split()) > 3 for line in lines)
    assert "The simplest survey: a towed sidescan over a flat" in lines[scenes.shipped().index("sidescan_flat")]


@pytest.mark.parametrize("name", scenes.shipped())
def test_every_parameter_of_every_scene_has_words(said, name):
    out = said("describe", name)
    _, parameters = scene_words.described(scenes.find(name))
    assert parameters
    for one in parameters:
        meaning = re.search(rf"^-D {one.name}={re.escape(one.default)}\n((?:    .+\n)+)", out, re.M)
        assert meaning and len(joined(meaning[1]).split()) > 3, one.name


def test_a_parameter_is_described_by_what_it_is_given_to(said):
    out = joined(said("describe", "sidescan_flat"))
    assert "-D range=100 range of sonar_film, a number [m] above 0 and at most 100000: end of the" in out
    assert "-D depth=40 depth of seabed, a number [m]: depth of the mean bed" in out


def test_a_comment_comes_first(folder, said):
    text = TEXT.replace('name="range" value="60"/>', 'name="range" value="60"/> <!-- m, as far\n as -->')
    text = text.replace("<scene", "<?xml version=\"1.0\"?>\n<!-- A bed.\n It is flat. -->\n<scene", 1)
    (folder / "mine.xml").write_text(text, encoding="utf-8")
    out = joined(said("describe", "mine.xml"))
    assert out.startswith("mine.xml A bed. It is flat. -D pings=2 pings of sonar, an integer at least 1")
    assert "-D range=60 m, as far as -D speckle=true" in out


def test_a_command_in_the_heading_stands_on_a_line_of_its_own(said):
    lines = [line.strip() for line in said("describe", "multibeam").splitlines()]
    assert "mitsonar soundings multibeam -o line.nc" in lines and "mitsonar render multibeam -o column.exr" in lines


def test_a_comment_on_the_next_line_is_of_something_else(folder, said):
    text = TEXT.replace('<default name="range" value="60"/>', '<default name="range" value="60"/>\n<!-- The rest -->')
    (folder / "mine.xml").write_text(text, encoding="utf-8")
    assert "The rest" not in said("describe", "mine.xml")


def test_attributes_of_a_plugin(said):
    out = joined(said("describe", "sidescan"))
    assert out.startswith('<sensor type="sidescan"> Sidescan sonar: port and starboard faces')
    assert "frequency_khz: a number [kHz] at least 0.001 and at most 10000, default preset centre frequency" in out
    assert 'preset: one of "towed_100khz", "towed_300khz", "towed_400khz"' in out and "default towed_400khz" in out
    assert "depth: a number [m], needed depth of the mean bed" in joined(said("describe", "seabed"))
    array = joined(said("describe", "array_sonar"))
    assert "receive_rows: an integer at least 1 and at most 100000, default 1 number of rows of a plane" in array
    assert "altitude: a number [m] at least 0, default 20, of a recorded track 0 height above the seabed" in array
    assert "receive_steer_deg: 2 numbers [degrees] separated by commas" in array


def test_a_name_of_both_a_sensor_and_a_scene_describes_both(said):
    out = joined(said("describe", "forward_looking"))
    assert '<sensor type="forward_looking"> Forward-looking sonar' in out and "-D frequency_khz=300 " in out


def test_every_plugin_can_be_described(said, variant):
    from mitsonar.plugins import reference

    for plugin in reference.plugins():
        out = said("describe", plugin)
        assert out.startswith(f'<{reference.kind_of(plugin)} type="{plugin}">')
        for one in reference.attributes(plugin):
            assert re.search(rf"^{reference.plain(one.name)}: .+\n    \S", out, re.M), f"{plugin}: {one.name}"


def test_a_parameter_is_described_by_the_attribute_that_it_sets(folder, said):
    text = TEXT.replace("<integrator", '<default name="light" value="rays"/>\n<integrator', 1)
    text = re.sub(r'(<integrator type="sonar_path">)', r'\1<string name="ensonification" value="$light"/>', text)
    (folder / "mine.xml").write_text(text, encoding="utf-8")
    expected = ('-D light=rays ensonification of sonar_path, one of "scatterers", "rays": method to find the echoes of '
                "an array's cells")
    assert expected in joined(said("describe", "mine.xml"))


def test_the_page_of_all_plugins(said):
    from mitsonar.plugins import page

    assert said("describe", "--markdown") == page.markdown()


def test_the_page_of_all_instruments(said):
    from mitsonar.plugins import instruments

    page = (Path(__file__).parents[2] / "scenes" / "manual" / "instruments.md").read_text(encoding="utf-8")
    assert said("describe", "instruments", "--markdown") == instruments.markdown() == page, (
        "run python3 -m mitsonar describe instruments --markdown > scenes/manual/instruments.md")


def test_an_instrument_has_every_figure_with_its_unit_and_source(said):
    """A figure of its own has a number or a rule, listed below; every other figure of the class is marked so."""
    out = said("describe", "oculus_m1200d_2100khz")
    text = joined(out)
    assert '<sensor type="forward_looking"> <string name="preset" value="oculus_m1200d_2100khz"/>' in text
    assert "frequency_khz: 2100 kHz [1] carrier frequency" in text and "fan_deg: 60 degrees [1]" in text
    assert "bandwidth_khz: 300 kHz [rule 2]" in text and "self_noise_db: 57 dB re 1 µPa²/Hz [class]" in text
    assert "max_range: 10 m [1] published: greatest range" in text
    assert "[1] Blueprint Subsea, Oculus M-series data sheet DA-148-P01443-10" in text
    assert "[rule 2] bandwidth_khz = c / (2 range_resolution)" in text and "[class] usual value" in text
    own = presets("forward_looking")["oculus_m1200d_2100khz"]
    assert set(re.findall(r"^(\w+): .+ \[(?:class|rule \d+|\d+)\]$", out, re.M)) >= set(own)


def test_instruments_are_listed_and_a_class_says_that_it_is_one(said):
    listed = said("describe", "instruments")
    assert all(f"{name} ({kind})" in listed for kind in TABLES for name in instruments(kind))
    assert "frequency_khz: 400 kHz [class]" in said("describe", "towed_400khz")


@pytest.mark.parametrize("arguments, sentence", [
    (["describe"], "takes the name of a scene, a plugin or a preset, or --markdown; give one of them"),
    (["describe", "sidescan", "--markdown"], "--markdown takes no name but instruments; leave sidescan or")])
def test_a_name_or_a_page_is_asked_for(refusal, arguments, sentence):
    assert sentence in refusal(*arguments)


@pytest.mark.parametrize("arguments, hint", [
    (["describe", "oculus_m75d"], "oculus_m750d"), (["rendr"], "render"), (["describe", "sidescn"], "sidescan"),
    (["describe", "sidescan_flaat"], "sidescan_flat"),
    (["render", "sidescan_flt", "-o", "a.exr"], "sidescan_flat"),
    (["render", "scene.xml", "-o", "a.exr", "--sed=3"], "--seed"),
    (["render", "scene.xml", "-o", "a.exr", "-D", "ping=3"], "pings"), (["sweep", "minefeld"], "minefield"),
    (["signals", "scene.xml", "-o", "a.nc", "--kernel", "nearst"], "nearest"),
    (["signals", "scene.xml", "-o", "a.nc", "--return-path", "eigenrays"], "eigenray"),
    (["published", "figur_2"], "figure_2"), (["validate", "--only", "sediment"], "sediments"),
    (["plot", "a.exr", "--tvg", "seabd"], "seabed"),
])
def test_misspelt_words_are_answered_with_what_may_be_meant(refusal, arguments, hint):
    assert f'(did you mean "{hint}"?)' in refusal(*arguments)


@pytest.mark.parametrize("old, new, hint", [
    ('type="sidescan"', 'type="side_scan"', '(did you mean "sidescan"?)'),
    ('<integer name="pings" value="$pings"/>', '<string name="preset" value="towed_400"/>',
     '(did you mean "towed_400khz"?)'),
    ('<float name="depth"', '<float name="dpth"', 'attribute depth is missing (is it written as "dpth"?)'),
    ('<integer name="pings" value="$pings"/>', '<string name="preset" value="edgetech_4126"/>',
     '(did you mean "edgetech_4125"?)'),
    ('type="lambert"', 'type="lambart"', '(did you mean "lambert"?)'),
])
def test_misspelt_words_in_a_scene_too(folder, refusal, old, new, hint):
    assert old in TEXT
    text = TEXT.replace(old, new)
    if "$pings" not in text:
        text = text.replace('    <default name="pings" value="2"/>\n', "")
    (folder / "mine.xml").write_text(text, encoding="utf-8")
    assert hint in refusal("render", "mine.xml", "-o", "a.exr")


# ---- the same from Python

@pytest.mark.parametrize("first", ["mitsonar.scenes()", "import mitsonar.scenes", "files('mitsonar.scenes')"])
def test_scenes_is_a_function_and_a_package_of_files_whichever_comes_first(first):
    code = f"""import mitsonar
from importlib.resources import files
{first}
assert "sidescan_flat" in mitsonar.scenes() and (files("mitsonar.scenes") / "sidescan_flat.xml").is_file()
assert "sidescan_flat" in mitsonar.scenes()
import sys
print("mitsuba" in sys.modules)"""
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "False\n"


def test_scenes_and_describe_give_what_the_commands_print(said):
    assert list(mitsonar.scenes()) == scenes.shipped() and repr(mitsonar.scenes()) + "\n" == said("scenes")
    for name in ("sidescan_flat", "sidescan", "forward_looking"):
        assert joined(repr(mitsonar.describe(name))) == joined(said("describe", name))
    entry = mitsonar.describe("sidescan_flat").parameters["range"]
    assert entry.default == "100" and "slant range window" in entry.text
    assert mitsonar.describe("sidescan").attributes["preset"].default == "towed_400khz"
    assert mitsonar.describe("sidescan").parameters == {}
    with pytest.raises(ValueError, match='no scene, plugin or preset .sidescan_flt. .did you mean "sidescan_flat"'):
        mitsonar.describe("sidescan_flt")
