"""Store complex variables as two real ones, for file formats without complex numbers.

The variable ``image`` becomes ``image_real`` and ``image_imag``, with its attributes and two more: ``complex_of`` names
the variable and ``complex_part`` the part. `joined` restores the values bit for bit, NaN and infinities included.
Variables that are loaded lazily stay in the file until they are used.
"""
from __future__ import annotations

from typing import Any

import numpy as np
from xarray import Dataset, Variable
from xarray.backends import BackendArray
from xarray.core import indexing

OF, PART = "complex_of", "complex_part"
PARTS = ("real", "imag")


def split(dataset: Dataset) -> Dataset:
    """Return a dataset in which two real variables replace each complex one."""
    if not any(variable.dtype.kind == "c" for variable in dataset.variables.values()):
        return dataset
    variables, coords = {}, set(dataset.coords)
    for name, variable in dataset.variables.items():
        if variable.dtype.kind != "c":
            variables[name] = variable
            continue
        for part in PARTS:
            key = f"{name}_{part}"
            if key in dataset.variables:
                raise ValueError(f"the complex variable {name} would be written as {key}, and there is one already; "
                                 "rename it")
            variables[key] = Variable(variable.dims, np.ascontiguousarray(getattr(variable.values, part)),
                                         {**variable.attrs, OF: str(name), PART: part})
        coords |= {f"{name}_{part}" for part in PARTS if name in coords}
    return Dataset(variables, attrs=dataset.attrs).set_coords([name for name in variables if name in coords])


def joined(dataset: Dataset) -> Dataset:
    """Return the dataset that `split` was given; lazy variables stay lazy."""
    if not any(OF in variable.attrs for variable in dataset.variables.values()):
        return dataset
    variables, coords = {}, set(dataset.coords)
    for name, variable in dataset.variables.items():
        whole = variable.attrs.get(OF)
        if whole is None:
            variables[name] = variable
            continue
        if f"{whole}_{PARTS[0]}" != name:                              # the other part comes with the first
            if f"{whole}_{PARTS[0]}" not in dataset.variables:
                raise ValueError(f"{name} is a part of the complex {whole}, and {whole}_{PARTS[0]} is missing")
            continue
        variables[whole] = _whole(dataset, str(whole), variable)
        coords |= {whole} if name in coords else set()
    return Dataset(variables, attrs=dataset.attrs).set_coords([name for name in variables if name in coords])


def _whole(dataset: Dataset, name: str, real: Variable) -> Variable:
    """Return the complex variable of a real part and the imaginary part beside it."""
    other = f"{name}_{PARTS[1]}"
    if name in dataset.variables or other not in dataset.variables:
        raise ValueError(f"{name}_{PARTS[0]} is a part of the complex {name}, and "
                         f"{f'{name} is there too' if name in dataset.variables else f'{other} is missing'}")
    try:
        whole = together(real, dataset.variables[other])
    except ValueError as error:
        raise ValueError(f"the parts of the complex {name} do not fit together: {error}") from None
    whole.attrs = {key: value for key, value in real.attrs.items() if key not in (OF, PART)}
    return whole


def together(real: Variable, imag: Variable) -> Variable:
    """Return the complex variable of two parts, without attributes; it is lazy if the first part is lazy."""
    if real.dims != imag.dims or real.shape != imag.shape or real.dtype != imag.dtype or real.dtype.kind != "f":
        raise ValueError(f"they are {real.dtype} over {dict(real.sizes)} and {imag.dtype} over {dict(imag.sizes)}")
    whole = Variable(real.dims, indexing.LazilyIndexedArray(_Parts(real, imag)))
    return whole.load() if isinstance(real._data, np.ndarray) else whole


class _Parts(BackendArray):
    """Read complex values from the variables of their parts when they are indexed."""

    def __init__(self, real: Variable, imag: Variable):
        self.parts = real, imag
        self.shape: tuple[int, ...] = real.shape
        self.dtype = np.dtype(np.result_type(real.dtype, np.complex64))

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> np.ndarray:
        real, imag = (part[key].values for part in self.parts)
        values = np.empty(real.shape, self.dtype)
        values.real, values.imag = real, imag                          # a sum would turn infinities into NaN
        return values
