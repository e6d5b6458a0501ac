"""What a beamformer costs, in ns per pixel and receive element, against NumPy in the same run.

    python tests/benchmarks/beamforming.py                             a forward-looking sonar's ping
    python tests/benchmarks/beamforming.py --elements 64 --beams 128 --samples 1024

One ping of a line at half a wavelength, 300 kHz, complex noise sampled at 40 kHz. NumPy does the same delay-and-sum
(float32, linear interpolation, exact near field) for the first few elements; the far-field fans have no delays to
interpolate, and are listed by what they save.
"""
import argparse

import measuring
import numpy as np

FREQUENCY, SAMPLING_RATE, SOUND_SPEED, START = 300e3, 40e3, 1500.0, 0.0133
NUMPY_ELEMENTS = 4
MVDR_BEAMS = 4


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--elements", type=int, default=256)
    parser.add_argument("--beams", type=int, default=256)
    parser.add_argument("--samples", type=int, default=2048)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args(argv)
    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
    from mitsonar.signal import beamforming

    elements, beams, samples = arguments.elements, arguments.beams, arguments.samples
    signals = recording(elements, samples)
    sines = np.linspace(-0.85, 0.85, beams)
    look = beamforming.directions(np.arcsin(sines))
    widest = np.arcsin(0.85)
    ranges = 0.5 * SOUND_SPEED * signals["time"].values
    points = (look[:, None] * ranges[:, None]).reshape(-1, 3)
    pixels = beams * samples
    candidates = {
        "delay_and_sum, band_limited": (lambda: beamforming.delay_and_sum(signals, look), pixels * elements),
        "delay_and_sum, linear": (lambda: beamforming.delay_and_sum(signals, look, interpolation="linear"),
                                  pixels * elements),
        "focus at as many points": (lambda: beamforming.focus(signals, points), pixels * elements),
        "NumPy delay-and-sum, linear": (lambda: plain(signals, sines, NUMPY_ELEMENTS), pixels * NUMPY_ELEMENTS),
        "fan_beams (far field)": (lambda: beamforming.fan_beams(signals, (1, 0, 0), beams=beams, widest=widest),
                                  pixels * elements),
        "fft_beams (far field, narrow band)": (lambda: beamforming.fft_beams(signals, (1, 0, 0), widest=widest),
                                               pixels * elements),
        f"mvdr, {MVDR_BEAMS} beams, subarrays of 16": (
            lambda: beamforming.mvdr(signals, look[:MVDR_BEAMS], subarray=min(16, elements)),
            MVDR_BEAMS * samples * elements)}
    cost = measuring.rounds({name: work for name, (work, _) in candidates.items()}, arguments.rounds)
    print(measuring.machine())
    print(f"{elements} elements, {beams} beams of {samples} samples; medians of {arguments.rounds} rounds\n")
    measuring.table(["beamformer", "wall [ms]", "ns per pixel-rx", "CPU over threads"],
                    [[name, f"{1e3 * np.median(seconds.wall):.1f}",
                      *(f"{1e9 * np.median(clock) / candidates[name][1]:.2f}" for clock in seconds)]
                     for name, seconds in cost.items()])


def recording(elements, samples):
    """Make noise as heard by a line of elements along starboard."""
    import xarray as xr

    generator = np.random.default_rng(1)
    values = generator.standard_normal((1, 1, elements, samples, 2)).astype(np.float32).view(np.complex64)[..., 0]
    place = (np.arange(elements) - (elements - 1) / 2) * 0.5 * SOUND_SPEED / FREQUENCY
    return xr.DataArray(values, dims=("ping", "tx", "rx", "sample"), coords={
        "time": ("sample", START + np.arange(samples) / SAMPLING_RATE), "rx_x": ("rx", 0 * place),
        "rx_y": ("rx", place), "rx_z": ("rx", 0 * place)}, attrs={"frequency": FREQUENCY, "sound_speed": SOUND_SPEED})


def plain(signals, sines, elements):
    """Form the sum over the first elements in NumPy, float32."""
    time = signals["time"].values
    values = signals.values[0, 0]
    x = signals["rx_y"].values.astype(np.float32)
    r = np.broadcast_to((0.5 * SOUND_SPEED * time).astype(np.float32), (len(sines), len(time)))
    y = r * sines[:, None].astype(np.float32)
    sample = np.arange(len(time), dtype=np.float32)
    total = np.zeros(r.shape, np.complex64)
    for n in range(elements):
        q = x[n] * x[n] - 2 * x[n] * y
        later = q / (np.sqrt(r * r + q) + r)
        place = np.clip(sample + later * np.float32(SAMPLING_RATE / SOUND_SPEED), 0, len(time) - 2)
        whole = place.astype(np.int32)
        part = place - whole
        turns = later * np.float32(FREQUENCY / SOUND_SPEED)
        turned = np.exp((2j * np.pi * (turns - np.rint(turns))).astype(np.complex64))
        total += (values[n, whole] * (1 - part) + values[n, whole + 1] * part) * turned
    return total


if __name__ == "__main__":
    main()
