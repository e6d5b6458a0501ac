"""Where a sonar without a track goes: soundings of the bed, and the line over its middle."""
import numpy as np
from scene_text import plugin, scene_text

import mitsonar
from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.motion.track import Track
from mitsonar.survey.placement import check, lines_up, soundings

SCENE = scene_text(
    plugin("sensor", "sidescan", "", plugin("medium", "seawater"), plugin("film", "sonar_film")),
    plugin("shape", "seabed", "bed", plugin("bsdf", "lambert", "sand"), depth=20.0, length=100.0, width=110.0,
           spacing=0.25, fractal_rms=0.05))


def rough_bed(folder):
    """A bed whose rows of nodes lie at multiples of 0.25 m, so that rays there run along the edges of its facets."""
    (folder / "bed.xml").write_text(SCENE, encoding="utf-8")
    return Geometry(mitsonar.load_file(folder / "bed.xml"))


def test_rays_along_the_edges_of_facets_find_the_bed(tmp_path):
    bed, places = rough_bed(tmp_path), np.arange(-49.0, 49.0, 0.05)
    for row in (0.0, -1e-16, 0.25, 0.5, 7.25):
        for x, y in ((places, row), (row, places), (places, places)):
            assert np.isfinite(soundings(bed, x, y)).all()
    assert np.isnan(soundings(bed, [60.0, 0.0], [0.0, 60.0])).all()


def test_a_line_along_a_row_of_nodes_lies_over_the_middle_of_the_bed(tmp_path):
    bed = rough_bed(tmp_path)
    for heading in (None, 0.0):                    # along its longer axis, and across
        track = lines_up(bed, heading=heading, altitude=8.0, pings=5, interval=1.0, speed=2.0)
        assert np.abs(track.position[:, :2].mean(0)).max() < 0.1


def test_a_sonar_that_runs_along_the_edges_of_facets_is_over_the_bed(tmp_path):
    bed, places = rough_bed(tmp_path), np.arange(-49.0, 49.0, 0.05)
    rows = np.concatenate([np.stack([places, np.full_like(places, row)], -1) for row in (0.0, -1e-16, 0.25, 7.25)])
    position = np.column_stack([rows, np.full(len(rows), -12.0)])
    track = Track(time=np.arange(len(rows), dtype=float), position=position, roll=0, pitch=0, heading=0)
    np.testing.assert_allclose(check(bed, track), soundings(bed, *rows.T) - 12, atol=2e-3)
