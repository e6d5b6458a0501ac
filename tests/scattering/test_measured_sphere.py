"""A ping of an EK80 on a calibration sphere, processed as its maker says, beside the exact series.

35 mm of tungsten carbide at 5.8 m, 90 to 170 kHz in 2 ms. Matched filter, window about the echo, gains by frequency,
beam pattern by the split beam's angles, spreading and absorption (Andersen et al. 2024, "Quantitative processing of
broadband data as implemented in a scientific splitbeam echosounder", eqs. 4-22). The window, 1.5 ms long, tells 0.7 kHz
apart: nulls to 1 kHz. Gains come from a calibration of their own: levels to 1 dB. The file stands in ../shared.
"""
import json
from pathlib import Path

import numpy as np
import pytest

from mitsonar.scattering import MATERIALS, SphereBody, sphere_form

RECORD = Path(__file__).resolve().parents[3] / "shared/data/measured/sphere/ek80_wc35_tsf.json"
RADIUS, WATER_DENSITY = 0.0175, 1025.0
BEFORE, AFTER, SAMPLES = 24, 160, 4096
NULLS = 91.15, 99.05, 106.95, 125.85, 147.0, 152.65           # [kHz] of the series


def sent(settings, stages):
    """The transmitted signal after the receiver's filters, and their sampling rate."""
    rate, ping = settings["Transceiver"]["fs"], settings["Parameter"]
    first, last, length = ping["FrequencyStart"], ping["FrequencyEnd"], ping["PulseDuration"]
    time = np.arange(round(length * rate)) / rate
    signal = np.cos(2 * np.pi * (first * time + (last - first) / (2 * length) * time ** 2))
    ramp = np.hanning(round(2 * rate * length * ping["Slope"]))
    half = len(ramp) // 2
    signal[:half] *= ramp[:half]
    signal[-(len(ramp) - half):] *= ramp[half:]
    for stage in ("1", "2"):
        taps = stages[stage]["coefficients"]
        factor = stages[stage]["decimationFactor"]
        signal = np.convolve(signal, np.array(taps["real"]) + 1j * np.array(taps["imag"]))[::factor]
        rate /= factor
    return signal, rate


def measured():
    """Frequencies [Hz], target strengths [dB] and the speed of sound [m/s]."""
    record = json.loads(RECORD.read_text())
    settings, (replica, rate) = record["XML0"], sent(record["XML0"], record["FIL1"])
    water, answer, ping = settings["Environment"], settings["FrequencyPar"], settings["Parameter"]
    quadrant = [np.array(part["real"]) + 1j * np.array(part["imag"])
                for _, part in sorted(record["RAW3"]["quadrant_signals"].items())]
    power = np.sum(np.abs(replica) ** 2)
    matched = [np.convolve(part, replica[::-1].conj())[len(replica) - 1:] / power for part in quadrant]
    total, distance = np.mean(matched, 0), np.arange(len(matched[0])) * water["SoundSpeed"] / 2 / rate
    near = (distance > 5) & (distance < 7)
    peak = np.flatnonzero(near)[np.argmax(np.abs(total[near]))]
    middle, own = len(replica) - 1, np.convolve(replica, replica[::-1].conj()) / power
    frequency = np.array(answer["frequencies"])
    bin = np.round(np.mod(frequency, rate) / rate * SAMPLES).astype(int) % SAMPLES
    spectrum = (np.fft.fft(total[peak - BEFORE:peak + AFTER], SAMPLES)
                / np.fft.fft(own[middle - 200:middle + 200], SAMPLES))[bin]
    inside, outside = settings["Transceiver"]["z_rx_e"], settings["Transducer"]["z_trd"]
    received = 4 * np.abs(spectrum) ** 2 / 8 * ((inside + outside) / inside) ** 2 / outside
    squares = []
    for name, one, other in (("along", (2, 3), (0, 1)), ("athwart", (0, 3), (1, 2))):
        turned = np.angle(sum(matched[i] for i in one)[peak] * np.conj(sum(matched[i] for i in other)[peak]))
        angle = np.degrees(turned) / settings["Transducer"][f"AngleSensitivity{name.capitalize()}ship"]
        squares.append((2 * (angle - np.array(answer[f"angle_offset_{name}ship"]))
                        / np.array(answer[f"beam_width_{name}ship"])) ** 2)
    off = 0.5 * 6.0206 * (squares[0] + squares[1] - 0.18 * squares[0] * squares[1])
    wavelength, r = water["SoundSpeed"] / frequency, distance[peak]
    strength = (10 * np.log10(received) + 40 * np.log10(r) + 2 * water["Alpha"] * r - 2 * (answer["gain"] - off)
                - 10 * np.log10(ping["TransmitPower"] * wavelength ** 2 / (16 * np.pi ** 2)))
    order = np.argsort(frequency)
    return frequency[order], strength[order], water["SoundSpeed"]


@pytest.mark.skipif(not RECORD.exists(), reason="the measured ping is not beside the checkout")
def test_a_measured_calibration_sphere_is_the_series():
    frequency, strength, speed = measured()
    body = SphereBody(inside=MATERIALS["tungsten_carbide"])
    form = sphere_form(RADIUS, frequency, speed, body=body, density=WATER_DENSITY)
    off = strength - 20 * np.log10(np.abs(form))
    low, middle, high = np.percentile(off, [25, 50, 75])
    print(f"{len(frequency)} frequencies: {middle:+.2f} dB, half of them between {low:+.2f} and {high:+.2f} dB")
    assert abs(middle) < 1.0 and high - low < 1.0
    for null in NULLS:
        near = np.abs(frequency / 1e3 - null) < 1.5
        found = frequency[near][np.argmin(strength[near])] / 1e3
        print(f"null at {null:.2f} kHz, measured {found:.2f} kHz")
        assert found == pytest.approx(null, abs=1.0)
