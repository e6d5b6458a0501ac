"""Profiles from lines in files: a real line, which is one look at a level bed, tells none."""
from pathlib import Path

import numpy as np
import pytest

from mitsonar.inversion.profile.profile import fit_lines, nodes_over
from mitsonar.plots.canvas import save
from mitsonar.plots.sheets.fit_sheet import fit_figure
from mitsonar.water import SoundSpeedProfile

REAL = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam/em710_122m.all"


@pytest.fixture(scope="module")
def fitted():
    if not REAL.is_file():
        pytest.skip(f"{REAL.name} is not beside this checkout")
    return fit_lines([REAL])


def test_a_real_line_alone_tells_no_profile(fitted):
    assert fitted.soundings == 4000 and fitted.head_depth == pytest.approx(6.0, abs=0.5)
    assert fitted.directions < 0.05
    with pytest.raises(ValueError, match="seen from one direction only"):
        fitted.profile
    # with nothing seen, what was believed stays within its deviation
    assert (np.abs(fitted.speed - fitted.start) < 2 * fitted.prior_deviation).all()


def test_its_picture_is_drawn(fitted, tmp_path):
    answer = fitted.to_dataset()
    save(fit_figure(answer.assign(sound_speed_truth=answer["sound_speed_start"])), tmp_path / "fit.png")
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    with pytest.raises(ValueError, match="no answer of a fit"):
        fit_figure(answer.drop_vars("sound_speed_deviation"))


def test_nodes_run_from_the_head_to_the_deepest_sounding():
    cast = SoundSpeedProfile([0.0, 100], [1500.0, 1480])
    found = nodes_over(cast, 4.0, 84.0, 8, 1501.0)
    np.testing.assert_allclose(found.depth, np.arange(4.0, 85, 10))
    assert found.sound_speed[0] == 1501 and found.sound_speed[-1] == pytest.approx(cast.at(84.0))


def test_files_and_nodes_that_will_not_do_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError):
        fit_lines([tmp_path / "none.all"])
    with pytest.raises(ValueError, match="1 nodes from the head at 4.0 m down to 84.0 m; at least two are needed"):
        nodes_over(SoundSpeedProfile.constant(1500.0), 4.0, 84.0, 1, 1500.0)
