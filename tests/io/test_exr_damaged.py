"""OpenEXR files of ours that were damaged: they are a dataset, or one sentence says why not, in little memory."""
import copy
import json
import tracemalloc

import numpy as np
import OpenEXR
import pytest
import xarray
from mesh_files import damaged
from synthetic_sidescan import sidescan

from mitsonar.io.records import exr
from mitsonar.io.records.records import SonarImage


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "a.exr"
    exr.write(sidescan(4, 6), path)
    return path.read_bytes(), json.loads(OpenEXR.File(str(path), header_only=True).header(0)[exr.CONFIG])


@pytest.fixture
def read(tmp_path):
    """Read some bytes as a file: a dataset, or one sentence."""
    def read(content):
        path = tmp_path / "a.exr"
        path.write_bytes(content)
        tracemalloc.start()
        try:
            found = exr.read(path)
            assert isinstance(found, xarray.Dataset)
        except ValueError as error:
            found = str(error)
            assert found.startswith(f"cannot read {path}: ") and "\n" not in found and len(found) < 500
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert peak < 200e6
        return found
    return read


@pytest.fixture
def reconfigured(tmp_path, read):
    """The same pixels under another configuration."""
    def reconfigured(config):
        data = sidescan(4, 6)
        parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage, exr.CONFIG: json.dumps(config)},
                              {"Y": np.zeros((4, 12), np.float32)}, "image"),
                 OpenEXR.Part({"type": OpenEXR.scanlineimage, "displayWindow": (np.zeros(2, np.int32),
                                                                                np.array([11, 3], np.int32))},
                              exr._encode(data, exr._layout(data))[0], "data")]
        OpenEXR.File(parts).write(str(tmp_path / "b.exr"))
        return read((tmp_path / "b.exr").read_bytes())
    return reconfigured


def leaves(item, path=()):
    """Where there is something within nested lists and dictionaries."""
    pairs = item.items() if isinstance(item, dict) else enumerate(item) if isinstance(item, list) else ()
    for key, value in pairs:
        yield *path, key
        yield from leaves(value, (*path, key))


def changed(config, path, value):
    config = copy.deepcopy(config)
    at = config
    for key in path[:-1]:
        at = at[key]
    if value is KeyError:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return config


def test_the_same_configuration_reads(reconfigured, whole):
    assert reconfigured(whole[1]).identical(sidescan(4, 6))


def test_damaged_bytes(read, whole, rng):
    kinds = {type(read(damaged(whole[0], rng))) for _ in range(150)}
    assert kinds == {str, SonarImage}


def test_files_cut_anywhere(read, whole):
    for end in range(0, len(whole[0]), 97):
        assert isinstance(read(whole[0][:end]), str)


@pytest.mark.parametrize("value", [KeyError, None, -1, 3, 1e300, "x", "<U500000000", "O", [], [[]], {}, ["side"] * 50,
                                   {"mitsonar:float": "x"}], ids=str)
def test_configurations_that_say_something_else(reconfigured, whole, value, rng):
    places = list(leaves({key: item for key, item in whole[1].items() if key != "attrs"}))
    for place in rng.choice(len(places), min(12, len(places)), replace=False):
        reconfigured(changed(whole[1], places[place], value))


@pytest.mark.parametrize("place, value, words", [
    (("coords", "side", "dtype"), "<U500000000", "is damaged, or belongs to other pixels"),
    (("variables", "level", "dtype"), "|O", "is damaged, or belongs to other pixels"),
    (("layers",), ["side"] * 60, "is damaged, or belongs to other pixels"),
    (("sizes", "ping"), 10**12, "is damaged, or belongs to other pixels"),
    (("variables",), KeyError, "is damaged, or belongs to other pixels"),
    (("format",), KeyError, "is damaged; write it again"),
    (("format",), 10**300, "its format 10000000000000000000 is newer than 1"),
    ((), [1], "is damaged; write it again"),
], ids=["text without end", "objects", "layers", "pings", "no variables", "no format", "newer", "list"])
def test_what_is_said_of_configurations(reconfigured, whole, place, value, words):
    assert words in reconfigured(changed(whole[1], place, value) if place else value)


def test_attributes_alone(tmp_path, whole):
    path = str(tmp_path / "a.exr")
    for config in ({**whole[1], "attrs": 3}, {"format": 1}):
        OpenEXR.File({"type": OpenEXR.scanlineimage, exr.CONFIG: json.dumps(config)},
                     {"Y": np.zeros((1, 1), np.float32)}).write(path)
        with pytest.raises(ValueError, match="its attribute mitsonar:config is damaged; write it again"):
            exr.attributes(path)


def test_windows_that_claim_more_than_the_file_holds(read, whole):
    window = np.array([0, 0, 5, 3], "<i4").tobytes()
    assert whole[0].count(window) == 1
    said = read(whole[0].replace(window, np.array([0, 0, 99999, 99999], "<i4").tobytes()))
    assert "it claims 2.4e+11 bytes of pixels" in said
