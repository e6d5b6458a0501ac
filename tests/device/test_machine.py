"""Cores and memory are those that a container's control group leaves to its processes."""
import math
import os

import pytest

from mitsonar.device import machine

CORES = 8


@pytest.fixture
def group(tmp_path, monkeypatch):
    """Write the files of control groups on a machine of eight cores."""
    monkeypatch.setattr(machine, "GROUPS", str(tmp_path / "groups"))
    monkeypatch.setattr(machine, "OWN", str(tmp_path / "own"))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(CORES), raising=False)

    def write(own, **files):
        (tmp_path / "own").write_text(own)
        for name, text in files.items():
            place = tmp_path / "groups" / name.replace("__", "/").replace("_max", ".max")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text)

    return write


@pytest.mark.parametrize("quota, expected", [
    ("200000 100000", 2), ("150000 100000", 2), ("50000 100000", 1), ("max 100000", CORES), ("9000000 100000", CORES),
    ("", CORES), ("nonsense", CORES), ("0 100000", CORES), ("nan 100000", CORES)])
def test_cores_are_those_of_the_quota(group, quota, expected):
    group("0::/\n", cpu_max=quota)
    assert machine.cores() == expected


def test_the_tightest_group_around_counts(group):
    group("0::/jobs/mine\n", jobs__mine__cpu_max="600000 100000", jobs__cpu_max="300000 100000",
          jobs__mine__memory_max="max", jobs__memory_max="3000000000")
    assert machine.cores() == 3 and machine.memory() == 3e9


def test_a_container_sees_its_own_group_as_the_root(group):
    group("0::/docker/abc\n", cpu_max="100000 100000", memory_max="2000000000\n")
    assert machine.cores() == 1 and machine.memory() == 2e9


def test_groups_of_the_first_version_have_folders_for_controllers(group):
    group("5:memory:/box\n4:cpu,cpuacct:/box\n1:name=systemd:/box\n0::/\n", **{
        "cpu__box__cpu.cfs_quota_us": "250000", "cpu__box__cpu.cfs_period_us": "50000",
        "memory__box__memory.limit_in_bytes": "1500000000"})
    assert machine.cores() == 5 and machine.memory() == 1.5e9


def test_no_limit_is_no_limit(group):
    group("4:cpu,cpuacct:/\n3:memory:/\n", **{"cpu__cpu.cfs_quota_us": "-1", "cpu__cpu.cfs_period_us": "100000",
                                              "memory__memory.limit_in_bytes": "9223372036854771712"})
    assert machine.cores() == CORES
    assert 0 < machine.memory() < 1e15 or math.isinf(machine.memory())


def test_the_name_of_a_group_need_not_be_text(group):
    group("0::/\n", cpu_max="100000 100000")
    with open(machine.OWN, "wb") as file:
        file.write(b"0::/\xff\n")
    assert machine.cores() == 1


def test_a_system_without_groups_has_all_its_cores(group):
    assert machine.cores() == CORES and machine.memory() > 0
