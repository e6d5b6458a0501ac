"""The test suite itself: it passes where Ctrl-C is ignored, and tells at its end what it left out."""
import os
import signal
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def suite(*arguments, ignored=(), **variables):
    """Run tests in a process of their own, in which signals are ignored."""
    def ignore():
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)

    child = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments], cwd=ROOT,
                           env={**os.environ, "PYTHONPATH": str(ROOT), **variables}, preexec_fn=ignore,
                           capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    return child.returncode, child.stdout


def test_it_passes_where_interruptions_are_ignored():
    code, said = suite("tests/cli/test_interruptions.py", "-k", "SIGINT and import", ignored=[signal.SIGINT])
    assert code == 0 and "1 passed" in said, said


def test_it_says_what_was_skipped_and_why():
    code, said = suite("tests/plugins/test_sonar_film.py", "--variants", "cuda_ad_mono", CUDA_VISIBLE_DEVICES="")
    assert code == 0 and "no usable CUDA device here" in said, said
