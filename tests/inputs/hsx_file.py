"""A small HSX file of HYPACK, made line by line."""
from __future__ import annotations

import numpy as np

SPEED, DEPTH, BEAMS = 1485.0, 40.0, 16
FIRST, STEP = -60.0, 8.0           # [degrees] of a fixed fan: positive to port


def hsx_file(pings: int = 3, *, shape: str = "2", flags: int = 0, unit: int = 0, roll: float = 0.0, heave: float = 0.0,
             system: str = "", quality: int = 3, steering: float | None = None, seconds: float = 36_010.0,
             sonar: str = "Reson Seabat 7125", more: str = "") -> bytes:
    """Make the file: a ship that goes north at 2 m/s over a level bed at 40 m, its array 2 m deep, 5 m forward.

    Lengths are divided by the ``unit``: 0 metres, 2 international feet. Roll [degrees] has the port side up.
    """
    foot = {0: 1.0, 2: 0.3048}[unit]
    # angles from the vertical, to starboard; the array is turned by the roll
    angle = np.linspace(60, -60, BEAMS)[::-1]
    slant = (DEPTH - 2.0) / np.cos(np.radians(angle)) / foot
    known = {"1": 0x1001, "2": 0x1881, "3": 0x1301}[shape]
    head = ["FTP NEW 2", "HSX 7", "TND 22:00:00 05/01/2026", f'INF "" "" "" "" 0.00 0.00 {SPEED:.2f}',
            f"HSP 0.00 95.00 35.62 35.62 75 75 2 2 0.50 0.00 {unit} 22", *([f"PRJ {system}"] if system else []),
            'DEV 0 544 "IXSEA OCTANS Serial"', "DV2 0 220 0 1", "OF2 0 2 0 0 0 0 0 0 0",
            'DEV 1 100 "GPS NMEA-0183"', f"OF2 1 0 {1 / foot} {3 / foot} {-20 / foot} 0 0 0 0.1", "PRI 1",
            f'DEV 2 32784 "{sonar}"', f"OF2 2 3 {0.5 / foot} {5 / foot} {2 / foot} 0 0 0 0",
            f"MBI 2 {shape} {flags:x} {known:x} {BEAMS} 0 {FIRST} {STEP}", "EOH", "HVF 99 36000 0 95 35 35 -75 75"]
    for number in range(4 * pings + 8):
        time = (seconds - 1 + 0.25 * number) % 86_400
        north = 2.0 * (0.25 * number - 1.0)
        # the antenna, 0.1 s late, above the ship that heads north
        head += [f"POS 1 {(time + 0.1) % 86_400:.3f} {(500_000 + 1) / foot:.4f} {(5_900_000 + 3 + north) / foot:.4f}",
                 f"HCP 0 {time:.3f} {heave:.2f} {roll:.4f} 0.00", f"GYR 0 {time:.3f} 0.0"]
    for ping in range(pings):
        time = (seconds + 0.5 * ping) % 86_400
        if steering is not None:
            head.append(f"PSA 2 {time:.3f} {ping + 1} {steering} {steering}")
        head += [f"SNR 2 {time:.3f} {ping + 1} 22 5 100 220 30 400 33",
                 f"RMB 2 {time:.3f} {shape} {flags:x} {known:x} {BEAMS} {SPEED:.2f} {ping + 1}"]
        rows = [slant]
        if shape == "2":
            turned = angle if flags & 1 else angle + roll
            rows += [-turned, np.full(BEAMS, 100)]
        elif shape == "3":
            rows += [np.abs(angle), np.where(angle > 0, 90, 270)]
        head += [" ".join(f"{value:.4f}" for value in row) for row in rows]
        head.append(" ".join(["1" if beam == 2 else f"{quality}" for beam in range(BEAMS)]))
    return ("\r\n".join([*head, *filter(None, [more])]) + "\r\n").encode()
