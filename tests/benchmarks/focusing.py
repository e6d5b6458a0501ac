"""What focusing a synthetic aperture's strip costs, against the memory that its echoes are read from, in the same run.

    python tests/benchmarks/focusing.py                            5 x 5 m at 2 cm, and at 5 mm, 32 receivers, 300 kHz
    python tests/benchmarks/focusing.py --side 2 --receivers 8

Noise of a strip as long as it takes to see all of the grid, 36 m off. A reading is one receiver of one ping at one
point that is in the beam; two complex numbers, 16 bytes, are fetched for each. Copying is NumPy's, of arrays beyond the
caches.
"""
import argparse
import sys

import measuring
import numpy as np

sys.path.insert(0, str(measuring.ROOT))

LENGTH, SPEED, ACROSS, BED, DEPTH = 0.04, 1.5, 36.0, 20.0, 10.0
COPIED = 1 << 26                   # bytes
THERMOCLINE = [0, 8, 12, 14, 30, 60], [1525, 1524, 1505, 1490, 1484, 1482]


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--side", type=float, default=5.0, help="of the grid [m]")
    parser.add_argument("--receivers", type=int, default=32)
    parser.add_argument("--spacing", type=float, nargs="+", default=[0.02, 0.005], help="of the points [m]")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args(argv)
    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
    from mitsonar.water import SoundSpeedProfile

    print(measuring.machine())
    waters = {"one sound speed": SoundSpeedProfile.constant(1500.0), "a thermocline": SoundSpeedProfile(*THERMOCLINE)}
    candidates, readings = {}, {}
    for spacing in arguments.spacing:
        for water, profile in waters.items():
            name = f"{1e3 * spacing:g} mm, {water}"
            candidates[name], readings[name] = strip(arguments.side, arguments.receivers, spacing, profile)
    source = np.zeros(COPIED, np.uint8)
    target = np.ones_like(source)
    candidates["copying"] = lambda: np.copyto(target, source)
    cost = measuring.rounds(candidates, arguments.rounds)
    copied = 2 * COPIED / np.median(cost["copying"].cpu)
    rows = [[name, f"{np.median(cost[name].wall):.2f}", f"{np.median(cost[name].cpu):.2f}",
             f"{1e-6 * number:.1f}", f"{1e-9 * number / np.median(cost[name].cpu):.2f}",
             f"{100 * 16 * number / np.median(cost[name].cpu) / copied:.0f}"] for name, number in readings.items()]
    print(f"{arguments.side:g} m square, {arguments.receivers} receivers; medians of {arguments.rounds} rounds\n")
    measuring.table(["compressed and focused", "wall [s]", "CPU over threads [s]", "readings [M]", "G readings/s",
                     "% of copying"], rows)


def strip(side, receivers, spacing, profile):
    """Return what focuses a strip, and the number of its readings."""
    from mitsonar.sonar.pulses.pulses import lfm
    from mitsonar.synthetic_aperture.focusing.back_projection import TILE, BackProjection
    from mitsonar.synthetic_aperture.focusing.focusing import Focuser
    from mitsonar.synthetic_aperture.focusing.grids import ground_grid
    from tests.inputs.raw_strip import line_array, raw_strip, straight

    pulse = lfm(300e3, 60e3, 2e-3)
    step = 0.9 * receivers * LENGTH / 2
    slant = np.hypot(ACROSS, BED - DEPTH)
    pings = max(int((side + slant * 0.005 / LENGTH) / step) + 1, 2)
    near, far = (2 * np.hypot(ACROSS + sign * side / 2, BED - DEPTH) / 1500 for sign in (-1, 1))
    raw = raw_strip(straight(SPEED, depth=DEPTH, sway=(0.01, 3.0)), pulse, np.zeros((0, 4)), bed_depth=BED,
                    ping_time=np.arange(pings) * step / SPEED, sampling_rate=pulse.suggested_sampling_rate,
                    window=(0.97 * near, 1.03 * far + pulse.duration), receivers=line_array(receivers, LENGTH),
                    tx_length=LENGTH, rx_length=LENGTH, profile=profile)
    noise = np.random.default_rng(0).normal(size=(2, *raw["signal"].shape)).astype(np.float32)
    raw = raw.assign(signal=(raw["signal"].dims, noise[0] + 1j * noise[1]))
    middle = 0.5 * pings * step
    grid = ground_grid((middle - side / 2, middle + side / 2), (ACROSS - side / 2, ACROSS + side / 2),
                       (spacing, spacing), BED)
    tiles = []

    class Counted(BackProjection):
        """Counts the tiles that pings touch."""

        def in_sight(self, *arguments):
            found = super().in_sight(*arguments)
            tiles.append(len(found))
            return found

    def work():
        focuser = Focuser(raw, grid)
        focuser.add(raw)
        return focuser.image()

    focuser = Focuser(raw, grid)
    focuser._images[0].__class__ = Counted
    focuser.add(raw)
    focuser.image()
    return work, sum(tiles) * TILE ** 2 * receivers


if __name__ == "__main__":
    main()
