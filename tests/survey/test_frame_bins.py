"""The beam and bin of echoes on the device: between their edges, and nowhere for what is no number."""
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.survey.beam_domain.ping_echoes import GridEchoes
from mitsonar.survey.beam_domain.truth import FrameBins

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
    return [part.numpy() for part in FrameBins(EDGES, lobe=0, lead=LEAD, bins=BINS).cell_of(echoes)]


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


def test_a_bin_counts_the_echoes_around_it(variant):
    """Against sums on the host, at every edge of a frame: whole numbers, so that both are equal."""
    beams, bins, count = 5, 7, 60
    random = np.random.default_rng(3)
    beam, bin = random.integers(0, beams, count), random.integers(0, bins, count)
    active, in_lobe = random.random(count) < 0.8, random.random(count) < 0.5
    frame = FrameBins(np.linspace(-0.5, 0.5, beams + 1), lobe=0, lead=0, bins=bins)
    nothing = floats(np.zeros(count))
    echoes = GridEchoes(**dict.fromkeys(("sine", "column", "real", "imaginary", "energy", "state", "label", "x", "y",
                                         "depth"), nothing), launch_sine=floats(random.uniform(0.1, 1, count)))
    _, rays, lobe = frame.counted(echoes, upload(mi.UInt32, beam * bins + bin), mi.Bool(active), mi.Bool(in_lobe), 5.0,
                                  60.0)
    for found, of in ((rays, active), (lobe, active & in_lobe)):
        plane = np.zeros((beams + 2, bins + 2), int)
        np.add.at(plane, (beam[of] + 1, bin[of] + 1), 1)
        around = sum(plane[a:a + beams, b:b + bins] for a in range(3) for b in range(3))
        assert (found == around).all() and around.max() > 3


def test_an_empty_bin_lies_where_its_neighbours_do(variant):
    """A bin without echoes has the mean place of the bins before and after, by energy, and none from another beam."""
    beams, bins, origin = 2, 4, np.array([100.0, 200.0, -3.0])
    sums = np.zeros((beams, bins, 4))
    sums[0, 1] = 2.0 * np.array([1, 5, 6, 7])
    sums[0, 3] = 1.0 * np.array([1, 8, 9, 10])
    frame = FrameBins(np.linspace(-0.5, 0.5, beams + 1), lobe=0, lead=0, bins=bins)
    energy, place = frame.ground(floats(sums), origin)
    assert (energy == sums[..., 0]).all()
    first, both, last = (5, 6, 7), (6, 7, 8), (8, 9, 10)
    assert np.allclose(place[0], np.array([first, first, both, last]) + [100, 200, 0])
    assert np.isnan(place[1]).all()
    assert np.allclose(frame.mean_depth(floats(sums), floats(sums))[0], [7, 7, 8, 10])
