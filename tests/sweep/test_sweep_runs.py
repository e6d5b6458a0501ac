"""A sweep runs to its end whatever happens on the way: tried with a pool that renders nothing, so that every moment at
which it can be stopped, fail or be told that the disk is full is reached in a blink.

The pool writes what a real one would: bytes that depend on parameters and seed alone. `test_sweep_command` starts real
processes.
"""
import errno
import hashlib
import json
import os
from concurrent.futures import Future
from pathlib import Path

import hypothesis
import pytest
from hypothesis import strategies
from small_scene import TEXT

from mitsonar.sweep import estimate, execute, load_plan, manifest, merging, run
from mitsonar.sweep.parts import Part
from mitsonar.sweep.pools import local

FUZZ = {"deadline": None, "derandomize": True, "suppress_health_check": list(hypothesis.HealthCheck)}
PLAN = """
scene = "scene.xml"
samples = 4
[grid]
range = [30, 50, 60]
[draw]
rays = { integer = [1000, 3000] }
"""


class Pool:
    """Answers at once; `trouble` {number of the job: what happens} makes it misbehave."""

    capacity = 3
    refused: frozenset[str] = frozenset()              # values of rays whose scene cannot be loaded

    def __init__(self, trouble):
        self.trouble, self.jobs = trouble, 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def check(self):
        pass

    def submit(self, job):
        future, self.jobs = Future(), self.jobs + 1
        trouble = None if job["output"] is None else self.trouble.get(self.jobs)
        if trouble == "stop":
            raise KeyboardInterrupt
        if trouble in ("fails", "full", "raises"):
            if trouble == "raises":
                future.set_exception(RuntimeError("lost"))
            else:
                future.set_result({"error": "no good.", "full": trouble == "full", "seconds": 0.1, "warnings": []})
            return future
        if job["parameters"].get("rays") in self.refused:
            future.set_result({"error": "no room.", "refused": True, "full": False, "seconds": 0.1, "warnings": []})
            return future
        answer = {"seconds": 0.1, "warnings": ["too coarse"] if job["seed"] % 2 else []}
        if job["output"] is not None:
            content = json.dumps([job["parameters"], job["seed"]]).encode()
            Path(job["folder"], job["output"]).write_bytes(content)
            answer |= {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest(), "instruction_set": "AVX"}
        future.set_result(answer)
        return future


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    """Run the plan in `folder` by a pool with that trouble, and give the outcome."""
    (tmp_path / "scene.xml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")

    def start(folder="out", trouble=None, text=PLAN, **options):
        (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
        monkeypatch.setattr(execute, "Local", lambda *_: start.pool)
        start.pool = Pool(trouble or {})
        return run(tmp_path / "plan.toml", tmp_path / folder, **options)
    start.folder = tmp_path
    return start


def left(folder):
    """What a folder holds: outputs, and the last line about each without what the clock says and how often."""
    records = {}
    for line in (folder / "manifest.jsonl").read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        records[record["output"]] = {key: item for key, item in record.items() if key not in ("seconds", "attempts")}
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.name not in (".sweep.lock",
                                                                                            "manifest.jsonl")}
    return files, records


def test_the_manifest_says_all_about_every_render(sweep):
    outcome = sweep()
    assert (outcome.total, outcome.kept, outcome.done, outcome.failed) == (12, 0, 12, 0)
    files, records = left(sweep.folder / "out")
    assert sorted(files) == sorted(records) == [f"{index:06}.exr" for index in range(12)]
    plan = load_plan(sweep.folder / "plan.toml")
    for index, (name, record) in enumerate(sorted(records.items())):
        render = plan.render(index)
        assert (record["index"], record["parameters"], record["seed"]) == (index, render.parameters, render.seed)
        assert (record["status"], record["error"], record["bytes"]) == ("ok", None, len(files[name]))
        assert record["sha256"] == hashlib.sha256(files[name]).hexdigest() and record["instruction_set"] == "AVX"
        assert record.get("warnings", []) == (["too coarse"] if render.seed % 2 else [])
        assert set(record["versions"]) == {"mitsonar", "mitsuba", "drjit", "numpy"} and len(record["inputs"]) == 64


def test_a_refused_draw_is_drawn_again_and_counted(sweep, monkeypatch):
    """Two of the first draws have no room; they get others, the rest keep theirs, and a second run keeps them all."""
    plan_of = {True: "redraw = [\"rays\"]\n" + PLAN, False: PLAN}
    sweep("plain")
    _, plain = left(sweep.folder / "plain")
    crowded = sorted(plain)[1], sorted(plain)[7]
    monkeypatch.setattr(Pool, "refused", frozenset(str(plain[name]["parameters"]["rays"]) for name in crowded))
    failed = sweep("failing", text=plan_of[False])
    assert (failed.failed, failed.redrawn) == (len(failed.failures), 0) and failed.failed >= 2
    outcome = sweep(text=plan_of[True])
    files, records = left(sweep.folder / "out")
    assert (outcome.done, outcome.failed, outcome.redrawn) == (12, 0, failed.failed)
    for name, record in records.items():
        moved = record["parameters"]["rays"] != plain[name]["parameters"]["rays"]
        assert moved == (record["redrawn"] > 0)
    again = sweep(text=plan_of[True])
    assert (again.kept, again.done) == (12, 0) and left(sweep.folder / "out") == (files, records)


def test_what_is_refused_however_it_is_drawn_fails_in_the_end(sweep, monkeypatch):
    monkeypatch.setattr(execute, "check_loading", lambda *_: None)
    monkeypatch.setattr(Pool, "refused", frozenset(map(str, range(1000, 3001))))
    outcome = sweep(text="redraw = [\"rays\"]\n" + PLAN)
    assert (outcome.done, outcome.failed) == (0, 12) and sweep.pool.jobs == 12 * (execute.MOST_REDRAWN + 1)


def test_a_finished_sweep_does_nothing(sweep):
    sweep()
    before = left(sweep.folder / "out")
    outcome = sweep()
    assert (outcome.kept, outcome.done, sweep.pool.jobs) == (12, 0, 0)
    assert left(sweep.folder / "out") == before


def test_only_what_is_missing_or_changed_is_made_anew(sweep):
    sweep()
    (sweep.folder / "out" / "000003.exr").unlink()
    (sweep.folder / "out" / "000005.exr").write_bytes(b"half")
    assert sweep().done == 2
    said = []
    assert sweep(text=PLAN.replace("60]", "61]"), say=said.append).done == 4
    assert said == [f"4 renders in {sweep.folder / 'out'} were made from other parameters, files or versions and "
                    "are rendered again"]
    (sweep.folder / "scene.xml").write_text(TEXT + "<!-- other -->", encoding="utf-8")
    assert sweep(text=PLAN.replace("60]", "61]")).done == 12


def test_images_of_another_content_are_made_anew_when_asked_for(sweep):
    sweep()
    image, said = sweep.folder / "out" / "000003.exr", []
    whole = image.read_bytes()
    image.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))         # as long as before
    assert (sweep().done, sweep.pool.jobs) == (0, 0)
    assert sweep(verify=True, say=said.append).done == 1
    assert said == [f"1 render in {sweep.folder / 'out'} was altered after writing and is rendered again"]
    assert image.read_bytes() == whole
    assert sweep(verify=True).done == 0


def test_one_of_a_kind_is_told_as_one(sweep):
    said, one = [], 'scene = "scene.xml"\nseed = 1'
    sweep(text=one)
    with (sweep.folder / "out" / "manifest.jsonl").open("a", encoding="utf-8") as file:
        file.write("no line\n")
    sweep(text=one.replace("1", "2"), say=said.append)
    assert said == [f"1 damaged line of {sweep.folder / 'out' / 'manifest.jsonl'} is ignored",
                    f"1 render in {sweep.folder / 'out'} was made from other parameters, files or versions and is "
                    "rendered again"]


def test_images_of_an_earlier_plan_are_told(sweep):
    sweep()
    said, fewer = [], PLAN.replace("samples = 4", "samples = 3")
    assert sweep(text=fewer, say=said.append).kept == 9
    assert sweep(text='output = "{index}.exr"' + fewer, say=said.append).done == 9
    assert [text.partition(";")[0] for text in said] == [
        "3 images here belong to no render of this plan: 000009.exr, 000010.exr, 000011.exr",
        "12 images here belong to no render of this plan: 000000.exr, 000001.exr, 000002.exr, ..."]
    for index in range(1, 12):
        (sweep.folder / "out" / f"{index:06}.exr").unlink()
    found = estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out")
    assert (found.missing, found.unplanned) == (0, ["000000.exr"])


def test_other_versions_are_made_anew(sweep, monkeypatch):
    sweep()
    monkeypatch.setattr(execute, "versions", lambda: {"mitsonar": "99"})
    assert sweep().done == 12


def test_a_longer_sweep_keeps_what_is_there(sweep):
    sweep()
    outcome = sweep(text=PLAN.replace("samples = 4", "samples = 6"))
    assert (outcome.kept, outcome.done) == (12, 6)


def test_a_render_that_fails_once_is_done_and_twice_is_listed(sweep):
    sweep("calm")
    outcome = sweep(trouble={5: "fails", 9: "raises"})             # the two first jobs only load
    assert (outcome.done, outcome.failed) == (12, 0)
    assert left(sweep.folder / "out") == left(sweep.folder / "calm")
    outcome = sweep("bad", trouble=dict.fromkeys(range(2, 200), "fails"))
    assert (outcome.done, outcome.failed, outcome.failures[0]) == (0, 12, ("000000.exr", "no good."))
    assert sweep.pool.jobs == 1 + 2 * 12
    assert {record["status"] for record in left(sweep.folder / "bad")[1].values()} == {"failed"}
    assert sweep("bad").done == 12
    assert left(sweep.folder / "bad") == left(sweep.folder / "calm")


@hypothesis.settings(max_examples=25, **FUZZ)
@hypothesis.given(trouble=strategies.lists(strategies.tuples(
    strategies.integers(1, 16), strategies.sampled_from(["stop", "full", "fails"]), strategies.integers(0, 400)),
    max_size=5))
def test_however_often_it_is_stopped_the_end_is_the_same(sweep, trouble):
    """Every time it also loses the end of its manifest, as when the machine goes down."""
    if not (sweep.folder / "calm").exists():
        sweep("calm")
    for path in (sweep.folder / "out").glob("*"):
        path.unlink()
    for number, kind, lost in trouble:
        try:
            sweep(trouble={number: kind})
        except (KeyboardInterrupt, OSError):
            pass
        path = sweep.folder / "out" / "manifest.jsonl"
        if path.exists():
            os.truncate(path, max(0, path.stat().st_size - lost))
        (sweep.folder / "out").mkdir(exist_ok=True)
        (sweep.folder / "out" / ".000001.0123abcd.exr").write_bytes(b"unfinished")
        path.touch()
    sweep()
    assert left(sweep.folder / "out") == left(sweep.folder / "calm")


def test_a_full_disk_stops_it_in_a_sentence_and_loses_nothing(sweep, monkeypatch):
    with pytest.raises(OSError, match="no good. The sweep stopped and keeps finished renders"):
        sweep(trouble={6: "full"})
    assert len(left(sweep.folder / "out")[1]) >= 1
    write, calls = os.pwrite, []

    def fills_up(file, content, offset):
        calls.append(content)
        if len(calls) < 5:
            return write(file, content, offset)
        if len(calls) == 5:
            return write(file, content[:7], offset)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(manifest.os, "pwrite", fills_up)
    with pytest.raises(OSError, match="the disk is full; the sweep stopped and keeps finished renders") as caught:
        sweep()
    assert caught.value.errno == errno.ENOSPC and len(calls) == 6
    monkeypatch.undo()
    kept = len(left(sweep.folder / "out")[1])                      # every line is whole
    outcome = sweep()
    assert (outcome.kept, outcome.done) == (kept, 12 - kept)
    sweep("calm")
    assert left(sweep.folder / "out") == left(sweep.folder / "calm")


def test_an_estimate_tries_a_few_and_writes_nothing(sweep, monkeypatch):
    sweep("other")
    monkeypatch.setattr(estimate, "Local", lambda *_: Pool({}))
    said = []
    found = estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out", processes=4, say=said.append)
    assert (found.total, found.missing, found.trials, found.processes) == (12, 12, 3, 4)
    assert said == ["timing 3 renders"]
    assert (found.seconds, 40 < found.bytes < 100) == (0.1, True)
    assert not (sweep.folder / "out").exists()
    monkeypatch.setattr(estimate, "Local", lambda *_: Pool({2: "fails"}))
    with pytest.raises(ValueError, match=r"render 5 \(000005.exr\) fails: no good"):
        estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out")
    sweep()
    found = estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out")
    assert (found.missing, found.seconds) == (0, None)


@pytest.mark.parametrize("first, trials, each", [(45.0, 2, 20.0), (400.0, 1, 400.0)])
def test_an_estimate_does_not_count_the_render_that_compiles(sweep, monkeypatch, first, trials, each):
    """45 s with compiling and 20 s without are 20 s each; an hour's render is not tried twice."""
    clock, lasting = [0.0], iter([first, 20.0, 20.0])

    class Slow(Pool):
        def submit(self, job):
            future = super().submit(job)
            answer = future.result()
            answer["seconds"] = next(lasting)
            clock[0] += answer["seconds"]
            return future

    monkeypatch.setattr(estimate, "Local", lambda *_: Slow({}))
    monkeypatch.setattr(estimate.time, "perf_counter", lambda: clock[0])
    found = estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out")
    assert (found.trials, found.seconds) == (trials, each)


def test_an_estimate_loads_a_scene_where_it_times_none(sweep, monkeypatch):
    class Unloadable(Pool):
        def submit(self, job):
            assert job["output"] is None
            return super().submit({**job, "output": "it fails"} if self.trouble else job)

    sweep()
    (sweep.folder / "out" / "000003.exr").unlink()
    monkeypatch.setattr(estimate, "Local", lambda *_: Unloadable({}))
    assert estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out").trials == 0
    monkeypatch.setattr(estimate, "Local", lambda *_: Unloadable(dict.fromkeys((1, 2), "fails")))
    with pytest.raises(ValueError, match="no render of plan.toml was started: no good"):
        estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out")


@pytest.mark.parametrize("cores, asked, at_once, rounds", [
    (2, (50, None), 2, 6), (8, (50, None), 8, 2), (64, (50, None), 50, 1), (16, (5, None), 5, 3), (8, (2, 8), 1, 12)])
def test_an_estimate_counts_rounds_of_what_the_cores_bear(sweep, monkeypatch, cores, asked, at_once, rounds):
    monkeypatch.setattr(estimate, "Local", lambda *_: Pool({}))
    monkeypatch.setattr(estimate, "cores", lambda: cores)
    monkeypatch.setattr(local, "cores", lambda: cores)
    (sweep.folder / "plan.toml").write_text(PLAN, encoding="utf-8")
    found = estimate.estimate(sweep.folder / "plan.toml", processes=asked[0], threads=asked[1])
    assert (found.processes, found.at_once) == (asked[0], at_once)
    assert found.duration == pytest.approx(0.1 * rounds)


def test_a_second_runner_is_told_who_the_first_is(sweep):
    os.mkdir(sweep.folder / "out")
    with manifest.Manifest(str(sweep.folder / "out")):
        with pytest.raises(ValueError, match=rf"is being run by process {os.getpid()} on .* since "):
            sweep()
    assert sweep().done == 12


def test_files_that_no_sweep_made_are_left_alone(sweep):
    os.mkdir(sweep.folder / "out")
    (sweep.folder / "out" / "000007.exr").write_bytes(b"mine")
    with pytest.raises(ValueError, match="holds 000007.exr, but no manifest lists it"):
        sweep()
    assert [path.name for path in (sweep.folder / "out").iterdir()] == ["000007.exr"]


def test_a_sweep_that_cannot_begin_leaves_no_folder(sweep):
    with pytest.raises(KeyboardInterrupt):
        sweep(trouble={3: "stop"})
    with pytest.raises(ValueError, match="give 1 to 1024"):
        sweep("new", threads=0)
    with pytest.raises(ValueError, match="together; give one of them"):
        sweep("new", processes=1, workers=2)
    assert not (sweep.folder / "new").exists()


@hypothesis.settings(max_examples=100, **FUZZ)
@hypothesis.given(before=strategies.integers(0, 3), given=strategies.one_of(strategies.binary(), strategies.recursive(
    strategies.one_of(strategies.none(), strategies.booleans(), strategies.integers(), strategies.text()),
    lambda inner: strategies.dictionaries(strategies.sampled_from(
        ["output", "status", "ok", "failed", "parameters", "seed", "inputs", "versions", "bytes", "seconds"]), inner)
).map(lambda given: json.dumps(given).encode())), ended=strategies.booleans())
def test_whatever_a_manifest_holds_its_lines_count_and_a_line_can_be_added(tmp_path, before, given, ended):
    record = {"index": 0, "parameters": {}, "seed": 0, "inputs": "", "versions": {}, "status": "ok", "seconds": 1.0,
              "bytes": 5}
    lines = b"".join(json.dumps({**record, "output": f"{k}.exr"}).encode() + b"\n" for k in range(before))
    (tmp_path / "manifest.jsonl").write_bytes(lines + given + (b"\n" if ended else b""))
    (tmp_path / ".sweep.lock").unlink(missing_ok=True)
    with manifest.Manifest(str(tmp_path)) as held:
        assert {f"{k}.exr" for k in range(before)} <= set(held.entries)
        held.append({**record, "output": "new.exr"})
    entries, _, whole = manifest.read(str(tmp_path / "manifest.jsonl"))
    assert entries["new.exr"].bytes == 5 and {f"{k}.exr" for k in range(before)} <= set(entries)
    assert whole == os.path.getsize(tmp_path / "manifest.jsonl")


def test_an_endless_line_is_read_in_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr(manifest, "LONGEST_LINE", 1000)
    (tmp_path / "m").write_bytes(b"x" * 5500 + b"\n" + b"y" * 3000)
    assert manifest.read(str(tmp_path / "m")) == ({}, 1, 5501)


def merged(sweep, *folders, to=None, **options):
    return merging.merge(sweep.folder / "plan.toml", [sweep.folder / folder for folder in folders],
                         None if to is None else sweep.folder / to, **options)


def test_a_merge_keeps_lines_of_another_plan_and_of_parts_begun_since(sweep):
    other = 'output = "other_{index}.exr"\n' + PLAN
    sweep(part=Part(number=1, count=2), text=other)
    sweep(part=Part(number=1, count=2))

    def begun(done, total):
        if done == 1:
            sweep(part=Part(number=2, count=2))
    assert merged(sweep, "out", progress=begun).joined == 6
    assert (sweep.folder / "out" / "manifest.part-2-of-2.jsonl").is_file()
    assert sweep(text=other).kept == 6 and sweep().kept == 12


def test_a_merge_stopped_anywhere_is_run_again(sweep, monkeypatch):
    sweep("one")
    for number in (1, 2):
        sweep(f"part {number}", part=Part(number=number, count=2))
    for at in range(12):
        def stop(done, total, at=at):
            if done > at:
                raise KeyboardInterrupt
        with pytest.raises(KeyboardInterrupt):
            merged(sweep, "part 1", "part 2", to="whole", progress=stop)
        assert not (sweep.folder / "whole" / "manifest.jsonl").exists()
    (sweep.folder / "whole" / ".manifest.3fffffff-00000000.jsonl").write_bytes(b"half")
    assert merged(sweep, "part 1", "part 2", to="whole").joined == 12
    assert left(sweep.folder / "whole") == left(sweep.folder / "one")


def test_a_merge_brings_what_links_lead_to(sweep):
    sweep("a")
    (sweep.folder / "a" / "store").mkdir()
    for path in (sweep.folder / "a").glob("*.exr"):
        path.rename(path.with_name("store") / path.name)
        path.symlink_to(f"store/{path.name}")
    assert merged(sweep, "a", to="whole").joined == 12
    assert not any(path.is_symlink() for path in (sweep.folder / "whole").iterdir())
    assert (sweep.folder / "whole" / "000000.exr").read_bytes() == (sweep.folder / "a" / "000000.exr").read_bytes()


@pytest.mark.parametrize("lie", [
    {"versions": ["1"]}, {"versions": {"mitsonar": 1}}, {"parameters": [1]}, {"parameters": {"a": {}}}, {"seed": "1"},
    {"seconds": float("inf")}, {"seconds": -1}, {"bytes": -1}, {"bytes": 1 << 80}, {"sha256": 5}, {"output": "\ud800"},
    {"redrawn": "many"}, {"redrawn": -1}, {"classes": 5}, {"sha256": None}, {"instruction_set": {}}, {"output": "\0"},
    {"output": "/etc/hostname"}, {"index": -1}, {"index": 1 << 80}, {"plan": []}, {"preview": "\0"},
    {"redrawn": 1 << 70}])
def test_lines_that_lie_are_passed_over(sweep, lie):
    sweep("a", part=Part(number=1, count=2))
    path = sweep.folder / "a" / "manifest.part-1-of-2.jsonl"
    first, *others = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([json.dumps({**json.loads(first), **lie}), *others]) + "\n", encoding="utf-8")
    assert merged(sweep, "a", to="whole").joined >= 5
    assert sweep("a").kept >= 5 and sweep("a").kept == 12


def test_a_pool_that_is_left_early_ends_with_jobs_that_have_not_begun(tmp_path):
    from mitsonar.sweep.pools.local import Local

    with Local(1, 2, str(tmp_path)) as pool:
        futures = [pool.submit({"versions": {}}) for _ in range(6)]
    assert all(future.done() for future in futures)


def test_parts_of_another_number_in_one_folder_are_refused_until_they_are_joined(sweep):
    sweep("one")
    sweep(part=Part(number=1, count=2))
    other, said = Part(number=2, count=3), r"part 2/3 was asked for, and .*out has parts of 2 \(manifest\.part-1-of-2"
    with pytest.raises(ValueError, match=said):
        sweep(part=other)
    with pytest.raises(ValueError, match=said):
        estimate.estimate(sweep.folder / "plan.toml", sweep.folder / "out", part=other)
    assert not list((sweep.folder / "out").glob("*of-3*"))         # a refused part leaves nothing
    assert sweep(part=Part(number=2, count=2)).done == 6           # others of the same number go on
    (sweep.folder / "out" / "000005.exr").unlink()
    assert merged(sweep, "out").joined == 11
    assert sweep(part=Part(number=3, count=3)).done == 1           # of 2, 5, 8, 11 the other three are there
    assert merged(sweep, "out").joined == 12 and left(sweep.folder / "out") == left(sweep.folder / "one")


@pytest.mark.parametrize("cores, gigabytes, processes, threads, shared", [
    (8, 64, None, None, (8, 1)), (8, 3.5, None, None, (3, 2)), (8, 0.5, None, None, (1, 8)), (8, 64, None, 4, (2, 4)),
    (2, 64, 1, None, (1, 2)), (2, 64, 5, None, (5, 1)), (2, 64, 3, 2, (3, 2))])
def test_processes_share_cores_and_memory(monkeypatch, cores, gigabytes, processes, threads, shared):
    monkeypatch.setattr(local, "cores", lambda: cores)
    monkeypatch.setattr(local, "memory", lambda: 1e9 * gigabytes)
    assert local.shares(processes, threads) == shared
