"""Samples and shards: what a tar holds, whole shards with the same bytes, subsets without a common seabed, the card."""
import io
import json
import re
import tarfile
import warnings

import numpy as np
import pytest
from labelled_sidescan import labelled
from PIL import Image

from mitsonar.dataset import labels
from mitsonar.dataset.card import check_words
from mitsonar.dataset.shards import write_shards
from mitsonar.dataset.split import read_shares
from mitsonar.labels.rules import Labels
from mitsonar.labels.samples import SampleRules, write_sample
from mitsonar.sweep.manifest import sha256

pytest.importorskip("pyarrow")
RULES = SampleRules(labels=Labels(coco=True, yolo="boxes", masks=True, classes=["box", "wreck"]), arrays=("level",))
ENDINGS = {"png", "json", "txt", "npz", "instance.png", "class.png", "shadow.png", "bed_shadow.png"}


def members(path):
    with tarfile.open(path) as tar:
        return {member.name: tar.extractfile(member).read() for member in tar}


def sample(record=None, rules=RULES, key="000.7"):
    held = io.BytesIO()
    write_sample(record if record is not None else labelled(), held, key, rules)
    held.seek(0)
    with tarfile.open(fileobj=held) as tar:
        return {member.name: tar.extractfile(member).read() for member in tar}


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A folder as a sweep leaves it: twelve samples of six seabeds."""
    folder = tmp_path_factory.mktemp("sweep")
    with open(folder / "manifest.jsonl", "w", encoding="utf-8") as manifest:
        for index in range(12):
            record = labelled(20 + index, seabed=f"bed {index // 2}", seed=index, sonar="sidescan", frequency=400e3,
                              rectangles=[("highlight", "box.1", 1, 5, 12, 40, 45)])
            path = folder / f"{index:06}.tar"
            with open(path, "wb") as file:
                write_sample(record, file, path.stem, RULES)
            manifest.write(json.dumps(
                {"index": index, "output": path.name, "seed": index, "parameters": {
                    "bed": index // 3, "preset": "a", "rays": 15000,
                    "profile": ("0:1490", "0:1490, 9:1488")[index % 2]},
                 "inputs": "", "versions": {"mitsonar": "1"}, "status": "ok", "seconds": 1.5, "instruction_set": "AVX2",
                 "bytes": path.stat().st_size, "sha256": sha256(path)}) + "\n")
    return folder


def test_a_sample_holds_picture_masks_labels_and_arrays():
    held = sample()
    assert {name.partition(".")[2] for name in held} == ENDINGS and {name.partition(".")[0] for name in held} == {
        "000_7"}
    picture, about = np.array(Image.open(io.BytesIO(held["000_7.png"]))), json.loads(held["000_7.json"])
    assert picture.dtype == np.uint8 and picture.shape == (about["height"], about["width"]) == (60, 200)
    wreck, = (entry for entry in about["annotations"] if entry["category"] == "wreck")
    left, upper, wide, high = wreck["bbox"]
    classes = np.array(Image.open(io.BytesIO(held["000_7.class.png"])))
    assert (classes[upper:upper + high, left:left + wide] == 2).all() and (classes == 2).sum() == wide * high == 400
    assert about["counts"] == {"box": 1, "wreck": 1, "box shadow": 1, "wreck shadow": 1}
    level = np.load(io.BytesIO(held["000_7.npz"]))["level"]
    assert level.shape == picture.shape and (level[upper:upper + high, left:left + wide] == 95).all()
    assert sample() == held                            # no times, no owners


@pytest.mark.parametrize("text, value", [("30", 30), ("-2.5", -2.5), ("TRUE", True), ("towed", "towed"), ("", ""),
                                         ("0, 1", "0, 1"), ("nan", "nan"), ("1e999", "1e999"), ("[1]", "[1]")])
def test_parameters_of_a_sample_are_numbers_where_they_read_as_numbers(text, value):
    about = json.loads(sample(labelled(parameters={"x": text}))["000_7.json"])
    assert about["parameters"] == {"x": value} and type(about["parameters"]["x"]) is type(value)


def test_an_unpacked_sample_is_read_back_without_its_masks(tmp_path):
    for name, content in sample().items():
        (tmp_path / name).write_bytes(content)
    picture, = labels.read(tmp_path)
    assert picture.path.name == "000_7.png" and sorted(picture.classes) == ["0", "1", "2", "3"]
    held = np.array(Image.open(tmp_path / "000_7.class.png"))
    assert (picture.number[held > 0] > 0).all()


def test_tiles_are_pictures_of_their_own():
    rules = SampleRules(labels=Labels(masks=True, tile=(32, 100), classes=["box", "wreck"]), arrays=("level",))
    held = sample(rules=rules)
    assert {name.partition(".")[0] for name in held} == {f"000_7_{row}_{column}" for row in (0, 28)
                                                         for column in (0, 100)}
    whole = np.load(io.BytesIO(sample()["000_7.npz"]))["level"]
    np.testing.assert_array_equal(np.load(io.BytesIO(held["000_7_28_100.npz"]))["level"], whole[28:, 100:])


def test_shards_hold_every_sample_once_in_mixed_order_and_keep_seabeds_apart(sweep, tmp_path):
    import pyarrow.parquet as parquet

    shards = write_shards([sweep], tmp_path / "set", size=1_000_000, shares=read_shares("train=0.5,val=0.5"), seed=1,
                          about={"title": "Boxes", "licence": "CC-BY-4.0"})
    held = {shard.name: members(tmp_path / "set" / shard.name) for shard in shards}
    assert all((tmp_path / "set" / shard.name).stat().st_size == shard.bytes for shard in shards)
    assert sum(map(len, held.values())) == 12 * len(ENDINGS)
    for index in range(12):
        name = f"{index:06}"
        expected = members(sweep / f"{name}.tar")
        assert any(expected.items() <= content.items() for content in held.values())
    beds = {subset: {sample.seabed for shard in shards if shard.subset == subset for sample in shard.samples}
            for subset in ("train", "val")}
    assert not beds["train"] & beds["val"] and len(beds["train"] | beds["val"]) == 6
    order = [sample.path.stem for sample in shards[0].samples]
    assert order != sorted(order)
    table = parquet.read_table(tmp_path / "set" / "index.parquet").to_pylist()
    assert len(table) == 12 and {row["key"] for row in table if row["subset"] == "val"} == {
        sample.path.stem for shard in shards if shard.subset == "val" for sample in shard.samples}
    assert table[0]["count_box"] == 1 and table[0]["parameter_preset"] == "a" and table[0]["instruction_set"] == "AVX2"
    card = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert re.search(r"\npython3 -m mitsonar render \S+ -D bed=\d -D preset=a -D rays=15000 -D '?profile=[^-]+ --seed "
                     r"\d+ -o record\.exr\n", card)
    assert "license: cc-by-4.0" in card and "| train | 6 | 6 | 6 |" in card and "| bed | 0 to 3, median 1.5 |" in card
    assert "| profile | `0:1490`, `0:1490, 9:1488` |" in card               # values that hold commas are told apart
    assert "| rays | 15000 |" in card                      # not 1.5e+04
    assert "- 12 pictures of the sensor `sidescan` at 400 kHz, scene" in card
    croissant = json.loads((tmp_path / "set" / "croissant.json").read_text(encoding="utf-8"))
    assert {file["name"]: file["sha256"] for file in croissant["distribution"]}["train-00000.tar"] == sha256(
        tmp_path / "set" / "train-00000.tar")


def test_an_interrupted_set_goes_on_to_the_same_bytes(sweep, tmp_path):
    def bytes_of(folder):
        return {path.name: path.read_bytes() for path in folder.iterdir()}

    def stop(done, total):
        raise KeyboardInterrupt

    write_shards([sweep], tmp_path / "calm", shares=read_shares("train=0.5,val=0.5"))
    with pytest.raises(KeyboardInterrupt):
        write_shards([sweep], tmp_path / "set", shares=read_shares("train=0.5,val=0.5"), progress=stop)
    first = tmp_path / "set" / "train-00000.tar"
    before = first.stat().st_mtime_ns
    write_shards([sweep], tmp_path / "set", shares=read_shares("train=0.5,val=0.5"))
    assert first.stat().st_mtime_ns == before and bytes_of(tmp_path / "set") == bytes_of(tmp_path / "calm")
    with pytest.raises(ValueError, match="holds shards of other samples, or of another split"):
        write_shards([sweep], tmp_path / "set", shares=read_shares("train=0.5,val=0.5"), seed=2)


def test_a_split_by_a_parameter_keeps_its_values_apart(sweep, tmp_path):
    shards = write_shards([sweep], tmp_path / "set", shares=read_shares("train=0.75,test=0.25"), by="bed")
    beds = [{sample.record["parameters"]["bed"] for sample in shard.samples} for shard in shards]
    assert [len(bed) for bed in beds] == [3, 1] and not beds[0] & beds[1]
    with pytest.raises(ValueError, match="has no scene parameter colour; it was given bed, preset, profile, rays"):
        write_shards([sweep], tmp_path / "other", shares=read_shares("train=0.5,val=0.5"), by="colour")


def test_the_split_of_a_plan_names_shards(sweep, tmp_path):
    import shutil

    shutil.copytree(sweep, tmp_path / "sweep")
    path, homes = tmp_path / "sweep" / "manifest.jsonl", ["train", "train", "val", "test"]
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    path.write_text("".join(json.dumps({**line, "split": homes[line["parameters"]["bed"]]}) + "\n" for line in lines),
                    encoding="utf-8")
    with pytest.warns(UserWarning, match="1 seabed is in several"):        # of "bed 4", images 8 and 9
        shards = write_shards([tmp_path / "sweep"], tmp_path / "set")
    assert {shard.name: sorted(sample.record["index"] for sample in shard.samples) for shard in shards} == {
        "train-00000.tar": [0, 1, 2, 3, 4, 5], "val-00000.tar": [6, 7, 8], "test-00000.tar": [9, 10, 11]}


@pytest.mark.parametrize("spoil, said", [
    (lambda path: path.write_bytes(b""), "was altered after writing"),
    (lambda path: path.write_bytes(b"?" * path.stat().st_size), "was altered after writing"),
    (lambda path: path.unlink(), "which is not there")])
def test_spoilt_samples_are_refused(sweep, tmp_path, spoil, said):
    import shutil

    shutil.copytree(sweep, tmp_path / "sweep")
    spoil(tmp_path / "sweep" / "000003.tar")
    with pytest.raises((ValueError, FileNotFoundError), match=said):
        write_shards([tmp_path / "sweep"], tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_wrong_words_are_refused(sweep, tmp_path):
    with pytest.raises(ValueError, match=r"both hold a picture named 000000"):
        import shutil

        shutil.copytree(sweep, tmp_path / "copy")
        write_shards([sweep, tmp_path / "copy"], tmp_path / "set")
    with pytest.raises(ValueError, match="is no sweep with finished samples"):
        write_shards([tmp_path], tmp_path / "set")
    with pytest.raises(ValueError, match="give at least 1,000,000"):
        write_shards([sweep], tmp_path / "set", size=1000)
    with pytest.raises(ValueError, match="has no place for price"):
        check_words({"price": 1})
    with pytest.raises(ValueError, match="samples need the classes"):
        SampleRules(labels=Labels(masks=True))


def hostile(tmp_path, records=({},), **about):
    """A folder of samples that only claim to be some: lines of the manifest, and the JSON of their picture."""
    given = {"width": 2, "height": 2, "counts": {"box": 1}, "seabed": "a", **about}
    with open(tmp_path / "manifest.jsonl", "w", encoding="utf-8") as manifest:
        for index, changed in enumerate(records):
            path = tmp_path / f"{index}.tar"
            with tarfile.open(path, "w") as tar:
                for name, content in (("json", json.dumps(given).encode()), ("png", b"")):
                    info = tarfile.TarInfo(f"{index}.{name}")
                    info.size = len(content)
                    tar.addfile(info, io.BytesIO(content))
            record = {"index": index, "output": path.name, "parameters": {}, "seed": 0, "inputs": "",
                      "versions": {"mitsonar": "1"}, "status": "ok", "seconds": 1.0, "instruction_set": "AVX2",
                      "bytes": path.stat().st_size, "sha256": sha256(path), **changed}
            manifest.write(json.dumps(record) + "\n")
    return tmp_path


def test_samples_without_pictures_are_left_out_of_a_split(tmp_path):
    (tmp_path / "sweep").mkdir()
    folder = hostile(tmp_path / "sweep", [{}, {}, {}])
    lines = []
    for line in (folder / "manifest.jsonl").read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        if record["index"] == 0:
            with tarfile.open(folder / "0.tar", "w"):
                pass
            record |= {"bytes": (folder / "0.tar").stat().st_size, "sha256": sha256(folder / "0.tar")}
        lines.append(json.dumps(record))
    (folder / "manifest.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(ValueError, match="2 images with 1 different seabed"):
        write_shards([folder], tmp_path / "set", shares=read_shares("train=0.5,val=0.5"))
    assert len(write_shards([folder], tmp_path / "set")[0].samples) == 2
    (folder / "manifest.jsonl").write_text(lines[0] + "\n", encoding="utf-8")
    with pytest.raises(ValueError, match="hold no pictures"):
        write_shards([folder], tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("about", [{"negatives": [1]}, {"negatives": {"a": "b"}}, {"negative_class": 5},
                                   {"meshes": [{"mesh": "a"}]}, {"meshes": 5}, {"counts": []},
                                   {"counts": {"box": "many"}}, {"width": None},
                                   {"height": 1 << 40}, {"seabed": "\ud800"}, {"seabed": [1]}, {"sonar": [1]},
                                   {"file": {}}, {"frequency": [1]}, {"frequency": 1 << 2000}])
def test_a_picture_described_by_other_things_is_refused(tmp_path, about):
    (tmp_path / "sweep").mkdir()
    with pytest.raises(ValueError, match=r"0\.json does not describe a picture"):
        write_shards([hostile(tmp_path / "sweep", **about)], tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_file_that_is_longer_than_its_tar_is_refused(tmp_path):
    (tmp_path / "sweep").mkdir()
    folder, path = hostile(tmp_path / "sweep"), tmp_path / "sweep" / "0.tar"
    info = tarfile.TarInfo("0.json")
    info.type, info.size = tarfile.GNUTYPE_SPARSE, 0
    block = bytearray(info.tobuf(tarfile.GNU_FORMAT))
    block[483:495] = b"77777777777\0"                  # 8 GB, all of them holes
    block[148:156] = b"        "
    block[148:156] = f"{sum(block):06o}\0 ".encode()
    path.write_bytes(bytes(block) + bytes(2 * 512))
    record = json.loads((folder / "manifest.jsonl").read_text(encoding="utf-8"))
    told = {**record, "bytes": path.stat().st_size, "sha256": sha256(path)}
    (folder / "manifest.jsonl").write_text(json.dumps(told) + "\n", encoding="utf-8")
    with pytest.raises(ValueError, match="it holds more than files"):
        write_shards([folder], tmp_path / "set")


def test_odd_names_stay_in_their_cells(tmp_path):
    (tmp_path / "sweep").mkdir()
    folder = hostile(tmp_path / "sweep", [{"parameters": {"n": 1 << 70, "a|b": "x|y"}}, {}],
                     counts={"a|b\n# c \"'": 1})
    write_shards([folder], tmp_path / "set", about={"title": "a: [b", "licence": "CC: x"})
    card = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert 'pretty_name: "a: [b"\nlicense: other\n' in card and "| a\\|b # c \"' |" in card
    assert "| a\\|b | `x\\|y` |" in card
    for words in ({"title": "a\n---\nb"}, {"authors": 5}):
        with pytest.raises(ValueError, match="give a text of one line"):
            check_words(words)


def test_what_others_wrote_into_a_sample_stays_text_of_one_line_on_the_card(tmp_path):
    (tmp_path / "sweep").mkdir()
    odd = "x\n---\n# y <script>\x1b[31m`"
    folder = hostile(tmp_path / "sweep", [{"versions": {odd: odd}, "instruction_set": odd, "seed": 1 << 2000},
                                          {"parameters": {odd: odd}}], sonar=odd, file=odd, frequency=4e5)
    write_shards([folder], tmp_path / "set")
    card = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    lines, command = card.split("\n"), next(line for line in card.split("\n") if line.startswith("python3"))
    assert lines.count("---") == 2 and not any(line.startswith("# y") for line in lines) and "\x1b" not in card
    assert "<script>" not in card.replace(command, "") and "- 2 pictures of the sensor `x --- # y &lt;script>" in card


def test_the_card_counts_seabeds_in_several_subsets(tmp_path):
    for number, (seabed, said) in enumerate((("a", "1 seabed is in several subsets"), (None, "share no seabed"))):
        (folder := tmp_path / f"{number}").mkdir()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            write_shards([hostile(folder, [{"split": "train"}, {"split": "val"}], seabed=seabed)], folder / "set")
        assert said in (folder / "set" / "README.md").read_text(encoding="utf-8")


def test_the_card_says_what_was_asked_for_and_what_there_is(tmp_path, capfd):
    from mitsonar.cli import main as cli

    (tmp_path / "sweep").mkdir()
    wishes = {"images": {"box": 2}, "boxes": {"stone|": 0.9}, "empty": 0.5}
    hostile(tmp_path / "sweep", [{"balance": {"empty": 1}}, {"balance": wishes}], counts={"box": 1, "box shadow": 1},
            negatives={"stone|": 3, "tyre": 0})
    assert cli.main(["shards", str(tmp_path / "sweep"), "-o", str(tmp_path / "set")]) == 0
    err = capfd.readouterr().err
    assert "2 pictures, 0 without objects; boxes in pictures: box 2 in 2, stone| 6 in 2" in err
    assert "pictures without objects: 0 of 2, 0.0%; asked for 50.0%" in err and "pictures with box" not in err
    card = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert "| pictures with box | 2 | 2 of 2 | yes |" in card and "| boxes of stone\\| | 90.0% | 6 of 8 | no |" in card
    import pyarrow.parquet as parquet

    assert parquet.read_table(tmp_path / "set" / "index.parquet").to_pylist()[0]["negative_stone|"] == 3


def test_meshes_stand_on_the_card_and_those_without_licence_in_a_warning(tmp_path, capfd):
    import pyarrow.parquet as parquet

    from mitsonar.cli import main as cli

    (tmp_path / "sweep").mkdir()
    said = {"class": "mine", "author": "A|B", "source": "x", "sha256": "00"}
    meshes = [{"mesh": "manta", "licence": "CC0-1.0", **said}, {"mesh": "rock", "licence": "not stated", **said}]
    hostile(tmp_path / "sweep", [{}, {}], meshes=meshes)
    assert cli.main(["shards", str(tmp_path / "sweep"), "-o", str(tmp_path / "set")]) == 0
    assert "no licence is stated of 1 mesh: rock; state it in meshes.toml beside them" in capfd.readouterr().err
    card = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert "| manta | mine | CC0-1.0 | A\\|B | x | 2 |" in card and "| rock | mine | not stated |" in card
    assert parquet.read_table(tmp_path / "set" / "index.parquet").to_pylist()[0]["meshes"] == "manta, rock"
    croissant = json.loads((tmp_path / "set" / "croissant.json").read_text(encoding="utf-8"))
    assert {work["license"] for work in croissant["isBasedOn"]} == {"CC0-1.0", "not stated"}


def test_a_manifest_with_an_impossible_balance_is_refused(tmp_path):
    (tmp_path / "sweep").mkdir()
    with pytest.raises(ValueError, match="balance that no plan can have: balance.full is unknown"):
        write_shards([hostile(tmp_path / "sweep", [{"balance": {"full": 1}}])], tmp_path / "set")


def test_columns_of_like_names_have_identifiers_of_their_own(tmp_path):
    (tmp_path / "sweep").mkdir()
    counts = {"a b": 1, "a_b": 2, "a%20b": 3, "à/#?b": 4}
    write_shards([hostile(tmp_path / "sweep", counts=counts)], tmp_path / "set")
    fields = json.loads((tmp_path / "set" / "croissant.json").read_text(encoding="utf-8"))["recordSet"][0]["field"]
    assert len({field["@id"] for field in fields}) == len(fields)
    assert {field["source"]["extract"]["column"] for field in fields} >= {f"count_{name}" for name in counts}
    assert all(re.fullmatch(r"pictures/[\w.~%-]+", field["@id"], re.ASCII) for field in fields)


def test_what_a_killed_run_left_is_removed(sweep, tmp_path):
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "..shards.3fffffff-00000000").write_bytes(b"half")
    write_shards([sweep], tmp_path / "set")
    (tmp_path / "set" / "train-00000.tar").rename(tmp_path / "set" / ".train-00000.3fffffff-00000000.tar")
    write_shards([sweep], tmp_path / "set")
    assert {path.name for path in (tmp_path / "set").iterdir()} == {".shards", "README.md", "croissant.json",
                                                                    "index.parquet", "train-00000.tar"}
