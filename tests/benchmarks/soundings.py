"""What a ping of soundings costs: CPU and wall time, by parts, and memory over many pings.

    python tests/benchmarks/soundings.py                           two instruments at 50 m, with and without the water
    python tests/benchmarks/soundings.py --against ../other        the same, ping by ping in turn with that checkout
    python tests/benchmarks/soundings.py --wide                    512 beams, 140 degrees, 2.5 million nodes of a bed
    python tests/benchmarks/soundings.py --pings 1000 -o a.kmall   seconds a ping and memory over a line that is written

Each checkout is one process an instrument; the first ping, which compiles kernels, counts as its start. CPU seconds are
those of all threads. Parts are of this checkout: echoes on the grid, beams, detection, reduction with its errors, the
bed that lies there, strengths; the rest makes the records.
"""
import argparse
import importlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import measuring
import numpy as np

PRESETS = "shallow_400khz", "shallow_300khz_three_sectors"
SETTINGS = {"depth": 50, "slope_deg": 0, "range": 110}
WIDE = {"swath_deg": 140, "range": 160, "ping_rate": 4}
WIDE_BED = {'name="length" value="120"': 'name="length" value="320"', 'name="width" value="200"':
            'name="width" value="320"', 'name="spacing" value="0.25"': 'name="spacing" value="0.2"',
            '<integer name="pings"': '<integer name="beams" value="512"/> <integer name="pings"'}
KINDS = {"soundings": False, "with the water": True}
PARTS = {"echoes": ("survey.beam_domain.frames", "lay"),
         "beams": ("signal.beam_grid.line_beams", "LineBeams.form_each"),
         "detection": ("survey.multibeam.measuring", "detect"), "reduction": ("survey.soundings.line", "errors"),
         "bed": ("survey.soundings.line", "bed_at"),
         "strengths": ("survey.multibeam.instrument", "MultibeamInstrument._strengths")}


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--against", type=Path, help="root of another checkout")
    parser.add_argument("--preset", action="append", help="default: " + ", ".join(PRESETS))
    parser.add_argument("-D", dest="parameters", action="append", default=[], metavar="NAME=VALUE",
                        help="of scenes/multibeam.xml; default: a level bed at 50 m")
    parser.add_argument("--wide", action="store_true", help="512 beams over 140 degrees, a bed of 1600 x 1600 nodes")
    parser.add_argument("--rounds", type=int, default=6, help="pings that are timed; default 6")
    parser.add_argument("--pings", type=int, help="sound so many instead, and tell the memory on the way")
    parser.add_argument("-o", "--output", default=os.devnull, help="file of these; default: none")
    parser.add_argument("--worker", type=Path, metavar="ROOT", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    arguments.preset = arguments.preset or list(PRESETS)
    if arguments.worker:
        work(arguments)
    else:
        (memory if arguments.pings else compare)(arguments)


def scene_of(arguments, preset, pings):
    """Load the scene with an instrument."""
    import mitsonar

    settings = {**SETTINGS, **(WIDE if arguments.wide else {}),
                **dict(one.split("=", 1) for one in arguments.parameters)}
    scenes = measuring.ROOT / "scenes"
    text = (scenes / "multibeam.xml").read_text()
    for old, new in WIDE_BED.items() if arguments.wide else ():
        assert old in text
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("casts", "meshes"):
            (Path(folder) / name).symlink_to(scenes / name)
        path = Path(folder) / "multibeam.xml"
        path.write_text(text)
        return mitsonar.load_file(path, preset=preset, pings=pings, **settings)


def work(arguments):
    """Make a ping of a kind as often as its name comes in; answer with CPU and wall seconds, and CPU of the parts."""
    sys.path.insert(0, str(arguments.worker))
    from mitsonar.verbs.images import sounded_pings

    scene = scene_of(arguments, arguments.preset[0], arguments.rounds + 1)
    spent = {}
    for name, (module, work_of) in PARTS.items():
        timed(importlib.import_module(f"mitsonar.{module}"), work_of, name, spent)
    lines = {}
    for asked in sys.stdin:
        kind = asked.strip()
        spent.update(dict.fromkeys(PARTS, 0.0))
        cpu, wall = measuring.busy(), time.perf_counter()
        if kind not in lines:
            lines[kind] = sounded_pings(scene, column=KINDS[kind])
        next(lines[kind])
        print(measuring.busy() - cpu, time.perf_counter() - wall, *(spent[name] for name in PARTS), flush=True)


def timed(module, work_of, name, spent):
    """Let what a module calls count its CPU seconds."""
    *inside, last = work_of.split(".")
    owner = getattr(module, inside[0]) if inside else module
    original = getattr(owner, last)

    def counted(*args, **kwargs):
        begin = measuring.busy()
        result = original(*args, **kwargs)
        spent[name] += measuring.busy() - begin
        return result

    setattr(owner, last, counted)


def compare(arguments):
    """Print the cost of a ping of one checkout, or of two in turn and their ratio."""
    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    print(measuring.machine() + "\n")
    checkouts = {"this": measuring.ROOT} | ({"other": arguments.against.resolve()} if arguments.against else {})
    rows = []
    for preset in arguments.preset:
        cost = costs(arguments, preset, checkouts)
        for kind in KINDS:
            middle = {name: np.median(cost[name, kind][1:], axis=0) for name in checkouts}
            for name in checkouts:
                start = f"{cost[name, kind][0][0]:.1f}"
                rows.append([f"{preset}, {kind}, {name} checkout", start, *(f"{part:.3f}" for part in middle[name])])
            if "other" in middle:
                ratio = middle["this"][:2] / middle["other"][:2]
                rows.append(["  this over other", "", *(f"{one:.2f}" for one in ratio), *[""] * len(PARTS)])
    measuring.table(["seconds a ping", "start", "CPU", "wall", *PARTS], rows)


def costs(arguments, preset, checkouts):
    """Seconds of all pings by checkout and kind, (1 + rounds, 2 + parts)."""
    options = [f"--preset={preset}", f"--rounds={arguments.rounds}", *(f"-D{one}" for one in arguments.parameters),
               *(["--wide"] if arguments.wide else [])]
    workers = {name: subprocess.Popen([sys.executable, __file__, f"--worker={root}", *options], text=True,
                                      stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                      env={**os.environ, "PYTHONPATH": str(root)})
               for name, root in checkouts.items()}
    cost = {(name, kind): [] for name in workers for kind in KINDS}
    for _ in range(1 + arguments.rounds):
        for name, kind in cost:
            workers[name].stdin.write(kind + "\n")
            workers[name].stdin.flush()
            cost[name, kind].append([float(number) for number in workers[name].stdout.readline().split()])
    for worker in workers.values():
        worker.stdin.close()
        worker.wait()
    return cost


def memory(arguments):
    """Sound a line, write it, and print seconds a ping and peak memory on the way."""
    from mitsonar.io import survey_lines
    from mitsonar.verbs.images import sounded_pings

    arguments.parameters = ["speed_knots=0.2", *arguments.parameters]       # the bed is 120 m long
    scene = scene_of(arguments, arguments.preset[0], arguments.pings)
    rows, marks = [], sorted({arguments.pings * tenth // 10 for tenth in range(1, 11)} - {0})

    def told(pings):
        begin = measuring.busy()
        for done, one in enumerate(pings, 1):
            yield one
            if done in marks:
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
                rows.append([done, f"{peak:.0f}", f"{(measuring.busy() - begin) / done:.3f}"])

    pings = told(sounded_pings(scene))
    if arguments.output == os.devnull:
        for _ in pings:
            pass
    else:
        survey_lines.write(pings, arguments.output)
    print(measuring.machine())
    print(f"{arguments.preset[0]} into {arguments.output}\n")
    measuring.table(["pings", "peak [MB]", "CPU a ping [s]"], rows)


if __name__ == "__main__":
    main()
