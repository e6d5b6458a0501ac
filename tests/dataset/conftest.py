"""A stand-in for PyTorch, which the tests do without."""
import importlib
import sys
import types

import numpy as np
import pytest


@pytest.fixture
def torch(monkeypatch):
    """As much of PyTorch as a data set of pictures touches, arrays for tensors."""
    fake = types.ModuleType("torch")
    fake.as_tensor, fake.utils = np.asarray, types.ModuleType("torch.utils")
    fake.utils.data = types.ModuleType("torch.utils.data")
    fake.utils.data.Dataset = type("Dataset", (), {})
    for name, module in (("torch", fake), ("torch.utils", fake.utils), ("torch.utils.data", fake.utils.data)):
        monkeypatch.setitem(sys.modules, name, module)
    # whether the real one is here or not, the class is made of the fake one, and forgotten after the test
    monkeypatch.delitem(sys.modules, "mitsonar.dataset.torch_images", raising=False)
    yield fake
    sys.modules.pop("mitsonar.dataset.torch_images", None)
    vars(importlib.import_module("mitsonar.dataset")).pop("torch_images", None)
