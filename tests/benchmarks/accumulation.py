"""How fast hits become impulse responses of elements, and how exact they are.

    python tests/benchmarks/accumulation.py                        every kernel against numpy.bincount, cost by elements
    python tests/benchmarks/accumulation.py --pymust [PYTHON]      also signals and time of PyMUST's simus

A line of elements half a wavelength apart at 300 kHz hears hits 10 to 70 m off on a flat bed 5 m below, so near that
wave fronts are curved; 40 kHz of complex baseband. A contribution is one hit at one element. Delays are straight-line
ones, except in the rows "vector" and "level", which find the same by the vector approximation and by the form it takes
for arrays that are level and do not heave. NumPy's rival takes float64 delays and sums by bincount into the nearest
sample, which is what the kernel ``nearest`` does.

PyMUST is compared on its own model: two dimensions, amplitude 1/sqrt(r r'), one element transmits, a rigid baffle, and
elements so narrow that they are omnidirectional, a pulse of ten waves through a transducer of 10 % bandwidth, whose
spectrum both use. What remains is its arithmetic: single precision, phases multiplied on from frequency to frequency.
PYTHON is an interpreter that has PyMUST (default: this one).
"""
import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import measuring
import numpy as np

SPEED, FREQUENCY, RATE, SAMPLES = 1500.0, 300e3, 40e3, 4096
NEAREST, FARTHEST, DEPTH = 10.0, 70.0, 5.0                  # [m]
START = 2 * (NEAREST - 1.5) / SPEED
PYMUST_RATE, PYMUST_REACH = 240e3, (5.0, 20.0)              # flat to 80 kHz, where its transducer has lost 60 dB


class Scene:
    """Hits, elements, and both on the device."""

    def __init__(self, hits, elements, reach=(NEAREST, FARTHEST), flat=False):
        rng = np.random.default_rng(1)
        distance, sine = rng.uniform(*reach, hits), np.sin(np.radians(60)) * rng.uniform(-1, 1, hits)
        depth = np.zeros(hits) if flat else DEPTH + 0.2 * rng.standard_normal(hits)
        x = distance * sine
        y = np.sqrt(np.maximum(distance ** 2 - x ** 2 - depth ** 2, 1.0))
        self.hits = np.stack([x, y, -depth]).astype(np.float32).astype(float)
        self.elements = np.zeros((3, elements))
        self.elements[0] = (np.arange(elements) - (elements - 1) / 2) * 0.5 * SPEED / FREQUENCY
        self.range = np.linalg.norm(self.hits, axis=0)
        self.strength = rng.standard_normal(hits) + 1j * rng.standard_normal(hits)

    def delays(self, elements):
        """Two-way delays from the centre, (H, E) [s]."""
        apart = np.linalg.norm(self.hits[:, :, None] - self.elements[:, None, elements], axis=0)
        return (self.range[:, None] + apart) / SPEED

    def vector(self, difference):
        """Hits and elements as the vector approximation wants them, in water of one speed, at rest."""
        from mitsonar.propagation.returns.straight_vectors import StraightLeg, hit_fields
        from mitsonar.propagation.returns.travel import REST
        from mitsonar.propagation.returns.vector_approximation import vector_element_fields
        from mitsonar.water import SoundSpeedProfile

        none = np.zeros_like(self.range)
        x, y, z = -self.hits / self.range
        leg = StraightLeg(self.range, none + SPEED, np.hypot(x, y), np.abs(z), none)
        hits = hit_fields(leg, (x, y, z), none, none, REST, SPEED)
        elements = vector_element_fields(self.elements.T, 20.0, SoundSpeedProfile([0.0, 100.0], [SPEED, SPEED]))
        return dict(hit_fields=_uploaded(hits), element_fields=np.broadcast_arrays(*elements), difference=difference)

    def fields(self, **choice):
        """What `ImpulseResponses.add` takes."""
        from mitsonar.device.arrays import arrays_of, upload
        import drjit as dr
        import mitsuba as mi

        from mitsonar.signal import centre

        lib = arrays_of(mi.Float)
        one_speed = dr.opaque(lib.Float, 1 / SPEED)

        def difference(hit, element):
            x, y, z, distance = hit
            dx, dy, dz, square = element
            more = dr.fma(-2, dr.fma(x, dx, dr.fma(y, dy, z * dz)), square)
            return more / (dr.sqrt(dr.fma(distance, distance, more)) + distance) * one_speed

        strength = choice.pop("strength", self.strength)
        delay = choice.pop("delay", 2 * self.range / SPEED)
        phase, sample, fraction = centre(upload(lib.Float64, delay), frequency=FREQUENCY,
                                         **{"start": START, "sampling_rate": RATE, **choice})
        return dict(amplitude=_uploaded([strength.real, strength.imag]), phase=phase, sample=sample, fraction=fraction,
                    hit_fields=_uploaded([*self.hits, self.range]), difference=difference,
                    element_fields=[*self.elements, (self.elements ** 2).sum(0)])


def _uploaded(rows):
    from mitsonar.device.arrays import upload
    import mitsuba as mi


    return [upload(mi.Float, np.asarray(row, np.float32)) for row in rows]


def bincount(scene, elements):
    """Impulse responses by NumPy: float64 delays, nearest samples."""
    responses = np.empty((elements, SAMPLES), complex)
    for element, record in enumerate(responses):
        delay = scene.delays([element])[:, 0]
        echo = scene.strength * np.exp(-2j * np.pi * FREQUENCY * delay)
        bins = np.clip(np.rint((delay - START) * RATE).astype(np.int64), -1, SAMPLES) + 1
        record.real = np.bincount(bins, echo.real, SAMPLES + 2)[1:-1]
        record.imag = np.bincount(bins, echo.imag, SAMPLES + 2)[1:-1]
    return responses


def make(elements, kernel, **choice):
    """An empty sum on the device."""
    from mitsonar.signal import ImpulseResponses
    import mitsuba as mi


    return ImpulseResponses(mi.Float, elements=elements, kernel=kernel, frequency=FREQUENCY,
                            **{"samples": SAMPLES, "sampling_rate": RATE, **choice})


def kernels(hits, elements, count):
    """Print rate and error of each kernel, and NumPy's."""
    from mitsonar.propagation.returns.vector_approximation import level_difference, vector_difference
    import drjit as dr

    from mitsonar.signal import KERNELS, in_band_error_db, response_spectrum

    scene = Scene(hits, elements)
    fields = scene.fields()
    offset = np.linspace(-1 / 3, 1 / 3, 65) * RATE
    few = [0, elements - 1]
    exact = response_spectrum(delay=scene.delays(few), amplitude=scene.strength, frequency=FREQUENCY, offset=offset,
                              start=START)

    def error(responses):
        return f"{in_band_error_db(responses[few], sampling_rate=RATE, offset=offset, exact=exact):.1f}"

    errors, work = {"numpy bincount": error(bincount(scene, elements))}, {}
    for name, kernel, given in (*((kernel, kernel, fields) for kernel in KERNELS),
                                ("band_limited, vector", "band_limited", {**fields, **scene.vector(vector_difference)}),
                                ("band_limited, level", "band_limited", {**fields, **scene.vector(level_difference)})):
        sums = make(elements, kernel)
        sums.add(**given)
        errors[name] = error(sums.read())
        work[name] = lambda sums=sums, given=given: (sums.add(**given), dr.sync_thread())
    work["numpy bincount"] = lambda: bincount(scene, elements)
    cost = measuring.rounds(work, count)
    print(f"{hits:,} hits at {elements} elements, medians of {count} rounds; numpy bincount runs in one thread\n")
    rival = np.median(cost["numpy bincount"].wall)
    rows = []
    for name, seconds in cost.items():
        wall, cpu = (np.median(clock) / hits / elements for clock in seconds)
        rows.append([name, f"{1e-6 / wall:.0f}", f"{1e9 * wall:.2f}", f"{1e9 * cpu * dr.thread_count():.2f}",
                     f"{rival / np.median(seconds.wall):.1f}", errors[name]])
    measuring.table(["kernel", "million contributions/s", "ns each, wall", "ns of a core", "x numpy bincount",
                     "error in |f| < fs/3 [dB]"], rows)


def in_scene_order(hits, elements, count):
    """Print rates for about so many echoes of a scene's ping, in its order and in others."""
    import elements as pings
    import drjit as dr
    import mitsuba as mi

    from mitsonar.signal.accumulation import ImpulseResponses
    from mitsonar.survey.pressure.echo_classes import OneClass

    cell = 0.24 * (1e5 / hits) ** 0.5
    record = pings.record_of(argparse.Namespace(cast=measuring.SUMMER, range=25.0, cell=cell), elements)
    taken, add = [], ImpulseResponses.add
    ImpulseResponses.add = lambda sums, **given: taken.append(given)
    record.at(0).add_all(record.sums(), OneClass(), range(1))
    ImpulseResponses.add = add
    given = max(taken, key=lambda some: dr.width(some["hit_fields"]))
    columns = {name: given[name] for name in ("amplitude", "phase", "sample", "fraction", "hit_fields")}
    dr.eval(columns)
    sample, hits = columns["sample"].numpy(), dr.width(columns["sample"])
    orders = {"as the scene has them": np.arange(hits), "by time": np.argsort(sample, kind="stable"),
              "at random": np.random.default_rng(1).permutation(hits)}
    real, imaginary, phase, fraction, *fields = (np.asarray(part.numpy(), float) for part in (
        *columns["amplitude"], columns["phase"], columns["fraction"], *columns["hit_fields"]))
    powers, (frequency, rate) = len(fields) // 2, (record.survey.frequency, record.survey.sampling_rate)

    def rival():
        for u in given["element_fields"][0]:
            later, gain = (np.polynomial.polynomial.polyval(u, np.array(part)) for part in (fields[:powers],
                                                                                           fields[powers:]))
            echo = (real + 1j * imaginary) * gain * np.exp(-2j * np.pi * (phase + frequency * later))
            bins = np.clip(np.rint(sample + fraction + rate * later).astype(np.int64), -1, record.survey.samples) + 1
            np.bincount(bins, echo.real), np.bincount(bins, echo.imag)

    work = {"numpy bincount": rival}
    for name, order in orders.items():
        index = mi.UInt32(order.astype(np.uint32))
        ordered = {**given, **_gathered(columns, index)}
        sums = record.sums()
        work[name] = lambda sums=sums, ordered=ordered: (sums.add(**ordered), dr.sync_thread())
    cost = measuring.rounds(work, count)
    print(f"\n{hits:,} echoes of a ping at {elements} elements, kernel band_limited, medians of {count} rounds\n")
    own = {name: 1e9 * np.median(seconds.cpu) * dr.thread_count() / hits / elements for name, seconds in cost.items()}
    # the rival has one thread
    measuring.table(["order", "ns of a core", "x numpy bincount, on all threads"],
                    [[name, f"{ns:.2f}", "1" if name not in orders else
                      f"{own['numpy bincount'] / ns * dr.thread_count():.1f}"] for name, ns in own.items()])


def _gathered(columns, index):
    """Fields of hits in another order; single values stay."""
    import drjit as dr

    def of(part):
        return [of(one) for one in part] if isinstance(part, (list, tuple)) else (
            part if dr.width(part) == 1 else dr.gather(type(part), part, index))

    gathered = {name: of(part) for name, part in columns.items()}
    dr.eval(gathered)
    return gathered


def by_elements(cases, count):
    """Print what one ping costs with more and more elements, until its responses lie in host memory."""
    import drjit as dr

    work, adding = {}, {}
    for hits, elements in cases:
        fields, sums = Scene(hits, elements).fields(), make(elements, "band_limited")

        def ping(sums=sums, fields=fields):
            sums.clear()
            sums.add(**fields)
            sums.read()

        work[hits, elements] = ping
        adding[hits, elements] = lambda sums=sums, fields=fields: (sums.add(**fields), dr.sync_thread())
    whole, added = measuring.rounds(work, count), measuring.rounds(adding, count)
    print(f"\nkernel band_limited, {SAMPLES} samples, medians of {count} rounds\n")
    measuring.table(["hits", "elements", "clear, add, read [ms]", "CPU over threads", "of it add [ms]", "ns each"],
                    [[f"{hits:,}", elements, f"{1e3 * np.median(whole[hits, elements].wall):.1f}",
                      f"{1e3 * np.median(whole[hits, elements].cpu):.1f}",
                      f"{1e3 * np.median(added[hits, elements].wall):.1f}",
                      f"{1e9 * np.median(added[hits, elements].wall) / hits / elements:.2f}"]
                     for hits, elements in cases])


def level(ratio):
    """Of amplitudes [dB]."""
    return 20 * np.log10(np.abs(ratio))


def pymust(python, scatterers, elements):
    """Print signals and time of PyMUST's simus against ours on the same scatterers."""
    import drjit as dr

    scene = Scene(scatterers, elements, PYMUST_REACH, flat=True)
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told.npz"
        np.savez(Path(folder) / "asked.npz", x=scene.hits[0], z=scene.hits[1], strength=scene.strength.real,
                 frequency=FREQUENCY, pitch=0.5 * SPEED / FREQUENCY, speed=SPEED, elements=elements)
        subprocess.run([python, Path(__file__).with_name("pymust_signals.py"), folder], check=True)
        theirs = np.load(told)
        spectrum, grid, pulse = (theirs[name] for name in ("spectrum", "frequency", "pulse"))
        seconds = float(theirs["seconds"])

    transmitter = elements // 2
    outward = np.linalg.norm(scene.hits - scene.elements[:, [transmitter]], axis=0)
    samples = int((2 * PYMUST_REACH[1] / SPEED + 2e-3) * PYMUST_RATE)

    def spreading(hit, element):
        return dr.rsqrt(dr.sqrt(sum(dr.square(a - b) for a, b in zip(hit[:3], element[:3]))))

    def ours():
        sums = make(elements, "band_limited", samples=samples, sampling_rate=PYMUST_RATE)
        fields = scene.fields(strength=scene.strength.real / np.sqrt(outward) + 0j, start=0.0,
                              delay=(outward + scene.range) / SPEED, sampling_rate=PYMUST_RATE)
        sums.add(**fields, gain=spreading)
        return sums.read()

    ours()
    begin = time.perf_counter()
    responses = ours()
    own = time.perf_counter() - begin
    at = np.exp(-2j * np.pi * np.outer(grid - FREQUENCY, np.arange(samples) / PYMUST_RATE))
    found = (at @ responses.T.astype(complex)) * pulse[:, None]
    ratio = np.vdot(found, spectrum) / np.vdot(found, found)
    each = np.sum(np.conj(found) * spectrum, 0) / np.sum(np.abs(found) ** 2, 0)
    error = level(np.linalg.norm(found - spectrum) / np.linalg.norm(spectrum))
    print(f"\nPyMUST simus, {scatterers} scatterers {PYMUST_REACH[0]:.0f} to {PYMUST_REACH[1]:.0f} m off, {elements} "
          f"elements: {seconds:.2f} s; ours {1e3 * own:.1f} ms, {seconds / own:.0f} times faster\n"
          f"theirs less ours: {error:.1f} dB of the signals' rms; amplitude {level(ratio):+.4f} dB, phase "
          f"{np.degrees(np.angle(ratio)):+.4f} degrees over all elements; at worst {np.abs(level(each)).max():.4f} dB, "
          f"{np.degrees(np.abs(np.angle(each)).max()):.4f} degrees at one")


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hits", type=int, default=100_000)
    parser.add_argument("--elements", type=int, nargs="+", default=[1, 4, 16, 64, 256])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--pymust", nargs="?", const=sys.executable, metavar="PYTHON")
    parser.add_argument("--scatterers", type=int, default=500, help="of the comparison with PyMUST")
    arguments = parser.parse_args()

    from mitsonar.scene.loading import prepare

    prepare()
    print(measuring.machine())
    kernels(arguments.hits, min(64, arguments.elements[-1]), arguments.rounds)
    in_scene_order(arguments.hits, min(64, max(16, arguments.elements[-1])), arguments.rounds)
    by_elements([*((arguments.hits, count) for count in arguments.elements),
                 (max(1, arguments.hits // 5), min(64, arguments.elements[-1]))], arguments.rounds)
    if arguments.pymust:
        pymust(arguments.pymust, arguments.scatterers, 64)


if __name__ == "__main__":
    main()
