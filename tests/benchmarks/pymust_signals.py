"""Element signals of the scatterers in FOLDER/asked.npz by PyMUST's simus, into FOLDER/told.npz; see accumulation.py.

    python tests/benchmarks/pymust_signals.py FOLDER

Runs in an interpreter of its own that need not have mitsonar.
"""
import sys
import time
from pathlib import Path

import numpy as np
import pymust

WAVES = 10                         # of the pulse
BANDWIDTH = 10                     # of the transducer, there and back [%]
NARROW = 1e-3                      # width of an element over its pitch: omnidirectional


def main(folder):
    """Simulate, and write spectra (F, E), their frequencies [Hz] and the spectrum of pulse and transducer."""
    asked = np.load(folder / "asked.npz")
    elements = int(asked["elements"])
    param = pymust.utils.Param()
    param.fc, param.pitch, param.c = (float(asked[name]) for name in ("frequency", "pitch", "speed"))
    param.width = NARROW * param.pitch
    param.Nelements, param.bandwidth, param.TXnow, param.baffle = elements, BANDWIDTH, WAVES, "rigid"
    param.radius = np.inf
    param.TXapodization = np.eye(elements)[elements // 2].reshape(1, -1)
    begin = time.perf_counter()
    signals, spectrum = pymust.simus(asked["x"], asked["z"], asked["strength"], np.zeros((1, elements)), param)
    seconds = time.perf_counter() - begin
    frequency = np.linspace(0, 2 * param.fc, len(spectrum))
    angular = 2 * np.pi * frequency
    pulse = param.getPulseSpectrumFunction()(angular) * param.getProbeFunction()(angular) ** 2
    # simus conjugates on the way to its signals; it scales by the step of frequency and the width of an element
    np.savez(folder / "told.npz", spectrum=np.conj(spectrum), frequency=frequency, seconds=seconds, signals=signals,
             pulse=np.conj(pulse) * frequency[1] * param.width)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
