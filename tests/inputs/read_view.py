"""Read a recording of rerun by its own reader."""
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Entity:
    """Rows of an entity by component, and their times [s]; what has no time stands apart."""

    times: list = field(default_factory=list)
    rows: list = field(default_factory=list)
    fixed: list = field(default_factory=list)

    def column(self, name):
        """Values of a component whose name ends so, row by row."""
        return [value for row in self.fixed + self.rows for key, value in row.items() if key.endswith(name) and value]


def entities(path):
    """Entities of a recording by path, with rows in the order of time."""
    from rerun.chunk import RrdReader

    read = {}
    for chunk in RrdReader(path).stream().to_chunks():
        entity = read.setdefault(chunk.entity_path, Entity())
        rows = chunk.to_record_batch().to_pylist()
        if chunk.is_static:
            entity.fixed += rows
        else:
            entity.rows += rows
            entity.times += [row["time"].total_seconds() for row in rows]
    for entity in read.values():
        order = np.argsort(entity.times, kind="stable")
        entity.times, entity.rows = ([values[index] for index in order] for values in (entity.times, entity.rows))
    return read


def pixels(row):
    """The picture (rows, columns) of a row of a depth or segmentation image."""
    buffer = next(value for key, value in row.items() if key.endswith("Image:buffer"))[0]
    form = next(value for key, value in row.items() if key.endswith("Image:format"))[0]
    kind = {33: np.float16, 8: np.uint16}[form["channel_datatype"]]
    return np.frombuffer(bytes(buffer), kind).reshape(form["height"], form["width"])
