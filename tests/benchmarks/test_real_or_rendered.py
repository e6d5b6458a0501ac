"""Parts of the benchmark that asks for clues: closed forms of a low pass, learners, folds; and all of it in small.

Patches are 64 x 64 independent Rayleigh amplitudes behind three taps along range. r_1 of one patch has a standard
error of 1/64, CV one of about 1 % of its value; of 40 patches 0.0025 and 0.001. Left out of the closed form are edges,
where the local mean repeats samples, and the second order in its own variance, 0.27 x 0.0022. Tolerance 0.007.
"""
import clue_records
import numpy as np
import pytest
import real_or_rendered
import telling_apart
import xarray as xr

from mitsonar.comparison import clue_features, sidescan_amplitudes


def patches(k, count=40, seed=0):
    """Draw Rayleigh patches behind the taps (k, 1 - 2k, k)."""
    drawn = np.random.default_rng(seed).rayleigh(size=(count, 64, 66))
    return k * drawn[..., :-2] + (1 - 2 * k) * drawn[..., 1:-1] + k * drawn[..., 2:]


@pytest.mark.parametrize("k, r1, variation", [(0.0, 0.0, .523), (0.055, .12, .47), (0.10, .24, .42), (0.17, .46, .37)])
def test_a_low_pass_of_three_taps_ties_correlation_to_variation(k, r1, variation):
    closed = clue_features.three_taps(k)
    assert np.allclose(closed, (r1, variation), atol=.014)            # rounded, and without the local mean's 0.008
    measured = clue_features.r1_and_variation(patches(k))
    assert np.allclose([values.mean() for values in measured], closed, atol=.007)


def test_auc_counts_pairs():
    assert sidescan_amplitudes.auc(range(10, 20), range(10)) == 1
    assert sidescan_amplitudes.auc(np.ones(9), np.ones(5)) == 0.5
    assert sidescan_amplitudes.auc([1, 2, 3, 4, np.nan], [2, 3, 4, 5]) == (3 * .5 + 3) / 16
    assert np.isnan(sidescan_amplitudes.auc([1, 2, 3], range(9)))


def test_a_forest_learns_what_no_straight_line_can_part():
    rng = np.random.default_rng(1)
    clues = rng.normal(size=(400, 6))
    real = clues[:, 0] * clues[:, 1] > 0
    other = rng.normal(size=(400, 6))
    truth = other[:, 0] * other[:, 1] > 0
    forest, line = (sidescan_amplitudes.auc(scores[truth], scores[~truth]) for scores in (
        telling_apart.forest(clues, real)(other), telling_apart.logistic(clues, real)(other)))
    assert forest > .85
    assert abs(line - .5) < .12                                       # 4 standard errors of 200 against 200


def test_a_logistic_regression_finds_the_slope():
    rng = np.random.default_rng(2)
    clues = rng.normal(size=(4000, 2))
    real = rng.random(4000) < 1 / (1 + np.exp(-2 * clues[:, 0]))
    clues[:50, 1] = np.nan                                            # missing values are means
    scores = telling_apart.logistic(clues, real)
    slope = float(np.diff(scores(np.array([[0, 0], [1, 0]])))[0])
    assert slope == pytest.approx(2, abs=.25)                         # 4 standard errors of 4000 draws


def test_folds_leave_whole_runs_out():
    rng = np.random.default_rng(3)
    runs = np.repeat(np.arange(30), 10)
    clues = np.repeat(rng.normal(size=(30, 4)), 10, 0)                # alike within a run
    real = np.repeat(rng.random(30) < .5, 10)
    scores = telling_apart.by_folds(telling_apart.forest, clues, real, runs)
    learned = telling_apart.forest(clues, real)(clues)
    assert sidescan_amplitudes.auc(learned[real], learned[~real]) > .95     # what a leak would look like
    assert sidescan_amplitudes.auc(scores[real], scores[~real]) < .75
    assert sidescan_amplitudes.auc_error(scores, real, runs) > .05


def test_a_rendered_record_is_compared_by_its_counts():
    level = xr.DataArray(np.full((2, 2, 3), 60.0), dims=("ping", "side", "range"),
                         coords={"range": [1.0, 10.0, 20.0]})
    image = xr.Dataset({"level": level}, attrs={"absorption_db": 0.1, "parameters": {"depth": "20"}})
    image["altitude"] = "ping", np.full(2, 10.0)
    amplitude, about = sidescan_amplitudes.rendered_amplitudes(image)
    gain = 20 * np.log10(amplitude.values[0, 0]) + 60
    assert gain == pytest.approx([32, 32, 30 * np.log10(20) + 4])     # held before the first return
    assert "no recorder" in about and "depth=20" in about
    image["recorded"] = level.dims, np.arange(12, dtype=np.uint16).reshape(2, 2, 3)
    counts, about = sidescan_amplitudes.rendered_amplitudes(image)
    assert np.array_equal(counts, image["recorded"]) and about.startswith("counts")


def test_frames_of_files_are_beams_by_samples(tmp_path):
    aris = tmp_path / "small.aris"
    picture = np.arange(12, dtype=np.uint8).reshape(4, 3)             # samples by beams
    head = np.zeros(256, "<u4")
    head[[0, 1, 4, 6]] = int.from_bytes(b"DDF\x05", "little"), 2, 3, 4
    aris.write_bytes(head.tobytes() + 2 * (bytes(1024) + picture.tobytes()))
    assert np.array_equal(clue_records.frames(str(aris)).frames, np.stack([picture.T] * 2))
    oculus = tmp_path / "small.raw"
    ping = bytearray(200)
    ping[:2], ping[6] = b"SO", 0x23
    ping[106:122] = np.array([4, 3], "<u2").tobytes() + np.array([150, 12, 200], "<u4").tobytes()
    ping[150:162] = picture.tobytes()
    oculus.write_bytes(bytes(ping) * 3)
    assert np.array_equal(clue_records.frames(str(oculus)).frames, np.stack([picture.T] * 3))
    oculus.write_bytes(bytes(ping[:160]))
    with pytest.raises(ValueError, match="cannot read"):
        clue_records.frames(str(oculus))


def write_line(path, k, seed):
    """Write a line of 256 pings: water to 4 m, then bed, behind three taps."""
    sides = {}
    for side, drawn in zip(sidescan_amplitudes.SIDES, np.random.default_rng(seed).rayleigh(size=(2, 256, 322))):
        drawn[:, :100] *= .02                                                     # samples of 4 cm
        sides[side] = k * drawn[:, :-2] + (1 - 2 * k) * drawn[:, 1:-1] + k * drawn[:, 2:]
    np.savez(path, spacing=.04, **sides)


def test_the_benchmark_names_the_low_pass_that_one_of_two_has(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(telling_apart, "TREES", 20)
    pairs = []
    for name, k in (("one", .1), ("two", .17)):
        write_line(tmp_path / f"{name}.npz", k, seed=len(name + str(k)))
        write_line(tmp_path / f"{name}_rendered.npz", 0, seed=9)
        pairs.append(f"{tmp_path}/{name}.npz={tmp_path}/{name}_rendered.npz")
    table, sheet = tmp_path / "table.txt", tmp_path / "sheet.png"
    real_or_rendered.main([*pairs, "--tuned", "B: beam width", "-o", str(table), "-o", str(sheet)])
    text = table.read_text(encoding="utf-8")
    assert capsys.readouterr().out.strip() == text.strip()
    assert "tuned on A: nothing" in text and "tuned on B: beam width" in text
    bed = text[text.index("patches of bed"):text.index("all clues, patches of bed")].splitlines()
    strongest = [line for line in bed if line.startswith("correlation in range, lag 1 *")]
    assert len(strongest) == 1 and " 1.00  " in strongest[0]
    within = next(line for line in text.splitlines() if line.startswith("A: forest"))
    assert float(within.split()[2]) > .98 and float(within.split()[-3]) > .9      # within, transfer
    assert sheet.stat().st_size > 10_000


def test_lines_of_one_kind_cannot_be_told_apart(tmp_path):
    cut = []
    for seed in (1, 2):
        write_line(tmp_path / f"{seed}.npz", .1, seed)
        cut.append(sidescan_amplitudes.bed_items(clue_records.line(str(tmp_path / f"{seed}.npz"))))
    area, spread = real_or_rendered._within(telling_apart.logistic, *cut)
    assert abs(area - .5) < .12 and spread < .1                       # 3 to 4 standard errors of 112 against 112


@pytest.mark.parametrize("arguments, said", [
    ([], "pairs are REAL=RENDERED"), (["a.xtf"], "got a.xtf"), (["a=b", "--tuned", "C: beams"], "names no pair"),
    (["a=b", "-o", "x.pdf"], "ends neither")])
def test_wrong_arguments_are_told(arguments, said, capsys):
    with pytest.raises(SystemExit):
        real_or_rendered.main(arguments)
    assert said in capsys.readouterr().err
