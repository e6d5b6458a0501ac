"""What a frame of beams costs from echoes as points, stage by stage.

    python tests/benchmarks/beam_grid.py                           1.6 M echoes, 256 elements, 512 beams out to 60 m

A line of elements half a wavelength apart at 300 kHz, with a Hann shading, hears an lfm of 20 kHz and 0.5 ms. Echoes
are spread evenly over sine and range, in the order of a bed's facets: rows of 0.13 m. CPU time is that of all threads.
Stages are those of `LineBeams.form`, each waited for, so their sum is a little more than the whole.
"""
import argparse

import measuring
import numpy as np

SPEED, FREQUENCY, BAND, DURATION = 1500.0, 300e3, 20e3, 0.5e-3
NEAREST, FACET, WIDEST = 4.0, 0.13, 0.9                     # [m], [m], sine of the outermost beam


class Frame:
    """Echoes and beams."""

    def __init__(self, echoes, elements, beams, farthest):
        from mitsonar.device.arrays import upload
        import mitsuba as mi

        from mitsonar.signal.beam_grid import LineBeams
        from mitsonar.sonar.pulses.pulses import lfm

        self.pulse = lfm(FREQUENCY, BAND, DURATION)
        self.rate = self.pulse.suggested_sampling_rate
        lead = int(np.ceil(1.05 * DURATION * self.rate))
        samples = lead + int(2 * (farthest - NEAREST) / SPEED * self.rate)
        position = (np.arange(elements) - (elements - 1) / 2) * 0.5 * SPEED / FREQUENCY
        self.beams = LineBeams(mi.Float, position=position, weight=np.hanning(elements + 2)[1:-1], pulse=self.pulse,
                               sampling_rate=self.rate, samples=samples, lead=lead, sound_speed=SPEED,
                               sines=np.linspace(-WIDEST, WIDEST, beams))
        rng = np.random.default_rng(1)
        sine, distance = rng.uniform(-0.95, 0.95, echoes), rng.uniform(NEAREST, farthest, echoes)
        x, y = distance * sine, distance * np.sqrt(1 - sine ** 2)
        order = np.lexsort((np.floor(x / FACET), np.floor(y / FACET)))
        fields = dict(column=lead + (distance - NEAREST) * 2 / SPEED * self.rate, sine=sine,
                      real=rng.standard_normal(echoes), imaginary=rng.standard_normal(echoes))
        self.fields = {name: upload(mi.Float, values[order].astype(np.float32)) for name, values in fields.items()}

    def added(self):
        """A grid with the echoes on it."""
        import drjit as dr

        grid = self.beams.grid()
        grid.add(**self.fields)
        dr.sync_thread()
        return grid


def stages(frame, ping):
    """CPU milliseconds of each stage of one frame, in order."""
    from mitsonar.signal.beam_grid import NoiseDensity, line_beams
    import drjit as dr


    spent, clock = {}, [measuring.busy()]

    def lap(name):
        now = measuring.busy()
        spent[name] = spent.get(name, 0) + 1e3 * (now - clock[0])
        clock[0] = now

    def timed(name, function):
        def work(*arguments, **options):
            result = function(*arguments, **options)
            dr.eval(result)
            dr.sync_thread()
            lap(name)
            return result
        return work

    grid = frame.added()
    lap("echoes on the grid")
    names = {"transformed": "FFTs", "by_frequency": "pulse, Doppler, sea noise, to frequencies",
             "through_the_line": "line, own noise", "by_record": "to records", "by_beam": "to beams"}
    kept = {name: getattr(line_beams, name) for name in names}
    try:
        for name, words in names.items():
            setattr(line_beams, name, timed(words, kept[name]))
        frame.beams.form(grid, doppler=1 + 1e-3 * np.linspace(-1, 1, 33), key=ping,
                         noise=NoiseDensity(ambient=1e-6, own=1e-6))
    finally:
        for name, function in kept.items():
            setattr(line_beams, name, function)
    lap("the rest")
    return spent


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--echoes", type=int, default=1_600_000)
    parser.add_argument("--elements", type=int, default=256)
    parser.add_argument("--beams", type=int, default=512)
    parser.add_argument("--farthest", type=float, default=60.0, help="range [m]")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()

    from mitsonar.scene.loading import prepare
    from mitsonar.signal.beam_grid import NoiseDensity

    prepare()
    print(measuring.machine())
    begin = measuring.busy()
    frame = Frame(arguments.echoes, arguments.elements, arguments.beams, arguments.farthest)
    print(f"{arguments.echoes:,} echoes, {arguments.elements} elements, {arguments.beams} beams x "
          f"{frame.beams.samples - frame.beams.lead} samples; grid {frame.beams.shape.rows} x {frame.beams.length}, "
          f"period {frame.beams.period}, {len(frame.beams.pulse.used)} frequencies; set-up with echoes "
          f"{measuring.busy() - begin:.2f} s of CPU\n")
    frame.beams.form(frame.added(), noise=NoiseDensity(ambient=1e-6, own=1e-6))
    found = [stages(frame, ping) for ping in range(arguments.rounds)]
    rows = [[name, f"{np.median([spent[name] for spent in found]):.1f}"] for name in found[0]]
    measuring.table(["stage", "CPU [ms], median"], [*rows, ["sum", f"{sum(float(row[1]) for row in rows):.1f}"]])
    quiet, loud = NoiseDensity(), NoiseDensity(ambient=1e-6)
    cost = measuring.rounds({
        "add": frame.added,
        "add, form": lambda: frame.beams.form(frame.added()),
        "add, form with noise of the sea": lambda: frame.beams.form(frame.added(), noise=loud, key=3),
        "add, form with Doppler": lambda: frame.beams.form(frame.added(), noise=quiet,
                                                           doppler=np.linspace(0.999, 1.001, 33))}, arguments.rounds)
    print()
    import drjit as dr
    measuring.table(["whole", "wall [ms]", "CPU [ms]"],
                    [[name, f"{1e3 * np.median(one.wall):.1f}", f"{1e3 * dr.thread_count() * np.median(one.cpu):.1f}"]
                     for name, one in cost.items()])


if __name__ == "__main__":
    main()
