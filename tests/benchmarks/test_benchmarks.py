"""The benchmarks still run: each as a person starts it, at a size that takes a moment. Figures are not looked at.

One process runs them one after another, each as its main program: a start costs more than most of them.
"""
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from exhaustive import thinned

HERE = Path(__file__).resolve().parent
SMALL = "--nodes", "60"
FRAME = [f"-D{one}" for one in ("cell=0.3", "elements=4", "range=10")]
RUNS = {
    "tracing": (["tracing.py", *SMALL, "--rays", "4096", "--rounds", "2"], "cast: hits alone"),
    "eigenrays": (["eigenrays.py", *SMALL, "--rays", "200"], "gradient -1 1/s"),
    "return_times": (["return_times.py", "--hits", "50", "--lanes", "1024", "--rounds", "1"], "| guarded | vertical |"),
    "bellhop_field": (["bellhop_field.py"], "pelagic is not here"),
    "ping": (["ping.py", *SMALL, "--rays", "4000", "--pings", "2", "--rounds", "1"], "mitsonar.render"),
    "pings": (["pings.py", *SMALL, "--rays", "4000", "--pings", "2", "--rounds", "1"], "this checkout"),
    "accumulation": (["accumulation.py", "--hits", "2000", "--elements", "1", "6", "--rounds", "1"], "numpy bincount"),
    "beam_grid": (["beam_grid.py", "--echoes", "2000", "--elements", "16", "--beams", "20", "--farthest", "8",
                   "--rounds", "1"], "echoes on the grid"),
    "beamforming": (["beamforming.py", "--elements", "8", "--beams", "8", "--samples", "128", "--rounds", "1"],
                    "NumPy delay-and-sum"),
    "elements": (["elements.py", "--elements", "3", "--cell", "2", "--rounds", "1"], "whole ping"),
    "ensonification": (["elements.py", "--ensonification", "--cell", "2", "--rays", "2000", "--rounds", "1"],
                       "2,000 rays"),
    "scattering": (["scattering.py", *SMALL, "--rays", "4000", "--hits", "4096", "--pings", "1", "--rounds", "1"],
                   "law alone, two directions"),
    "fans": (["fans.py", "-Drange=10", "-Delements=16", "--beams", "20", "--rounds", "1", "--memory", "2"],
             "echoes and shadows"),
    "steps": (["steps.py", "--scenes", "small", "--rounds", "1", "--memory", "4"], "a step that turns"),
    "turns": (["turns.py", "-Drange=8", "-Drays=1000", "-Dcell=0.3", "--pings", "2", "--rounds", "1",
               "--elements", "1"], "1 pings by elements"),
    "multipath": (["multipath.py", "-Drays=4000", "-Dbins=80", "--pings", "2", "--rounds", "1", "--seeds", "2"],
                  "max_depth 2"),
    "focusing": (["focusing.py", "--side", "0.4", "--receivers", "4", "--spacing", "0.02", "--rounds", "1"],
                 "20 mm, a thermocline"),
    "frame_errors": (["frame_errors.py", "--quick", "bed"], "mean |beam|²"),
    "killed_parts": (["killed_parts.py", "--samples", "2", "--kills", "1", "--longest", "3"], "manifest are the same"),
    "moving": (["moving.py", "--frames", "1", "--beams", "32"], "moving"),
    "on_the_fly": (["on_the_fly.py", "--images", "3", "--workers", "0"], "images a second"),
    "frame": (["frame.py", *FRAME, "--rounds", "1"], "picture, this checkout"),
    "gradients": (["gradients.py", "--rays", "4000", "--pings", "2", "--rounds", "1"], "Jt w, hits kept"),
    "inversions": (["inversions.py", "--quick", "--scenes", "mounds", "--looks", "1", "--pings", "7", "--spacing", "4"],
                   "mounds"),
    "poses": (["poses.py", "--quick", "--scenes", "box", "--looks", "1", "--pings", "5", "--rays", "500", "--exact"],
              "box"),
    "strips": (["strips.py", "--cell", "0.3", "--rounds", "1", "-Dreceivers=6", "-Doverlap=2"], "this checkout"),
    "sweep": (["sweep.py", "--renders", "4", "--kills", "1"], "outputs the same"),
    "kernels": (["kernels.py", "--images", "2", "--kinds", "echo_sounder"], "beside rendering"),
    "recorders": (["recorders.py", "--scenes", "sector_scan", "--pings", "1", "--rounds", "1"], "sector_scan"),
    "real_sidescan": (["real_sidescan.py", "--real", "none.xtf", "--pings", "70", "-Drays=10000", "-Dbed_spacing=0.3",
                       "-Dripple_height=0", "-Dripple_wavelength=2", "-Dbins=512"], "coefficient of variation"),
    "real_heights": (["real_heights.py", "--line", "none.kmall"], "is not here"),
    "profile_from_soundings": (["profile_from_soundings.py", "--quick"], "mean only"),
    "soundings": (["soundings.py", "--preset", "shelf_80khz", "-Ddepth=12", "-Drange=40", "-Dswath_deg=120",
                   "--rounds", "1"], "shelf_80khz, with the water"),
    "starts": (["starts.py", "--rounds", "1", "--only", "describe"], "kept"),
    "walked_beds": (["walked_beds.py", "--scene", "sidescan_flat", "--rays", "4000", "--rounds", "1"],
                    "sidescan_flat, up"),
    "survey": (["ping.py", *SMALL, "--rays", "4000", "--survey", "4"], "peak [MB]"),
}


LONG = {"frame", "frame_errors", "gradients", "inversions", "multipath", "poses", "real_sidescan", "scattering",
        "soundings", "survey", "sweep", "turns"}                               # over 4 s


IN_TURN = """
import contextlib, io, json, os, runpy, sys, traceback
for name, script, *options in json.loads(sys.argv[1]):
    sys.argv, sys.path[0] = [script, *options], os.path.dirname(script)
    code, out, err = 0, io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            runpy.run_path(script, run_name="__main__")
        except SystemExit as end:
            code = end.code or 0
        except BaseException:
            code = traceback.format_exc()
    print(json.dumps([name, code, out.getvalue(), err.getvalue()]), flush=True)
"""


@pytest.fixture(scope="module")
def ends(request):
    """Exit code, output and errors of each benchmark that is to run; none of those after one that ends the process."""
    names = [item.callspec.params["name"] for item in request.session.items if item.path == request.path]
    programs = [[name, str(HERE / RUNS[name][0][0]), *RUNS[name][0][1:]] for name in names]
    child = subprocess.run([sys.executable, "-c", IN_TURN, json.dumps(programs)], capture_output=True, text=True,
                           check=False, stdin=subprocess.DEVNULL, timeout=900, env={**os.environ, "PYTHONPATH": ""})
    ended = {name: rest for name, *rest in map(json.loads, child.stdout.splitlines())}
    return {name: ended.get(name, [f"no end: {child.stderr[-2000:]}", "", ""]) for name in names}


@pytest.mark.parametrize("name", thinned(RUNS, *RUNS.keys() - LONG))
def test_benchmark_runs_and_prints_its_table(ends, name):
    code, out, err = ends[name]
    assert code == 0, err
    assert RUNS[name][1] in out
    assert "nan" not in out or name == "real_sidescan"                # a small picture may lack shadows
