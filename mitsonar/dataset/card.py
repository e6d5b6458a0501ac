"""Card of a set: ``README.md`` as Hugging Face shows it, and ``croissant.json`` (Croissant 1.0), the same for machines.

The content of a set is counted. Title, licence, authors and homepage are given, as only its makers know them.
"""
from __future__ import annotations

import json
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from mitsonar.device.files import replacing
from mitsonar.io.scene_files import scenes
from mitsonar.sweep.balance import tally_said
from mitsonar.sweep.manifest import sha256

from .balance import balances

if TYPE_CHECKING:
    from .shards import Shard

WORDS = ("title", "licence", "authors", "homepage")
UNTOLD = {"title": "Simulated sonar images", "licence": "unknown", "authors": "unknown", "homepage": ""}
SPLITS = {"val": "validation"}     # names of subsets at Hugging Face, where they differ
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
MESH = ("mesh", "class", "licence", "author", "source", "sha256")
LIMITS = ("Every picture is computed, none is recorded. Sea floors, objects and water are models, and echoes follow "
          "from them. Test detectors that were trained on these pictures alone on recordings.")
# names of Croissant 1.0; a reader compares the list with its own
CONTEXT = {"@language": "en", "@vocab": "https://schema.org/", "sc": "https://schema.org/",
           "cr": "http://mlcommons.org/croissant/", "rai": "http://mlcommons.org/croissant/RAI/",
           "dct": "http://purl.org/dc/terms/", "conformsTo": "dct:conformsTo",
           "data": {"@id": "cr:data", "@type": "@json"}, "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
           "examples": {"@id": "cr:examples", "@type": "@json"},
           **{name: f"cr:{name}" for name in (
               "citeAs", "column", "equivalentProperty", "extract", "field", "fileObject", "fileProperty", "fileSet",
               "format", "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet",
               "references", "regex", "repeated", "replace", "samplingRate", "separator", "source", "subField",
               "transform")}}


def check_words(about: Mapping[str, Any]) -> None:
    """Raise `ValueError` for words that a card has no place for."""
    if unknown := [name for name in about if name not in WORDS]:
        raise ValueError(f"the card has no place for {unknown[0]}; give {', '.join(WORDS)}.")
    for name, text in about.items():
        if not isinstance(text, str) or not text.isprintable():
            raise ValueError(f"the {name} on the card is {text!r:.200}; give a text of one line.")


def write_card(shards: Sequence[Shard], folder: Path, about: Mapping[str, Any]) -> None:
    """Write the card of a set of shards."""
    told = {**UNTOLD, **about}
    pictures = [(shard, sample, picture) for shard in shards for sample in shard.samples for picture in sample.pictures]
    texts = {"README.md": _readme(shards, pictures, told),
             "croissant.json": json.dumps(_croissant(shards, folder, pictures, told), indent=1, ensure_ascii=False)}
    for name, text in texts.items():
        with replacing(folder / name) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")


def _readme(shards, pictures, told):
    subsets = Counter(shard.subset for shard, _, _ in pictures)
    classes = {subset: Counter() for subset in subsets}
    for shard, _, picture in pictures:
        classes[shard.subset].update({name: count for name, count in picture["counts"].items() if count})
    names = sorted(set().union(*classes.values()))
    bearing = {subset: sum(any(picture["counts"].values()) for shard, _, picture in pictures if shard.subset == subset)
               for subset in subsets}
    samples = list({id(sample): sample for _, sample, _ in pictures}.values())
    rows = [f"| {subset} | {count:,} | {bearing[subset]:,} | "
            + " | ".join(f"{classes[subset][name]:,}" for name in names) + " |" for subset, count in subsets.items()]
    size = next((word for limit, word in SIZES if len(pictures) < limit), "n>1M")
    files = "".join(f"  - split: {SPLITS.get(subset, subset)}\n    path: {subset}-*.tar\n" for subset in subsets)
    return "\n".join([
        "---", f"pretty_name: {json.dumps(told['title'], ensure_ascii=False)}", f"license: {_licence(told['licence'])}",
        "task_categories:", "- object-detection", "- image-segmentation", "tags:", "- sonar", "- synthetic",
        "- webdataset", f"size_categories:\n- {size}", "configs:", "- config_name: default", "  data_files:",
        files.rstrip("\n"), "---", "", f"# {told['title']}", "",
        f"{len(pictures):,} labelled pictures of {len(samples):,} simulated records, in {len(shards)} "
        f"shard{'s' * (len(shards) != 1)} of "
        f"{sum(shard.bytes for shard in shards) / 1e6:,.0f} MB. Licence: {told['licence']}. Authors: {told['authors']}."
        + (f" See {told['homepage']}." if told["homepage"] else ""), "",
        "| subset | pictures | with objects | " + " | ".join(map(_cell, names)) + " |",
        "|---" * (3 + len(names)) + "|", *rows, "",
        f"Objects are counted once in every picture. {_shared(pictures)}",
        "", "## Class balance", "", *_balanced(shards), "", "## What was drawn", "", *_drawn(samples),
        "", "## Meshes", "", *_meshes(pictures), "", "## Physics", "", *_physics(pictures), "", "## Limits", "",
        LIMITS, "", "## How to make it again", "",
        "Every record follows from its scene, parameters, seed and versions, which stand in its JSON and in "
        "`index.parquet`: on the same instruction set by the same bytes, on others with the same levels but for "
        "rounding. The first one is made again by", "", *_again(samples[0]), "", *_made(samples)])


def _balanced(shards):
    """Return what the plans asked for and what there is, and a line about negatives."""
    sweeps = balances(shards)
    rows = [f"| {_cell(verdict.what)} | {f'{verdict.asked:.1%}' if verdict.asked < 1 else f'{verdict.asked:,.0f}'} | "
            f"{verdict.got:,} of {verdict.total:,} | {'yes' if verdict.met else 'no'} |"
            for sweep in sweeps for verdict in sweep.verdicts]
    told = [f"- {_cell(sweep.folder.name)}: {_cell(tally_said(sweep.tally))}" for sweep in sweeps]
    return [*(["| asked for | at least | there are | met |", "|---|---|---|---|", *rows] if rows else
              ["The plans asked for no numbers of objects."]), "", *told]


def _licence(text):
    return text.lower() if re.fullmatch(r"(cc|mit|apache|bsd)[a-z0-9.-]*", text.lower()) else "other"


def _shared(pictures):
    """Return a sentence about seabeds in several subsets."""
    pairs = {(picture["seabed"], shard.subset) for shard, _, picture in pictures if picture["seabed"]}
    shared = sum(count > 1 for count in Counter(seabed for seabed, _ in pairs).values())
    if not shared:
        return "Subsets share no seabed."
    return f"{shared:,} seabed{'s are' if shared > 1 else ' is'} in several subsets: do not judge a detector by them."


def _cell(text):
    """Return a text for a cell of a table, or for a line: no control characters, and no HTML."""
    line = "".join(filter(str.isprintable, " ".join(text.split())))
    return line.replace("&", "&amp;").replace("<", "&lt;").replace("|", "\\|")


def _drawn(samples):
    """Return a table of the parameters that vary."""
    columns: dict[str, list] = {}
    for sample in samples:
        for name, value in sample.record["parameters"].items():
            columns.setdefault(name, []).append(value)
    rows = ["| parameter | values |", "|---|---|"]
    for name, values in columns.items():
        different = set(map(str, values))
        if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
            low, middle, high = np.percentile(values, [0, 50, 100])
            rows.append(f"| {_cell(name)} | {_number(low)} to {_number(high)}, median {_number(middle)} |"
                        if low < high else f"| {_cell(name)} | {_number(low)} |")
        else:
            # quoted, as a value may hold commas: a profile, or two numbers to draw between
            quoted = (f"`{value.replace('`', ' ')}`" for value in sorted(different)[:8])
            rows.append(f"| {_cell(name)} | {_cell(', '.join(quoted))}"
                        f"{', ...' * (len(different) > 8)} |")
    return rows if len(rows) > 2 else ["Nothing but the seed."]


def _number(value):
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e12 else f"{value:.4g}"


def meshes_in(pictures: Iterable[Mapping[str, Any]]) -> Counter[tuple[str, ...]]:
    """Return the number of pictures of every mesh: name, class, licence, author, source, SHA-256."""
    return Counter(key for picture in pictures for key in {tuple(mesh[name] for name in MESH)
                                                           for mesh in picture.get("meshes") or ()})


def _meshes(pictures):
    """Return a table of the meshes, with their licences."""
    known = meshes_in(picture for _, _, picture in pictures)
    if not known:
        return ["No scene of these pictures has a mesh from a file."]
    return ["| mesh | class | licence | author | source | pictures |", "|---|---|---|---|---|---|",
            *(f"| {' | '.join(map(_cell, mesh[:5]))} | {count:,} |" for mesh, count in sorted(known.items()))]


def _physics(pictures):
    kinds = Counter((picture.get("sonar"), picture.get("frequency"), picture.get("file")) for _, _, picture in pictures)
    return [f"- {count:,} picture{'s' * (count != 1)} of the sensor `{_cell(str(sonar)).replace('`', '')}`"
            + (f" at {frequency / 1e3:g} kHz" if frequency is not None else "")
            + f", scene `{_cell(str(scene)).replace('`', '')}`"
            for (sonar, frequency, scene), count in kinds.most_common()] + [
        "- rays through refracting water, the sonar equation with measured scattering laws, speckle, noise, and the "
        "receiver's own flaws, as the scene states them"]


def _again(sample):
    """Return the command that renders a sample's record again."""
    words = ["python3", "-m", "mitsonar", "render", str(sample.pictures[0].get("file"))]
    for name, value in sample.record["parameters"].items():
        words += ["-D", f"{name}={scenes.text(name, value)}"]
    command = shlex.join([*words, "--seed", str(sample.record["seed"]), "-o", "record.exr"])
    return ["```bash", "".join(filter(str.isprintable, " ".join(command.split()))), "```"]


def _made(samples):
    versions = Counter(json.dumps(sample.record["versions"], sort_keys=True) for sample in samples)
    sets = Counter(str(sample.record.get("instruction_set")) for sample in samples)
    return [*(f"- {count:,} records by "
              + _cell(", ".join(f"{name} {version}" for name, version in json.loads(text).items()))
              for text, count in versions.most_common()),
            *(f"- {count:,} on {_cell(name)}" for name, count in sets.most_common())]


def _croissant(shards, folder, pictures, told):
    """Return the set in Croissant's vocabulary: files with their hashes, and the columns of the index."""
    import pyarrow.parquet as parquet

    kinds = {"int64": "sc:Integer", "double": "sc:Float", "bool": "sc:Boolean"}
    schema = parquet.read_schema(folder / "index.parquet")
    # names of columns may hold anything, and identifiers in Croissant have no spaces
    fields = [{"@type": "cr:Field", "@id": (name := "pictures/" + quote(field.name, safe="")), "name": name,
               "dataType": kinds.get(str(field.type), "sc:Text"),
               "source": {"fileObject": {"@id": "index.parquet"}, "extract": {"column": field.name}}}
              for field in schema]
    files = [("index.parquet", "application/x-parquet"), *((shard.name, "application/x-tar") for shard in shards)]
    return {"@context": CONTEXT, "@type": "sc:Dataset", "conformsTo": "http://mlcommons.org/croissant/1.0",
            "name": told["title"], "description": f"{len(pictures):,} labelled pictures of a simulated sonar. {LIMITS}",
            "license": told["licence"], "url": told["homepage"] or "about:blank", "version": "1.0.0",
            "creator": {"@type": "sc:Organization", "name": told["authors"]},
            "isBasedOn": [{"@type": "sc:CreativeWork", "name": f"mesh {mesh}", "license": licence, "sha256": digest,
                           "creator": {"@type": "sc:Organization", "name": author}, "description": f"Source: {source}"}
                          for mesh, _, licence, author, source, digest in sorted(
                              meshes_in(picture for _, _, picture in pictures))],
            "distribution": [{"@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": name,
                              "encodingFormat": kind, "sha256": sha256(folder / name)} for name, kind in files],
            "recordSet": [{"@type": "cr:RecordSet", "@id": "pictures", "name": "pictures",
                           "key": {"@id": "pictures/key"}, "field": fields}]}

