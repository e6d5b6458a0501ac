"""The beam and bin of echoes on the device: between their edges, and nowhere for what is no number."""
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.survey.beam_domain.ping_echoes import GridEchoes
from mitsonar.survey.beam_domain.truth import FrameBins

EDGES = np.sin(np.deg2rad(np.linspace(-61, 59, 42)))                       # equal steps of angle
BINS, LEAD = 50, 7


def placed(sine, column):
    """Cells of echoes, and which count."""
    def floats(values):
        return upload(mi.Float, np.asarray(values, np.float32))

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
