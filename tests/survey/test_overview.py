"""The overview of a scene: what of the bed a sonar sees, against closed forms over a level bed.

Sonar 20 m over a bed 30 m deep, record of 60 m. In water of one speed the swath ends at sqrt(60² - 20²); behind a wall
of height b whose far edge is d away, the shadow ends at d h / (h - b); in water of the gradient g a ray of slowness p
from the speed c0 reaches the bed at (sqrt(1 - p² c0²) - sqrt(1 - p² c1²)) / (p g), as its path is a circle (Jensen,
Kuperman, Porter and Schmidt, Computational Ocean Acoustics, 2011). Tolerance: two cells of the section, 60 m / 399
each, since states change between cells.
"""
import numpy as np
import pytest
from small_scene import TEXT, spoilt

import mitsonar
from mitsonar.io.scene_files import scenes
from mitsonar.verbs.overview import SEEN, SHADOW, UNSEEN, overview

CELL = 2 * 60 / 399
HEIGHT = 20.0
WALL = """<shape type="cube" id="wall"><transform name="to_world"><scale x="1" y="30" z="2.5"/>
    <translate x="25" y="0" z="-27.5"/></transform><ref id="sand"/></shape>
</scene>"""
MULTIBEAM = (('type="sidescan" id="sonar">', 'type="multibeam" id="sonar"><float name="swath_deg" value="120"/>'),
             ('<boolean name="speckle" value="$speckle"/>', ""), ('<default name="speckle" value="true"/>', ""),
             ('<integer name="bins" value="50"/>', ""))
KINDS = {"sidescan": "sidescan_flat", "forward_looking": "forward_looking", "multibeam": "multibeam",
         "interferometric": "interferometric", "sector_scan": "sector_scan", "echo_sounder": "echo_sounder",
         "synthetic_aperture": "synthetic_aperture", "array": "published_figure_3"}


@pytest.fixture
def viewed(tmp_path, variant):
    """The overview of the small scene after edits."""
    def view(*edits, text=TEXT, **options):
        (tmp_path / "scene.xml").write_text(spoilt(*edits, text=text), encoding="utf-8")
        return overview(str(tmp_path / "scene.xml"), **options)
    return view


def edges(section, state):
    """The least and the greatest distance to starboard of a state of the bed."""
    along = section.along[(section.state == state) & (section.along > 0)]
    return along.min(), along.max()


def test_the_swath_ends_where_the_record_does(viewed):
    seen = viewed()
    assert edges(seen.section, SEEN)[1] == pytest.approx(np.sqrt(60 ** 2 - HEIGHT ** 2), abs=CELL)
    beyond = seen.section.state[np.abs(seen.section.along) > np.sqrt(60 ** 2 - HEIGHT ** 2) + CELL]
    assert (beyond == UNSEEN).all()
    port = -seen.section.along[(seen.section.state == SEEN) & (seen.section.along < 0)]
    assert port.max() == pytest.approx(edges(seen.section, SEEN)[1], abs=CELL)


def test_the_shadow_of_a_wall_is_as_long_as_the_triangle_says(viewed):
    seen = viewed(("</scene>", WALL))
    first, last = edges(seen.section, SHADOW)
    assert last == pytest.approx(26 * HEIGHT / (HEIGHT - 5), abs=CELL)
    assert first == pytest.approx(24, abs=3)               # from under the wall on
    assert [thing.name for thing in seen.objects] == ["wall"]
    low, high = seen.objects[0].points.min(0), seen.objects[0].points.max(0)
    assert np.allclose([low, high], [[24, -30, -30], [26, 30, -25]], atol=1e-4)


@pytest.mark.parametrize("gradient", [-1.5, 1.5])
def test_the_outermost_beam_bends_as_its_arc_says(viewed, gradient):
    c0 = 1500.0
    profile = f'<spectrum name="profile" value="0:{c0 - 10 * gradient}, 100:{c0 + 90 * gradient}"/>'
    seen = viewed(*MULTIBEAM, ('<float name="sound_speed" value="1500"/>', profile))
    slowness, c1 = np.sin(np.radians(60)) / c0, c0 + HEIGHT * gradient
    reach = (np.sqrt(1 - (slowness * c0) ** 2) - np.sqrt(1 - (slowness * c1) ** 2)) / (slowness * gradient)
    assert abs(reach - HEIGHT * np.tan(np.radians(60))) > 3 * CELL         # straight rays would fail
    assert edges(seen.section, SEEN)[1] == pytest.approx(reach, abs=CELL)
    ends = np.array([ray[-1] for ray in seen.section.rays])
    assert np.abs(ends[:, 0]).max() == pytest.approx(reach, abs=4 * CELL)  # of rays a quarter of a degree apart
    assert np.allclose(ends[:, 1], 30, atol=0.5)


@pytest.mark.parametrize("kind, name", KINDS.items(), ids=KINDS)
def test_every_kind_sees_some_bed_within_its_range(kind, name, variant):
    seen = overview(scenes.find(name))
    assert seen.kind == kind
    assert (seen.state == SEEN).any() and (seen.state == UNSEEN).any()
    sonar = seen.track.position[seen.pings][:, None, None]
    away = np.linalg.norm(seen.place - sonar[..., :2], axis=-1)[seen.state == SEEN]
    assert away.max() <= seen.section.ranges[1] and len(seen.section.rays) > 3


def test_a_fan_looks_ahead_and_a_sounder_down(variant):
    ahead, down = (overview(scenes.find(name)) for name in ("forward_looking", "echo_sounder"))
    place = (ahead.place[0] - ahead.track.position[0, :2])[ahead.state[0] == SEEN]
    assert (place[:, 1] > 0).all() and abs(place[:, 0].mean()) < 1           # heading north
    away = np.linalg.norm(down.place - down.track.position[down.pings][:, None, None, :2], axis=-1)
    assert away[down.state == SEEN].max() < 0.3 * down.below.max()


def test_moving_objects_have_a_path(variant):
    diver = next(thing for thing in overview(scenes.find("swimmers")).objects if thing.name == "diver.crossing")
    assert np.linalg.norm(diver.path[-1] - diver.path[0]) > 1


def test_a_ping_that_is_not_there_is_refused(viewed):
    with pytest.raises(ValueError, match="section at ping 2 is asked for, and the scene has 2; the first is 0"):
        viewed(ping=2)


def test_the_plain_function_returns_the_figure(tmp_path, variant):
    figure = mitsonar.show("sidescan_targets", tmp_path / "plan.png", pings=40)
    texts = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert {"wreck", "tyre", "0 s"} <= texts
    assert (tmp_path / "plan.png").stat().st_size > 20_000
