"""Raw files of an EK80 made byte by byte, without mitsonar."""
import struct

import numpy as np

CONFIGURATION = ('<?xml version="1.0" encoding="utf-8"?>'
                 "<Configuration><Transceivers>{}</Transceivers></Configuration>")
TRANSCEIVER = """<Transceiver TransceiverType="WBT" Impedance="5400"><Channels><Channel ChannelID="{name}"
 PulseDuration="0.000512;0.001024"><Transducer TransducerName="{name}" Frequency="{frequency}" BeamType="{beam}"
 Gain="26;27.5" SaCorrection="-0.1;-0.2" EquivalentBeamAngle="-20.7" AngleSensitivityAlongship="23"
 AngleSensitivityAthwartship="20" AngleOffsetAlongship="0.1" AngleOffsetAthwartship="-0.2" BeamWidthAlongship="7"
 BeamWidthAthwartship="7.1"/></Channel></Channels></Transceiver>"""
ENVIRONMENT = '<Environment Depth="20" SoundSpeed="1480" Temperature="9.5" Salinity="35"/>'


def datagram(kind, time, content):
    """Return a datagram at a time [s since 1970]."""
    ticks = round((time + 11_644_473_600) * 10_000_000)
    length = struct.pack("<i", 12 + len(content))
    return length + kind.encode() + struct.pack("<Q", ticks) + content + length


def xml(time, text):
    """Return an XML datagram."""
    return datagram("XML0", time, text.encode())


def configuration(time, **channels):
    """Return the configuration of channels, name=(frequency [Hz], type of beam)."""
    return xml(time, CONFIGURATION.format("".join(TRANSCEIVER.format(name=name, frequency=frequency, beam=beam)
                                                  for name, (frequency, beam) in channels.items())))


def parameter(time, name, interval=64e-6, more='PulseForm="0" Frequency="38000"'):
    """Return the parameters of the next ping of a channel: a pulse of 1.024 ms, 500 W."""
    return xml(time, f'<Parameter><Channel ChannelID="{name}" SampleInterval="{interval}" PulseDuration="0.001024" '
                     f'TransmitPower="500" {more}/></Parameter>')


def ping(time, name, *, power=None, angle=None, signal=None, half=False):
    """Return a ping: steps of power (N,) and of angle (N, 2) athwart and along, or signals (N, sectors)."""
    kind, content = 0, b""
    if power is not None:
        kind, content = kind | 1, content + np.asarray(power, "<i2").tobytes()
    if angle is not None:
        kind, content = kind | 2, content + np.asarray(angle, "i1").tobytes()
    if signal is not None:
        signal = np.asarray(signal, np.complex64)
        kind |= (4 if half else 8) | signal.shape[1] << 8
        content += signal.view("<f4").astype("<f2" if half else "<f4").tobytes()
    count = len(next(part for part in (power, angle, signal) if part is not None))
    return datagram("RAW3", time, struct.pack("<128sHHii", name.encode(), kind, 0, 0, count) + content)


def stage(time, name, number, coefficients, decimation):
    """Return the filter of a stage of a channel's receiver."""
    return datagram("FIL1", time, struct.pack("<h2x128shh", number, name.encode(), len(coefficients), decimation)
                    + np.asarray(coefficients, "<c8").tobytes())


def motion(time, heave, roll, pitch, heading):
    """Return a datagram of the motion sensor: metres and degrees."""
    return datagram("MRU0", time, struct.pack("<4f", heave, roll, pitch, heading))
