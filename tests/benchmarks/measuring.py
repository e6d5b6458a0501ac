"""What the benchmarks share: the machine in a line, a large seabed, and interleaved timing.

Work is timed in rounds: every candidate once a round, so that what else the machine does falls on all of them alike,
and medians over the rounds. Two clocks: wall, and the process's CPU time over the number of threads. They agree on an
idle machine; on a busy one the second still tells what the first would be.
"""
import os
import platform
import resource
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "tests" / "inputs", ROOT):       # runs from a checkout that is not installed
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

SUMMER = ROOT / "scenes" / "casts" / "summer.csv"
SPACING, DEPTH = 0.5, 40.0          # [m]
SMALLEST = 4                        # nodes along a side


class Cost(NamedTuple):
    """Seconds of a candidate in every round, (rounds,)."""

    wall: np.ndarray
    cpu: np.ndarray                 # over the number of threads


def machine():
    """Say what this was measured on, as one line."""
    import drjit as dr

    name = platform.processor() or platform.machine()
    if os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
        name = names[0] if names else name
    llvm = ".".join(map(str, dr.detail.llvm_version()[:2]))
    return (f"{name}, {os.cpu_count()} cores, {dr.thread_count()} threads; {platform.system()}, Python "
            f"{platform.python_version()}, mitsuba {version('mitsuba')}, drjit {version('drjit')}, LLVM {llvm}")


def busy():
    """CPU seconds this process has used, all threads."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def rounds(candidates, count, warm_up=1):
    """Time candidates {name: function} in interleaved rounds; each must have finished when it returns.

    Returns
    -------
    dict of str to Cost
    """
    import drjit as dr

    for _ in range(warm_up):
        for work in candidates.values():
            work()
    seconds = {name: [] for name in candidates}
    for _ in range(count):
        for name, work in candidates.items():
            wall, cpu = time.perf_counter(), busy()
            work()
            seconds[name].append((time.perf_counter() - wall, (busy() - cpu) / dr.thread_count()))
    return {name: Cost(*np.array(pairs).T) for name, pairs in seconds.items()}


def seabed(nodes):
    """Describe a bed of nodes x nodes at 0.5 m: power-law relief of 1 m rms, and ripples 5 cm about it, as a shape."""
    extent = (max(nodes, SMALLEST) - 1) * SPACING
    return {"type": "seabed", "depth": DEPTH, "length": extent, "width": extent, "spacing": SPACING, "fractal_rms": 1.0,
            "fractal_gamma": 3.2, "fractal_outer_scale": 250.0, "sine_wavelength": 3.0, "sine_height": 0.1,
            "sine_heading_deg": 53.0, "bsdf": {"type": "lambert"}}


def triangles(scene):
    """Number of triangles in a scene of meshes."""
    return sum(shape.face_count() for shape in scene.shapes())


def table(header, rows):
    """Print rows of text in columns, the first flush left."""
    widths = [max(len(str(row[k])) for row in (header, *rows)) for k in range(len(header))]
    for row in (header, ["-" * width for width in widths], *rows):
        cells = [str(row[0]).ljust(widths[0]), *(str(cell).rjust(width) for cell, width in zip(row[1:], widths[1:]))]
        print("  ".join(cells).rstrip(), flush=True)
