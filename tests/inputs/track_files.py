"""Recorded tracks as files, for sonars under way."""
from pathlib import Path

import numpy as np


def write_track(path: Path, rows) -> str:
    """Write rows (N, 7) of time [s], x, y, z [m], roll, pitch, heading [degrees] as CSV, and give the file's name."""
    np.savetxt(path, rows, delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="", fmt="%.12g")
    return str(path)
