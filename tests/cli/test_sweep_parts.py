"""Parts of a sweep: those of three machines joined are one run, and what a merge finds wrong is named."""
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mitsonar.cli import main as cli
from mitsonar.sweep.part_scripts import part_script
from mitsonar.sweep.parts import Part

ROOT = Path(__file__).resolve().parents[2]
PLAN = """
scene = "scene.xml"
[set]
pings = 2
rays = 1000
[grid]
range = [30, 40, 50, 60, 70]
"""
NAMES = [f"{index:06}.exr" for index in range(5)]


@pytest.fixture
def plan(folder):
    """The folder of the small scene, with a plan of five renders."""
    (folder / "plan.toml").write_text(PLAN, encoding="utf-8")
    return folder


def images(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix == ".exr"}


def records(folder):
    """Lines of the manifest without what the clock says."""
    return [{**json.loads(line), "seconds": 0} for line in
            (folder / "manifest.jsonl").read_text(encoding="utf-8").splitlines()]


def run(*words):
    return cli.main(["sweep", "plan.toml", "--processes", "1", *words])


@pytest.mark.slow
def test_three_parts_joined_are_one_run_and_lies_are_found(plan, capfd, kept):
    assert run("-o", "one") == 0
    assert run("-o", "a", "--part", "1/3") == run("-o", "a", "--part", "2/3") == run("-o", "b", "--part", "3/3") == 0
    assert "part 3/3, 1 render: 1 rendered" in capfd.readouterr().out
    assert sorted(images(plan / "a")) == [NAMES[k] for k in (0, 1, 3, 4)] and list(images(plan / "b")) == [NAMES[2]]
    assert {path.name for path in (plan / "a").iterdir()} >= {f"manifest.part-{k}-of-3.jsonl" for k in (1, 2)}
    assert run("-o", "a", "--part", "2/3") == 0                    # nothing is made twice
    assert "2 renders: nothing to do, 2 already there" in capfd.readouterr().out

    assert cli.main(["sweep", "plan.toml", "-o", "half", "--merge", "a"]) == 1
    out, err = capfd.readouterr()
    assert out.startswith("4 of 5 renders joined\n") and err == "mitsonar: 1 render missing: 2\n"
    assert cli.main(["sweep", "plan.toml", "-o", "whole", "--merge", "a", "b"]) == 0
    assert capfd.readouterr() == (f"5 of 5 renders joined\n{plan}/whole/manifest.jsonl\n", "")
    assert images(plan / "whole") == images(plan / "one") and records(plan / "whole") == records(plan / "one")
    assert run("-o", "whole") == 0
    assert "nothing to do, 5 already there" in capfd.readouterr().out

    image, line = plan / "b" / NAMES[2], plan / "b" / "manifest.part-3-of-3.jsonl"
    image.write_bytes(image.read_bytes()[:-1] + b"?")              # as long as it was
    assert cli.main(["sweep", "plan.toml", "-o", "lies", "--merge", "a", "b"]) == 1
    assert capfd.readouterr().err == ("mitsonar: 1 render left out, altered after writing, or not what its line says: "
                                      "2\n")
    record = json.loads(line.read_text(encoding="utf-8"))
    for lie, said in (({"seed": 5}, "made from other parameters or files"),
                      ({"versions": {**record["versions"], "mitsuba": "2.0"}},
                       "made by other versions (mitsuba 2.0)")):
        line.write_text(json.dumps({**record, **lie}) + "\n", encoding="utf-8")
        assert cli.main(["sweep", "plan.toml", "-o", "lies", "--merge", "b"]) == 1
        assert f"1 render left out, {said}: 2\n" in capfd.readouterr().err
    line.write_text(json.dumps({**record, "output": "../one/000002.exr"}) + "\n", encoding="utf-8")
    assert cli.main(["sweep", "plan.toml", "-o", "lies", "--merge", "b"]) == 1
    assert "1 render missing: 2\n" in capfd.readouterr().err

    assert cli.main(["sweep", "plan.toml", "--merge", "a"]) == 1    # in the folder itself
    assert not list((plan / "a").glob("*part*")) and len(records(plan / "a")) == 4
    assert run("-o", "a", "--part", "3/3") == 0
    assert run("-o", "a") == 0 and images(plan / "a") == images(plan / "one")


def start(folder, *options):
    return subprocess.Popen([sys.executable, "-m", "mitsonar", "sweep", "plan.toml", "--processes", "1", *options],
                            cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


@pytest.mark.slow
def test_two_parts_on_one_disk_at_the_same_time_and_one_of_them_killed(plan, capfd, kept):
    assert run("-o", "one") == 0
    other = start(plan, "-o", "both", "--part", "2/2")
    for after in (0.5, 2.5, 3.5):
        part = start(plan, "-o", "both", "--part", "1/2")
        time.sleep(after)
        part.send_signal(signal.SIGKILL)
        part.wait()
    assert other.wait() == 0 and run("-o", "both", "--part", "1/2") == 0
    assert cli.main(["sweep", "plan.toml", "--merge", "both"]) == 0
    assert images(plan / "both") == images(plan / "one")
    assert sorted(path.name for path in (plan / "both").iterdir()) == [".sweep.lock", *NAMES, "manifest.jsonl"]


def test_parts_share_a_plan_out():
    parts = [Part(number=number, count=7) for number in range(1, 8)]
    assert sorted(index for part in parts for index in part.indices(20)) == list(range(20))
    assert {len(part.indices(20)) for part in parts} == {2, 3}


@pytest.mark.parametrize("options, said", [
    (["--part", "0/3"], "the part is '0/3'; give a number"), (["--part", "4/3"], "the part is '4/3'; give"),
    (["--part", "3"], "the part is '3'; give"), (["--part", "9/9"], "part 9/9 was asked for, and the plan makes 5"),
    (["--merge", "nowhere"], "nowhere: it holds no manifest"), (["--parts", "3"], "--part-script needs the number"),
    (["--part", "1/2", "--merge", "a"], "--part and --merge were given together")])
def test_wrong_words_are_refused(plan, capfd, options, said):
    assert cli.main(["sweep", "plan.toml", *options]) == 2
    err = capfd.readouterr().err
    assert said in err and err.count("\n") == 1


@pytest.mark.parametrize("kind, last", [("slurm", '--part "$SLURM_ARRAY_TASK_ID/200"'),
                                        ("kubernetes", r'--part \"$((JOB_COMPLETION_INDEX + 1))/200\"')])
def test_a_script_runs_every_part_of_a_plan(kind, last):
    text = part_script(kind, "/data/my plan.toml", "/data/out", parts=200, renders=10_000, seconds=90.0, threads=3)
    assert "sweep '/data/my plan.toml' -o /data/out --processes 1 --threads 3 " in text and last in text
    if kind == "slurm":                                # 50 renders of 90 s a part, twice as long as that
        assert "#SBATCH --array=1-200\n" in text and "#SBATCH --time=02:30:00\n" in text
        subprocess.run(["bash", "-n"], input=text, text=True, check=True)
    else:
        assert "completions: 200\n" in text and "activeDeadlineSeconds: 9000\n" in text


def test_a_script_of_more_parts_than_renders_is_refused():
    with pytest.raises(ValueError, match="give 1 to 5 parts"):
        part_script("slurm", "plan.toml", "out", parts=6, renders=5, seconds=None)


@pytest.mark.slow
def test_samples_hold_no_exr_and_any_exr_is_made_again(plan, capfd, kept):
    pytest.importorskip("pyarrow")
    (plan / "plan.toml").write_text(PLAN + '[labels]\nmasks = true\narrays = ["level"]\n', encoding="utf-8")
    assert run("-o", "set") == 2
    assert "let its names end in .tar" in capfd.readouterr().err
    text = 'output = "{index:06}.tar"\nclasses = ["box"]\n' + PLAN + '[labels]\nmasks = true\narrays = ["level"]\n'
    (plan / "plan.toml").write_text(text, encoding="utf-8")
    assert run("-o", "set") == 0
    assert not list((plan / "set").glob("*.exr")) and len(list((plan / "set").glob("*.tar"))) == 5
    (plan / "exr.toml").write_text(PLAN, encoding="utf-8")
    assert cli.main(["sweep", "exr.toml", "-o", "one", "--processes", "1"]) == 0
    assert cli.main(["sweep", "plan.toml", "--only", "3", "-o", "again.exr"]) == 0
    assert (plan / "again.exr").read_bytes() == (plan / "one" / "000003.exr").read_bytes()
    capfd.readouterr()
    assert cli.main(["shards", "set", "-o", "shards", "--size", "1", "--title", "Boxes"]) == 0
    out, err = capfd.readouterr()
    assert out == "shards\n" and err.startswith("5 records in 1 shard\nset: 5 pictures, ")
    assert {path.name for path in (plan / "shards").iterdir()} >= {"train-00000.tar", "README.md", "index.parquet",
                                                                   "croissant.json"}
    (plan / "plan.toml").write_text(text + "threshold = 0.4\n", encoding="utf-8")       # another rule, other samples
    assert run("-o", "set") == 0
    assert "5 rendered" in capfd.readouterr().out
    (plan / "plan.toml").write_text(text + "colour = true\n", encoding="utf-8")
    assert run("-o", "set") == 2
    assert "labels.colour is unknown" in capfd.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_merge_that_cannot_begin_leaves_no_folder(plan, refusal):
    (plan / "file").write_text("", encoding="utf-8")
    for name in ("empty", "pipe"):
        (plan / name).mkdir()
    (plan / "empty" / "manifest.jsonl").write_text("", encoding="utf-8")
    os.mkfifo(plan / "pipe" / "manifest.part-1-of-2.jsonl")
    assert "it is a device or a pipe" in refusal("sweep", "plan.toml", "--merge", "pipe", "-o", "whole")
    assert "it is a device or a pipe" in refusal("shards", "pipe", "-o", "whole")
    for place in ("file", "file/within"):
        assert "it is a file, or in one" in refusal("sweep", "plan.toml", "--merge", "empty", "-o", place)
    assert "the folder" in (said := refusal("sweep", "plan.toml", "--only", "0", "-o", "no/a.exr")) and "make" in said
