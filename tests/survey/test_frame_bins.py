"""The beam and bin of echoes on the device: between their edges, and nowhere for what is no number."""
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import upload
from mitsonar.survey.beam_domain.ping_echoes import GridEchoes
from mitsonar.survey.beam_domain.truth import IN_LOBE, CellCounts, FrameBins, word_of

EDGES = np.sin(np.deg2rad(np.linspace(-61, 59, 42)))                       # equal steps of angle
BINS, LEAD = 50, 7


def floats(values):
    """Float32 numbers on the device."""
    return upload(mi.Float, np.asarray(values, np.float32))


def placed(sine, column):
    """Cells of echoes, and which count."""
    one, none = floats(np.ones(len(sine))), upload(mi.UInt32, np.zeros(len(sine), np.uint32))
    rest = dict.fromkeys(("real", "imaginary", "energy", "launch_sine", "x", "y", "depth"), one)
    echoes = GridEchoes(sine=floats(sine), column=floats(column), state=none, label=none, **rest)
    cell, beam, inside = (part.numpy() for part in FrameBins(EDGES, lobe=0, lead=LEAD, bins=BINS).cell_of(echoes))
    assert (beam == cell // BINS).all()
    return cell, inside


def test_every_echo_lies_in_its_beam_and_bin(variant):
    random = np.random.default_rng(1)
    sine, column = random.uniform(-0.95, 0.95, 5000).astype(np.float32), random.uniform(0, 65, 5000).astype(np.float32)
    cell, inside = placed(sine, column)
    beam, bin = np.searchsorted(EDGES.astype(np.float32), sine, side="right") - 1, np.rint(column) - LEAD
    expected = (beam >= 0) & (beam < len(EDGES) - 1) & (bin >= 0) & (bin < BINS)
    assert (inside == expected).all() and 0 < inside.sum() < 5000
    assert (cell[inside] == (beam * BINS + bin)[inside]).all()


def test_what_is_no_number_lies_in_no_bin(variant):
    """Every pair of these in which one is not finite: none counts, and none points outside the table."""
    values = np.array([0.1, np.nan, np.inf, -np.inf, 3e38, -3e38])
    sine, column = (part.ravel() for part in np.meshgrid(values, values + 20))
    cell, inside = placed(sine, column)
    assert inside.sum() == 1 and (cell < (len(EDGES) - 1) * BINS).all()


@pytest.mark.parametrize("lobe", [0, 2])
def test_all_that_a_bin_holds_is_that_of_a_plain_count(variant, lobe):
    """Sums, counts and runs of sectors against loops on the host, at every edge of a frame; whole numbers are equal."""
    beams, bins, count = 19, 7, 600
    random = np.random.default_rng(3)
    beam, bin = random.integers(0, beams, count), random.integers(0, bins, count)
    active, in_lobe = random.random(count) < 0.8, random.random(count) < 0.5
    sine = random.choice([0.1, 0.15, 0.3, 0.32, 0.9], count).astype(np.float32)
    columns = random.random((4, count)).astype(np.float32)
    frame = FrameBins(np.linspace(-0.5, 0.5, beams + 1), lobe=lobe, lead=0, bins=bins)
    nothing = floats(np.zeros(count))
    echoes = GridEchoes(**dict.fromkeys(("sine", "column", "real", "imaginary", "state", "label"), nothing),
                        launch_sine=floats(sine), **dict(zip(("energy", "x", "y", "depth"), map(floats, columns))))
    word = word_of(echoes, mi.Bool(in_lobe), 5.0, 60.0)
    counts, numbers = CellCounts(frame.cells, lobe=True), word.numpy()
    assert ((numbers >= IN_LOBE) == in_lobe).all() and len(set(numbers)) == 10
    cells = upload(mi.UInt32, beam * bins + bin), upload(mi.UInt32, beam)
    sums = frame.sums(echoes, *cells, mi.Bool(active), word, counts)
    expected = np.zeros((beams, bins, 4))
    np.add.at(expected, (beam[active], bin[active]), (columns[0] * [np.ones(count), *columns[1:]]).T[active])
    np.testing.assert_allclose(sums.numpy().reshape(expected.shape), expected, rtol=1e-5)
    runs, rays, lobes = frame.counted(counts)
    for found, of, wide in ((rays, active, 1), (lobes, active & in_lobe, max(lobe, 1))):
        plane = np.zeros((beams + 2 * wide, bins + 2), int)
        np.add.at(plane, (beam[of] + wide, bin[of] + 1), 1)
        around = sum(plane[a:a + beams, b:b + bins] for a in range(1 + 2 * wide) for b in range(3))
        assert (found == around).all() and around.max() > 3
    heard = {(b, t): set() for b in range(beams) for t in range(bins)}
    for b, t, number in zip(beam[active], bin[active], numbers[active] % IN_LOBE):
        for there in ((b, t), (b - 1, t), (b + 1, t), (b, t - 1), (b, t + 1)):
            heard.get(there, set()).add(int(number))
    of_own = set(zip(beam[active], bin[active]))
    for there, sectors in heard.items():
        sectors |= {k + 1 for k in sectors if k + 2 in sectors}                # a gap of a single sector is none
        assert runs[there] == (there in of_own) * sum(k - 1 not in sectors for k in sectors)
    assert runs.max() > 2


def test_an_empty_bin_lies_where_its_neighbours_do(variant):
    """A bin without echoes has the mean place of the bins before and after, by energy, and none from another beam."""
    beams, bins, origin = 2, 4, np.array([100.0, 200.0, -3.0])
    sums = np.zeros((beams, bins, 4))
    sums[0, 1] = 2.0 * np.array([1, 5, 6, 7])
    sums[0, 3] = 1.0 * np.array([1, 8, 9, 10])
    frame = FrameBins(np.linspace(-0.5, 0.5, beams + 1), lobe=0, lead=0, bins=bins)
    energy, place, depth = frame.ground(floats(sums), None, origin)
    assert (energy == sums[..., 0]).all()
    first, both, last = (5, 6, 7), (6, 7, 8), (8, 9, 10)
    assert np.allclose(place[0], np.array([first, first, both, last]) + [100, 200, 0])
    assert np.isnan(place[1]).all()
    assert np.array_equal(depth, place[..., 2], equal_nan=True)
    others = np.zeros_like(sums)
    others[0, 3] = 3.0 * np.array([1, 0, 0, 2])
    energy, again, depth = frame.ground(floats(sums), floats(others), origin)
    assert np.array_equal(again, place, equal_nan=True) and (energy == sums[..., 0]).all()
    assert np.allclose(depth[0], [7, 7, 30 / 6, 16 / 4])                   # those of the bed and of others together
