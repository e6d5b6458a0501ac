"""Detection by amplitude in water columns of a real sounder, against that sounder's own detections.

Five pings of a Kongsberg EM 2042 over 3.5 m of water, 256 beams, 35 kHz samples of half a decibel without phase
(`../shared/data/measured/README.md`). The instrument detects by phase on the oblique beams, from data that it does not
record: there a centre of gravity strays by some 1 % of the range, its own footprint's theory.
"""
from pathlib import Path

import numpy as np
import pytest

from mitsonar.hydrography.detection.detection import Head, detect

RECORD = Path(__file__).resolve().parents[3] / "shared" / "data" / "measured" / "multibeam" / "em2042_os01.kmwcd"


@pytest.fixture(scope="module")
def pings():
    if not RECORD.exists():
        pytest.skip(f"{RECORD.name} is not beside the checkout")
    import KMALL
    file = KMALL.kmall(str(RECORD))
    file.index_file()
    found = []
    for place, kind in zip(file.Index["ByteOffset"], file.Index["MessageType"], strict=True):
        if "MWC" in str(kind):
            file.FID.seek(place)
            found.append(file.read_EMdgmMWC())
    file.closeFile()
    return found


def sounded(ping):
    """Angles, times of the instrument and ours, of the beams in order."""
    beams = ping["beamData"]
    angle = -np.radians(beams["beamPointAngReVertical_deg"])
    order = np.argsort(angle)
    length = max(beams["numSampleData"])
    level = np.full((len(angle), length), -200.0)
    for row, samples in enumerate(beams["sampleAmplitude05dB_p"]):
        level[row, :len(samples)] = 0.5 * np.asarray(samples, float)
    time = np.arange(length) / ping["rxInfo"]["sampleFreq_Hz"]
    own = np.asarray(beams["detectedRangeInSamplesHighResolution"])[order] / ping["rxInfo"]["sampleFreq_Hz"]
    own[own <= 0] = np.nan
    beam = (10 ** (level[order] / 20)).astype(np.complex64)
    head = Head(pulse_length=4.6e-5, beam_width=np.radians(0.9) / np.cos(angle[order]), baseline=0.0,
                transmit_width=np.radians(0.9))
    return own, detect((beam, beam), time=time, sines=np.sin(angle[order]), head=head)


def test_beams_are_detected_where_the_instrument_detects_them(pings):
    for ping in pings:
        own, found = sounded(ping)
        assert found.valid.mean() > 0.99
        apart = found.time / own - 1
        assert np.nanquantile(np.abs(apart), 0.95) < 0.02
        assert abs(np.nanmedian(found.time - own)) < 0.3 / ping["rxInfo"]["sampleFreq_Hz"]
