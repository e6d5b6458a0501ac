"""Everything registered with Mitsuba says what it is: by itself, and within the scene that holds it."""
from pathlib import Path

import pytest

from mitsonar.plugins import PLUGINS

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SONAR = {"medium": {"type": "seawater"}, "film": {"type": "sonar_film"}}
BED = {"type": "seabed", "depth": 10.0, "spacing": 50.0}
# what plugins need to be made, or are given here, and words that their descriptions hold
GIVEN = {
    "seawater": ({"sound_speed": 1500.0}, "1500.0"),
    "sonar_film": ({"range": 75.0}, "75.0 m"),
    "lambert": ({"mu_db": -21.0}, "-21"),
    "sediment": ({"sediment": "silt"}, "silt"),
    "elastic": ({}, "rock"),
    "empirical": ({}, "measured"),
    "rigid": ({}, "Rigid"),
    "soft": ({}, "Soft"),
    "impedance": ({"density": 1100.0, "sound_speed": 1600.0}, "1600 m/s"),
    "windy_sea": ({"wind_speed": 7.0}, "7 m/s"),
    "sidescan": ({"pings": 12, **SONAR}, "400 kHz, 12 pings"),
    "array_sonar": ({"receive": "line", "receive_elements": 5, **SONAR}, "1 x 5 elements"),
    "forward_looking": ({"preset": "lens_1800khz", **SONAR}, "1800 kHz, 128 beams of 288 elements"),
    "sector_scan": ({"preset": "head_700khz", **SONAR}, "700 kHz, 400 pings"),
    "sonar_path": ({"rays": 777}, "777 rays"),
    "seabed": (BED, "depth 10.0 m"),
    "bathymetry": ({"filename": str(SCENES / "bathymetry" / "sandwaves.tif"), "resolution": 50.0}, "sandwaves.tif"),
    "point_target": ({"position": [0.0, 1.5, -5.0], "target_strength_db": -7.0}, "-7 dB at 0, 1.5, -5"),
    "capped_cylinder": ({"radius": 0.25, "p0": [0.0, 0.0, -5.0], "p1": [0.0, 2.0, -5.0]}, "0.25 m"),
    "sea_surface": ({"size": 300.0}, "300 m"),
    "moving": ({"start": [0.0, 9.0, -5.0], "shape": {"type": "sphere"}}, "0, 9, -5"),
    "targets": ({"meshes": str(SCENES / "targets"), "species": "crate", "count": "1", "bed": BED}, "crate.targets.1"),
}
NAMES = [name.partition(".")[::2] for name in PLUGINS]                     # folder and plugin
SENSORS = [name for folder, name in NAMES if folder == "sensors"]
# others are made of nothing, or of a sonar's water and film, and say the name of their class
EVERY = {name: GIVEN.get(name, (SONAR if name in SENSORS else {}, name.title().replace("_", ""))) for _, name in NAMES}


def test_what_is_given_is_given_to_a_plugin():
    assert set(GIVEN) <= {name for _, name in NAMES}


@pytest.fixture
def made(make, tmp_path):
    """Make a plugin of the list."""
    def run(kind):
        attributes = dict(EVERY[kind][0])
        if kind == "empirical":
            (tmp_path / "measured.csv").write_text("angle [deg],strength [dB]\n10,-40\n60,-20\n", encoding="utf-8")
            attributes["filename"] = str(tmp_path / "measured.csv")
        return make(kind, **{name: value for name, value in attributes.items() if name != "type"})
    return run


@pytest.mark.parametrize("say", [repr, str])
@pytest.mark.parametrize("kind", EVERY)
def test_a_plugin_says_what_it_is(made, kind, say):
    said = say(made(kind))
    assert EVERY[kind][1] in said and "object at 0x" not in said


@pytest.mark.parametrize("say", [repr, str])
@pytest.mark.parametrize("kind", SENSORS)
def test_a_scene_says_what_it_holds(make, made, kind, say):
    said = say(make("scene", integrator=made("sonar_path"), sensor=made(kind), bed=made("seabed")))
    assert all(EVERY[part][1] in said for part in ("sonar_path", kind, "seabed"))
