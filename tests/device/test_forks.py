"""Forked processes render as their parent does, or are refused in a sentence; they never wait forever.

Every case runs in a process of its own, because what has been used before a fork decides.
"""
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")]
CODE = """
import multiprocessing, sys, threading, time
import mitsonar, mitsuba as mi, numpy as np

def rendered():
    return mitsonar.render("scenes/sidescan_flat.xml", seed=1, pings=2, rays=60000, bins=50).level.values.tobytes()

def child(pipe):
    try:
        level = rendered()
        picture = np.full((8, 8, 1), 0.5, np.float32)
        mi.Bitmap(picture).write(sys.argv[1])                  # which waits for a worker, as reading does
        pipe.send((level, (np.array(mi.Bitmap(sys.argv[1])) == picture).all()))
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}")

def forked():
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=child, args=(theirs,))
    process.start()
    answer = ours.recv() if ours.poll(60) else "it waits"
    process.kill()
    return answer
"""
WAYS = {"before use": "answers = [forked()]; parent = rendered()",
        "after use": "parent = rendered(); answers = [forked(), forked()]; answers.append((rendered(), True))",
        "before use, beside a thread": "threading.Thread(target=time.sleep, args=(3,)).start(); answers = [forked()]; "
                                       "parent = rendered()"}


def printed(code, path):
    """Run `code` in a process of its own and return what it printed."""
    run = subprocess.run([sys.executable, "-c", CODE + code, str(path)], capture_output=True, text=True, check=False,
                         cwd=Path(__file__).parents[2], timeout=240)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


@pytest.mark.parametrize("way", WAYS)
def test_a_fork_renders_as_its_parent(way, tmp_path):
    assert printed(f"{WAYS[way]}\nprint(answers == [(parent, True)] * len(answers) or answers)",
                   tmp_path / "half.exr") == "True"


@pytest.mark.parametrize("before, why", [
    ("rendered(); threading.Thread(target=time.sleep, args=(60,), daemon=True).start()",
     "rendered, and had other Python threads"),
    ("rendered(); mi.variant = lambda: 'cuda_ad_mono'", "used the GPU")], ids=["a thread", "a GPU"])
def test_a_fork_that_cannot_render_is_refused_and_its_parent_goes_on(before, why, tmp_path):
    said = printed(f"variant = mi.variant\n{before}\nprint(forked())\nmi.variant = variant\nprint(len(rendered()))",
                   tmp_path / "half.exr").splitlines()
    assert said[0].startswith(f"BackendError: This process was forked from one that had {why}, and cannot render.")
    assert 'multiprocessing.get_context("spawn")' in said[0] and int(said[1]) > 0
