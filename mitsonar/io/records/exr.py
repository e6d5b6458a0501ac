"""Write sonar images as OpenEXR files, and read them back.

Part ``image`` holds one channel ``Y``, the levels as a waterfall: one row per ping; in a sidescan, port is mirrored to
the left of starboard. Part ``data`` holds every variable over the same bins. With the dimensions named

    rows x layers x column        (ping) x (side) x range        (ping, beam) x () x range
                                  (along_track) x (bank) x across_track

the last dimension runs along a row. A dimension whose coordinate is text ("port", "starboard") becomes the front of the
channel name (``port.level``, ``starboard.label.id``), as does the dimension ``bank`` of a focused image
(``bank0.image.real``). The other dimensions are stacked as rows.

Channels hold float32, float16 and uint32. Integers up to 32 bits become uint32. Complex numbers become two channels,
``image.real`` and ``image.imag``. A float64 becomes the nearest float32 in the channel of its name and, in ``x.rest``,
the difference of the bit patterns of both as integers. All values survive bit for bit, NaN and infinities included.

Smaller variables, all coordinates (as shortest exact decimals), attributes, units and original types are strict JSON in
the attribute ``mitsonar:config`` of part ``image``; ``{"mitsonar:float": "nan"}`` replaces numbers that JSON lacks. The
attributes ``mitsonar:sonar``, ``mitsonar:seed``, ``mitsonar:units.Y``, ... repeat the important ones for people. The
same dataset always gives the same bytes, at any time and on any machine.
"""
import json
import math
import os
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import OpenEXR
import xarray as xr

from mitsonar.device.files import FilePath, check_readable, replacing
from mitsonar.device.machine import cores

from .records import SonarImage, check_numbers, with_present_names

REAL, IMAG, REST = ".real", ".imag", ".rest"
STORED = {"f4": np.float32, "f2": np.float16, "b1": np.uint32, **{f"u{n}": np.uint32 for n in (1, 2, 4)},
          **{f"i{n}": np.int32 for n in (1, 2, 4)}}


def suffixes(kind: np.dtype) -> tuple[str, ...]:
    """Return the suffixes of the channels that hold a type, or none if channels cannot hold it."""
    if kind.str[1:] == "c8":
        return REAL, IMAG
    if kind.str[1:] == "f8":
        return "", REST
    return ("",) if kind.str[1:] in STORED else ()


def parts_of(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return the channels of values by their `suffixes`; ``name`` appears in the error if channels cannot hold them."""
    kind = values.dtype
    if not suffixes(kind):
        raise ValueError(f"cannot write {name} as EXR: its type is {kind}, and channels hold float16, float32, "
                         "float64, complex64 and integers of up to 32 bits; cast it with .astype.")
    if kind.kind == "c":
        return {REAL: np.real(values), IMAG: np.imag(values)}
    if kind.str[1:] == "f8":
        return _near_and_rest(name, values)
    stored = STORED[kind.str[1:]]
    values = values.astype(stored, copy=False)
    return {"": values.view(np.uint32) if stored is np.int32 else values}


def whole(parts: Mapping[str, np.ndarray], kind: np.dtype) -> np.ndarray:
    """Return the values of a type from the channels that `parts_of` made."""
    if kind.str[1:] == "c8":
        values = np.empty(parts[REAL].shape, kind)
        values.real, values.imag = parts[REAL], parts[IMAG]
        return values
    if kind.str[1:] == "f8":
        near = parts[""].astype(np.float64).view(np.int64)
        return (near + parts[REST].view(np.int32)).view(np.float64).astype(kind, copy=False)
    values = parts[""]
    return (values.view(np.int32) if kind.kind == "i" else values).astype(kind)


def _near_and_rest(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return the nearest float32, and the remaining difference of the bit patterns."""
    values = np.ascontiguousarray(values, np.float64)
    with np.errstate(over="ignore"):
        near = values.astype(np.float32)
    rest = values.view(np.int64) - near.astype(np.float64).view(np.int64)
    if np.any(np.abs(rest) >= 1 << 31):
        raise ValueError(f"cannot write {name} as EXR: some of it is no number near any float32; write it as netCDF.")
    return {"": near, REST: rest.astype(np.int32).view(np.uint32)}


CONFIG = "mitsonar:config"
FORMAT = 1
MOST_UNPACKED = 1100               # times the size of the file; zlib packs zeros to a 1032nd
LONGEST_NAME = 255                 # bytes of a channel's name
MOST_TEXT = 50_000_000             # bytes that a variable of text may be padded to
DAMAGE = (KeyError, TypeError, ValueError, IndexError, AttributeError, ArithmeticError, RuntimeError, MemoryError)
CHANNELS = {"label": "label.id", "class": "class.id"}  # variables whose channel has another name
LAYERS = ("bank",)                 # dimensions that are layers without a coordinate that names them
SHOWN = {"sonar": "", "seed": "", "sound_speed": " m/s", "frequency": " Hz", "source_level_db": " dB re 1 µPa @ 1 m",
         "absorption_db": " dB/m", "bin_width": " m", "crs": ""}  # attributes repeated in words, with their units


def write(dataset: xr.Dataset, path: FilePath) -> None:
    """Write a sonar dataset as one OpenEXR file; an existing file is replaced once the new one is complete.

    Files are ZIP-compressed: noisy float32 shrinks to about 3/4, labels and flags to almost nothing.

    Parameters
    ----------
    dataset : xarray.Dataset
        Variables over (ping, ..., range), as made by ``mitsonar.render``. The picture is the variable ``level``, else
        the first of floating type. Attributes must be plain JSON values (tuples come back as lists).
    path : str or path
        File to write; its folder must exist.

    Raises
    ------
    FileNotFoundError, ValueError, PermissionError
        If ``path`` cannot be written (see `mitsonar.device.files.check_writable`).
    ValueError
        If the dataset has no image, or a type or attribute that the file cannot hold.
    OSError
        If the disk fills up; nothing is left behind.
    """
    layout = _layout(dataset)
    channels, config = _encode(dataset, layout)
    picture = _picture(dataset, layout)
    shown = dataset[layout["picture"]].attrs
    height, width = picture.shape
    # Parts of different width must agree on the display window, else the library refuses the second.
    window = (np.zeros(2, np.int32), np.array([width - 1, height - 1], np.int32))
    common = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": window}
    words = {f"mitsonar:{name}": f"{dataset.attrs[name]}{unit}" for name, unit in SHOWN.items()
             if dataset.attrs.get(name) is not None}
    versions = dataset.attrs.get("versions", {})
    units = {f"mitsonar:units.{_channel(name)}": str(variable.attrs["units"])
             for name, variable in dataset.data_vars.items() if "units" in variable.attrs}
    image = {**common, **words, "mitsonar:version": str(versions.get("mitsonar", "unknown")),
             "mitsonar:Y": str(shown.get("long_name", layout["picture"])),
             "mitsonar:units.Y": str(shown.get("units", "")), CONFIG: config}
    parts = [OpenEXR.Part(image, {"Y": picture}, "image"), OpenEXR.Part({**common, **units}, channels, "data")]
    with replacing(path) as temporary:
        # A Python stream reports a full disk as OSError with its errno; with a path, the library gives only words.
        with open(temporary, "wb") as stream:
            OpenEXR.File(parts, num_threads=cores()).write(stream)
        _config(temporary, path)


def read(path: FilePath) -> SonarImage:
    """Read a dataset written by `write`, identical in dimensions, coordinates, types, attributes and values.

    Parameters
    ----------
    path : str or path
        OpenEXR file of mitsonar.

    Returns
    -------
    SonarImage
        An `xarray.Dataset`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is not OpenEXR, is cut short, or was not written by `write`.
    """
    config = _config_of(path)
    _check_claims(path)
    try:
        file = OpenEXR.File(str(path), separate_channels=True, num_threads=cores())
        if len(file.parts) < 2:  # the library drops a part whose pixels it cannot decode
            raise ValueError(f"cannot read {path}: its pixels are cut short or damaged; write it again.")
        pixels = {name: channel.pixels for name, channel in file.channels(1).items()}
    except RuntimeError as error:
        raise ValueError(f"cannot read {path}: its pixels are cut short or damaged; write it again.") from error
    try:
        image = _decode(config, pixels)
    except DAMAGE as error:
        raise ValueError(f"cannot read {path}: its attribute {CONFIG} is damaged, or belongs to other pixels; write it "
                         "again.") from error
    check_numbers(image, path)
    return image


def _decode(config, channels):
    sizes, layers = config["sizes"], config["layers"]
    coords = {name: _variable(entry, sizes) for name, entry in config["coords"].items()}
    variables = {}
    for name, entry in config["variables"].items():
        if "values" in entry:
            variables[name] = _variable(entry, sizes)
            continue
        own = [layer for layer in layers if layer in entry["dims"]]
        if math.prod(sizes[layer] for layer in own) > len(channels):
            raise ValueError(f"{name} has more layers than there are channels")
        prefixes = _prefixes([_layer_names(layer, coords, sizes) for layer in own])
        order = [*own, *config["rows"], config["column"]]
        kind = _kind(entry, 1)
        if not suffixes(kind):
            raise ValueError(f"{name} is of a type that channels do not hold")
        parts = {suffix: np.stack([channels[prefix + _channel(name) + suffix] for prefix in prefixes])
                 for suffix in suffixes(kind)}
        values = whole(parts, kind).reshape([sizes[dim] for dim in order])
        variables[name] = xr.Variable(order, values, entry["attrs"]).transpose(*entry["dims"])
    return with_present_names(SonarImage(variables, coords, config["attrs"]))


def attributes(path: FilePath) -> dict[str, Any]:
    """Read the attributes of a dataset written by `write`, without its pixels.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    dict
        Equal to ``read(path).attrs``.

    Raises
    ------
    FileNotFoundError, ValueError
        As for `read`.
    """
    attrs = _config_of(path).get("attrs")
    if not isinstance(attrs, dict):
        raise ValueError(f"cannot read {path}: its attribute {CONFIG} is damaged; write it again.")
    return attrs


def outline(path: FilePath) -> SonarImage:
    """Read the coordinates and attributes of a dataset written by `write`, without its pixels.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    SonarImage
        Has the picture (``level``) as zeros that take no memory, and no other variable.

    Raises
    ------
    FileNotFoundError, ValueError
        As for `read`.
    """
    config = _config_of(path)
    try:
        sizes, entry = config["sizes"], config["variables"][config["picture"]]
        picture = np.broadcast_to(np.zeros((), _kind(entry, 1)), [sizes[dim] for dim in entry["dims"]])
        coords = {name: _variable(coord, sizes) for name, coord in config["coords"].items()}
        return SonarImage({config["picture"]: (entry["dims"], picture)}, coords, config["attrs"])
    except DAMAGE as error:
        raise ValueError(f"cannot read {path}: its attribute {CONFIG} is damaged; write it again.") from error


def _layout(dataset):
    """Return the picture's name and the dimensions of its rows, layers and column."""
    ranked = [name for name, variable in dataset.data_vars.items() if variable.ndim >= 2 and variable.dtype.kind == "f"]
    if not ranked:
        raise ValueError(f"cannot write the dataset as EXR: none of its variables ({', '.join(dataset.data_vars)}) is "
                         "a floating-point image over at least two dimensions; write it as netCDF.")
    picture = "level" if "level" in ranked else ranked[0]
    *front, column = dataset[picture].dims
    named = [dim for dim in dataset.dims if dim in LAYERS or dim in dataset.coords and dataset[dim].dtype.kind == "U"]
    layers = [dim for dim in front if dim in named]
    rows = [dim for dim in front if dim not in layers]
    layers += [dim for dim in named if dim not in layers]              # which only other variables have
    if not dataset[picture].size or not rows:
        raise ValueError(f"cannot write the dataset as EXR: {picture} has the shape {dict(dataset[picture].sizes)}; "
                         "it needs at least one row and one bin.")
    return {"picture": picture, "rows": rows, "layers": layers, "column": column}


def _encode(dataset, layout):
    """Return the channels of a dataset, and the JSON that `_decode` needs to restore it."""
    rows, layers, column = layout["rows"], layout["layers"], layout["column"]
    channels, variables = {}, {}
    for name, variable in dataset.data_vars.items():
        entry = {"dims": list(variable.dims), "dtype": variable.dtype.str, "attrs": _strict(variable.attrs, name)}
        if not {*rows, column} <= set(variable.dims) <= {*rows, *layers, column}:
            entry["values"] = _values(name, variable.values)
        else:
            own = [layer for layer in layers if layer in variable.dims]
            prefixes = _prefixes([_layer_names(layer, dataset.coords, dataset.sizes) for layer in own])
            parts = parts_of(str(name), variable.transpose(*own, *rows, column).values)
            for suffix, values in parts.items():
                for prefix, pixels in zip(prefixes, values.reshape(len(prefixes), -1, values.shape[-1]), strict=True):
                    channel = prefix + _channel(name) + suffix
                    if len(channel.encode()) > LONGEST_NAME:
                        raise ValueError(f"cannot write the dataset as EXR: the channel {channel[:60]}... would have a "
                                         f"name of {len(channel.encode())} bytes, and EXR cuts names beyond "
                                         f"{LONGEST_NAME}; shorten the names or write it as netCDF.")
                    # the library writes arrays that are not contiguous wrongly, without an error
                    channels[channel] = np.ascontiguousarray(pixels)
        variables[name] = entry
    coords = {name: {"dims": list(coord.dims), "dtype": coord.dtype.str, "attrs": _strict(coord.attrs, name),
                     "values": _values(name, coord.values)} for name, coord in dataset.coords.items()}
    config = {"format": FORMAT, "sizes": {name: int(size) for name, size in dataset.sizes.items()}, **layout,
              "attrs": _strict(dataset.attrs, "the dataset"), "coords": coords, "variables": variables}
    return channels, json.dumps(config, ensure_ascii=False, allow_nan=False)


def _picture(dataset, layout):
    """Return the picture with its layers side by side; port is mirrored, so that the track is in the middle."""
    name = layout["picture"]
    layers = [layer for layer in layout["layers"] if layer in dataset[name].dims]
    image = dataset[name].transpose(*layers, *layout["rows"], layout["column"]).values
    image = image.reshape(-1, int(np.prod([dataset.sizes[row] for row in layout["rows"]])), image.shape[-1])
    if [list(dataset[layer].values) for layer in layers] == [["port", "starboard"]]:
        image = [image[0, :, ::-1], image[1]]
    return np.ascontiguousarray(np.concatenate(list(image), axis=1), np.float32)


def _layer_names(dim, coords, sizes):
    """Return the names of the layers along a dimension: the text of its coordinate, or bank0, bank1, ..."""
    if dim in coords and coords[dim].dtype.kind == "U":
        return coords[dim].values
    return [f"{dim}{number}" for number in range(sizes[dim])]


def _channel(variable):
    return CHANNELS.get(str(variable), str(variable))


def _prefixes(names):
    """Return the channel prefixes of the combinations of layer names, the last layer fastest: 'port.', 'starboard.'."""
    prefixes = [""]
    for layer in names:
        prefixes = [f"{prefix}{name}." for prefix in prefixes for name in layer]
    return prefixes


def _values(name, array):
    """Return an array as one list of numbers or text, the last dimension fastest."""
    if array.dtype.kind in "mM":
        array = array.view(np.int64)
    if array.dtype.kind not in "fiubU":
        raise ValueError(f"cannot write {name} as EXR: its type is {array.dtype}; use numbers or text.")
    values = array.ravel().tolist()
    return values if array.dtype.kind != "f" or np.isfinite(array).all() else _strict(values, name)


def _variable(entry, sizes):
    kind = _kind(entry, len(entry["values"]), max((len(text) for text in entry["values"] if isinstance(text, str)),
                                                  default=0))
    values = np.array(entry["values"], np.int64 if kind.kind in "mM" else kind).view(kind)
    return xr.Variable(entry["dims"], values.reshape([sizes[dim] for dim in entry["dims"]]), entry["attrs"])


def _kind(entry, count, longest=0):
    """Return the type of a variable; refuse text padded far beyond the longest value, which would fill the memory."""
    if not re.fullmatch(r"[<>|=][fiubcUmM]\d*(\[\w+\])?", entry["dtype"]):
        raise ValueError(f"{entry['dtype']} is no type of ours")
    kind = np.dtype(entry["dtype"])
    if kind.itemsize * count > max(MOST_TEXT, 4 * longest * count) and kind.kind == "U":
        raise ValueError(f"{count} texts of {kind.itemsize} bytes")
    return kind


def _strict(value, where):
    """Return plain JSON values; an error names the attribute that cannot be one."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, dict):
        odd = [key for key in value if not isinstance(key, str)]
        if odd:
            raise ValueError(f"cannot write {where} as EXR: its key {odd[0]!r} is not text; use text for keys.")
        return {key: _strict(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(item, f"{where}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, float) and not np.isfinite(value):
        return {"mitsonar:float": str(value)}
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise ValueError(f"cannot write {where} as EXR: it is a {type(value).__name__}; use plain JSON values.")


def header(path: FilePath) -> dict[str, Any]:
    """Read the header of the first part of any OpenEXR file.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    dict
        Header as the library returns it, with ``channels`` and ``dataWindow``.

    Raises
    ------
    ValueError
        If the file is not OpenEXR, or is cut short.
    """
    try:
        return OpenEXR.File(str(path), header_only=True).header(0)
    except DAMAGE as error:
        raise ValueError("it is not an OpenEXR file, or is cut short") from error


def _check_claims(path):
    """Refuse a file whose header claims more pixels than its bytes can hold, before memory is allocated."""
    size, claimed = os.path.getsize(path), 0
    try:
        file = OpenEXR.File(str(path), header_only=True)
        for part in range(len(file.parts)):
            (west, north), (east, south) = (map(int, corner) for corner in file.header(part)["dataWindow"])
            claimed += (east - west + 1) * (south - north + 1) * len(file.header(part)["channels"]) * 2
    except DAMAGE as error:
        raise ValueError(f"cannot read {path}: its header is damaged; write it again.") from error
    if claimed > MOST_UNPACKED * size:
        raise ValueError(f"cannot read {path}: it claims {claimed:.2g} bytes of pixels, and has {size} bytes; write it "
                         "again.")


def _config_of(path):
    """Read and check the header of a file that exists."""
    check_readable(path, wanted="an OpenEXR file")
    return _config(path, path)


def _config(path, name):
    """Read and check the header of a file of mitsonar; ``name`` is the file's name in errors."""
    remedy = "give an EXR file that mitsonar wrote"
    try:
        text = header(path).get(CONFIG)
    except ValueError as error:
        raise ValueError(f"cannot read {name}: {error}; {remedy}.") from error
    if text is None:
        raise ValueError(f"cannot read {name}: this OpenEXR file has no attribute {CONFIG}; {remedy}.")
    try:
        config = json.loads(text, object_hook=_lenient)
        known = config["format"] <= FORMAT
    except DAMAGE as error:
        raise ValueError(f"cannot read {name}: its attribute {CONFIG} is damaged; write it again.") from error
    if not known:
        raise ValueError(f"cannot read {name}: its format {str(config['format'])[:20]} is newer than {FORMAT}, the "
                         "newest known here; update mitsonar.")
    return config


def _lenient(item):
    return float(item["mitsonar:float"]) if list(item) == ["mitsonar:float"] else item
