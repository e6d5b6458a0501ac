"""Index of a set of shards: a Parquet table with a row for every picture."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mitsonar.device.extras import MissingExtra
from mitsonar.device.files import replacing

if TYPE_CHECKING:
    from .shards import Shard


def write_index(shards: Sequence[Shard], path: Path) -> None:
    """Write the index of shards.

    Columns: ``key``, ``shard``, ``subset``, ``width``, ``height``, ``seed``, ``seabed``, ``scene`` (of a plan of
    several), ``parameter_NAME``, ``count_CATEGORY``, ``negative_CLASS``, ``meshes``, ``seconds`` and
    ``sample_sha256`` of the whole record, ``instruction_set``.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as parquet
    except ImportError:
        raise MissingExtra("PyArrow, which writes the index of a set, is not installed", "shards") from None
    rows = [{"key": picture["key"], "shard": shard.name, "subset": shard.subset, "width": picture["width"],
             "height": picture["height"], "seed": sample.record["seed"], "seabed": picture.get("seabed"),
             **({"scene": sample.record["scene"]} if "scene" in sample.record else {}),
             **{f"parameter_{name}": value for name, value in sample.record["parameters"].items()},
             **{f"count_{name}": count for name, count in picture["counts"].items()},
             **{f"negative_{name}": count for name, count in (picture.get("negatives") or {}).items()},
             "meshes": ", ".join(dict.fromkeys(mesh["mesh"] for mesh in picture.get("meshes") or ())),
             "seconds": sample.record["seconds"], "sample_sha256": sample.record["sha256"],
             "instruction_set": sample.record.get("instruction_set")}
            for shard in shards for sample in shard.samples for picture in sample.pictures]
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = pa.table({name: _column([row.get(name) for row in rows]) for name in names})
    with replacing(path) as temporary:
        parquet.write_table(table, temporary, compression="zstd")


def _column(values):
    """Return values of one kind; of several kinds as text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int} and any(abs(value) >= 1 << 63 for value in values if value is not None):
        kinds = {int, float} if max(abs(value) for value in values if value is not None) < 1e300 else {int, str}
    if kinds <= {int, float} or len(kinds) == 1 and kinds <= {bool, str}:
        return [float(value) if float in kinds and value is not None else value for value in values]
    return [None if value is None else str(value) for value in values]
