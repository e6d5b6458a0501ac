"""What must not capture beams, and what no detector can use: fish, side lobes, steps, silence, gaps in the record."""
import numpy as np
import pytest
from swath_echoes import Sounder, bed, coloured, halves, head_of, lambertian, specular, time_of_plane, with_point

from mitsonar.hydrography.detection.amplitude_detection import slopes
from mitsonar.hydrography.detection.detection import detect
from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED

DEPTH = 20.0
SOUNDER = Sounder(duration=0.085, taper=0.8)
ANGLE = np.arcsin(SOUNDER.sines)
TRUTH = time_of_plane(SOUNDER, DEPTH)


def found_in(ping, sounder=SOUNDER, **changes):
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        return detect(ping, time=sounder.time, sines=sounder.sines, head=head_of(sounder, **changes))


@pytest.fixture(scope="module")
def level():
    """Scatterers of a level bed."""
    return bed(SOUNDER, np.random.default_rng(4), depth=DEPTH, strength=specular)


@pytest.fixture(scope="module")
def ping(level):
    return halves(SOUNDER, *level, np.random.default_rng(5))


def test_fish_in_the_water_capture_no_beam(level):
    # 26 dB over the strongest scatterer of the bed, at nadir; 45 over those aside.
    for across, depth in ((-5.0, 8.0), (12.0, 10.0), (0.5, 14.0)):
        level = with_point(*level, across=across, depth=depth, amplitude=20 * np.abs(level[1]).max())
    found = found_in(halves(SOUNDER, *level, np.random.default_rng(5)))
    assert found.valid.all() and np.abs(found.time / TRUTH - 1).max() < 0.012


def test_a_school_over_thirty_degrees_captures_no_beam(level):
    chance = np.random.default_rng(6)
    for _ in range(60):
        level = with_point(*level, across=6 + 1.2 * chance.standard_normal(), depth=9 + 0.5 * chance.standard_normal(),
                           amplitude=np.abs(level[1]).max() * np.exp(2j * np.pi * chance.random()))
    found = found_in(halves(SOUNDER, *level, chance))
    assert found.valid.mean() > 0.99 and np.nanmax(np.abs(found.time / TRUTH - 1)) < 0.012


@pytest.mark.parametrize("beams", [slice(0, 141), slice(100, 141)], ids=["fan", "outer sector"])
def test_the_ring_of_side_lobes_at_the_first_return_captures_no_beam(level, beams):
    # A first return 50 dB over scatterers, through unshaded arrays: the ring is brighter than the outer bed.
    sounder = Sounder(duration=0.085)
    level = with_point(*level, across=0.0, depth=DEPTH, amplitude=60 * np.abs(level[1]).max())
    ping = halves(sounder, *level, np.random.default_rng(5))
    found = detect((ping[0][beams], ping[1][beams]), time=sounder.time, sines=sounder.sines[beams],
                   head=head_of(sounder, beam_width=sounder.beam_widths[beams]))
    outer = np.abs(ANGLE[beams]) > np.radians(20)
    assert found.valid.mean() > 0.97
    assert np.nanmax(np.abs(found.time / TRUTH[beams] - 1)[outer]) < 0.012


def test_a_box_has_its_edges_where_they_are(level):
    # 3 m high, 10 to 14 m aside. Beams are 0.5 m wide there: two from the edge all are right, and few lie between.
    sounder = Sounder(duration=0.085, taper=0.8, beams=201)
    ping = halves(sounder, *bed(sounder, np.random.default_rng(7), depth=DEPTH, strength=lambertian,
                                relief=lambda y: np.where((y > 10) & (y < 14), -3.0, 0.0)), np.random.default_rng(8))
    found = found_in(ping, sounder)
    across, depth = 750 * found.time * sounder.sines, 750 * found.time * np.sqrt(1 - sounder.sines ** 2)
    top, bottom = (across > 11) & (across < 13), (across < 9.0) | (across > 14.6)
    assert top.sum() >= 4 and np.abs(depth[top] - 17).max() < 0.15
    assert np.abs(depth[bottom] - 20).max() < 0.25
    assert np.mean((depth > 17.4) & (depth < 19.5)) < 0.02


def test_silence_and_noise_have_no_bed(ping):
    nothing = np.zeros_like(ping[0])
    chance = np.random.default_rng(9)
    for record in ((nothing, nothing), tuple(coloured(SOUNDER, nothing.shape, chance) for _ in range(2)),
                   (nothing + np.nan, nothing + np.nan)):
        found = found_in(record)
        assert not found.valid.any() and np.isnan(found.time).all() and (found.method == NOT_DETECTED).all()


def test_gaps_in_the_record_cost_only_themselves(ping):
    whole = found_in(ping)
    cut = tuple(half.copy() for half in ping)
    cut[0][:, 100:140] = np.nan             # in the water
    cut[1][:, 700] = np.inf                 # one sample
    found = found_in(cut)
    assert found.valid.mean() > 0.98
    assert np.nanmedian(np.abs(found.time / whole.time - 1)) < 1e-5
    assert np.isnan(cut[0][:, 100:140]).all()


def test_a_gate_keeps_what_is_within(ping):
    found = found_in(ping, gate=(0.04, 0.06))
    inside = (TRUTH > 0.042) & (TRUTH < 0.057)
    assert found.valid[inside].all() and np.abs(found.time / TRUTH - 1)[inside].max() < 0.012
    outside = (TRUTH < 0.038) | (TRUTH > 0.064)
    assert found.valid[outside].mean() < 0.1
    assert (found.time[found.valid] >= 0.04).all() and (found.time[found.valid] <= 0.06).all()


def test_halves_the_wrong_way_round_are_not_believed(ping):
    turned = found_in(ping[::-1])
    assert np.mean(turned.method == BY_PHASE) < 0.04 and np.nanmax(np.abs(turned.time / TRUTH - 1)) < 0.03
    right = found_in(ping[::-1], baseline=-SOUNDER.baseline)
    assert np.allclose(right.time, found_in(ping).time)


def test_beams_that_are_not_split_are_detected_by_amplitude(ping):
    whole = (ping[0] + ping[1]) / 2
    found = found_in((whole, whole), baseline=0.0)
    assert (found.method == BY_AMPLITUDE).all() and np.abs(found.time / TRUTH - 1).max() < 0.03


@pytest.mark.parametrize("beams", [1, 2, 5])
def test_a_few_beams_are_enough(ping, beams):
    part = slice(110, 110 + beams)
    found = detect((ping[0][part], ping[1][part]), time=SOUNDER.time, sines=SOUNDER.sines[part],
                   head=head_of(SOUNDER, beam_width=SOUNDER.beam_widths[part]))
    assert found.valid.all() and np.abs(found.time / TRUTH[part] - 1).max() < 0.01


def test_neither_gain_nor_unit_matters(ping):
    usual = found_in(ping)
    for gain in (2.0 ** -20, 2.0 ** 27):      # exact, so that no rounding tips a choice
        assert np.allclose(found_in(tuple(half * np.complex64(gain) for half in ping)).time, usual.time)


@pytest.mark.parametrize("wrong, said", [
    (dict(sines=SOUNDER.sines[::-1]), "sines must increase"),
    (dict(time=SOUNDER.time ** 2), "increase evenly"),
    (dict(time=SOUNDER.time[:-1]), "give arrays"),
    (dict(head=head_of(SOUNDER, pulse_length=0.0)), "pulse"),
    (dict(head=head_of(SOUNDER, gate=(1.0, 2.0))), "gate"),
], ids=["sines", "uneven", "shapes", "pulse", "gate"])
def test_what_cannot_be_detected_in_is_refused(ping, wrong, said):
    with pytest.raises(ValueError, match=said):
        detect(ping, **{"time": SOUNDER.time, "sines": SOUNDER.sines, "head": head_of(SOUNDER), **wrong})


def test_ripples_wider_than_the_beam_are_followed():
    # 0.1 m high and 4 m long, at 30 m, beams of 0.7 degrees: 0.9 m wide at 45 degrees, and windows of a line over the
    # whole beam are twice that. Their rms is 0.035 m; a third of it may be left.
    sounder = Sounder(beam_deg=0.7, pulse=8.7e-5, along_deg=0.7, duration=0.1, fan_deg=50, beams=240, taper=0.8)
    chance, errors = np.random.default_rng(3), []
    def ripples(y):
        return 0.05 * np.sin(2 * np.pi * y / 4)
    for _ in range(2):
        ping = halves(sounder, *bed(sounder, chance, depth=30.0, strength=lambertian, relief=ripples), chance)
        found = found_in(ping, sounder)
        across, depth = 750 * found.time * sounder.sines, 750 * found.time * np.sqrt(1 - sounder.sines ** 2)
        errors.append(depth - 30 - ripples(across))
    oblique = np.abs(sounder.sines) > np.sin(np.radians(30))
    left = np.array(errors)[:, oblique]
    assert abs(left.mean()) < 0.003 and left.std() < 0.035 / 3, (left.mean(), left.std())


def test_slopes_over_beams_that_all_look_the_same_way_are_no_error():
    for width in (0.0, 1e-32, 1e-9):
        assert slopes(np.ones(16), np.linspace(-width, width, 16), np.ones(16, bool)).shape == (16,)
