"""Kernels run on any backend of Dr.Jit: what only LLVM can do stands beside a way for the others.

Read from the sources by AST. Three things work with LLVM alone: sums without atomic operations, because one work block
owns what it adds to (`ReduceMode.NoConflicts`, `Expand`, permutations by `block_mkperm`); arrays of NumPy that share
their memory with the device's; and Dr.Jit's namespace of one backend, instead of that of an array (`arrays_of`).
"""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for room in ("mitsonar", "plugins") for path in (ROOT / room).rglob("*.py"))
OWNED = "NoConflicts", "Expand", "block_mkperm"
#: files that ask for the backend; each has a way for every other backend, or refuses it in a sentence
ASK = {"mitsonar/device/arrays.py", "mitsonar/echoes/sums/energy_sums.py", "mitsonar/scene/geometry.py",
       "mitsonar/scene/loading.py", "mitsonar/scene/queries/height_field.py",
       "mitsonar/signal/accumulation.py", "mitsonar/signal/beam_grid/spreading.py",
       "mitsonar/signal/beam_grid/stripes.py", "mitsonar/signal/beam_grid/transforms.py",
       "mitsonar/survey/beam_domain/ground.py", "mitsonar/cli/setup/doctor.py"}
COPIED = "astype", "copy", "flatten", "tobytes", "sum", "max", "min", "any", "all", "item", "tolist", "mean"


def attributes(tree):
    """Names after a dot."""
    return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


def of_one_backend(tree):
    """Imports and uses of Dr.Jit's namespace of one backend."""
    for node in ast.walk(tree):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [
            name.name for name in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            names = [f"{node.value.id}.{node.attr}"]
        yield from (name for name in names if name.split(".")[:2] in (
            ["drjit", "llvm"], ["drjit", "cuda"], ["dr", "llvm"], ["dr", "cuda"]))


def shared(value):
    """True if an expression may be a view of a device array's memory."""
    while isinstance(value, (ast.Call, ast.Attribute, ast.Subscript)):
        if isinstance(value, ast.Attribute) and value.attr in COPIED:
            return False
        if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute) and value.func.attr == "numpy":
            return not value.args
        value = value.func if isinstance(value, ast.Call) else value.value
    return False


def written_into(tree):
    """Names of views of device arrays that a function writes into."""
    for function in ast.walk(tree):
        if not isinstance(function, (ast.FunctionDef, ast.Lambda)):
            continue
        views = {target.id for node in ast.walk(function) if isinstance(node, ast.Assign) and shared(node.value)
                 for target in node.targets if isinstance(target, ast.Name)}
        for node in ast.walk(function):
            stored = node.targets if isinstance(node, ast.Assign) else [
                node.target] if isinstance(node, ast.AugAssign) else []
            for target in stored:
                if isinstance(target, ast.Subscript) or isinstance(node, ast.AugAssign):
                    while isinstance(target, (ast.Subscript, ast.Attribute)):
                        target = target.value
                    if isinstance(target, ast.Name) and target.id in views:
                        yield target.id


def faults(path):
    """Sentences about what only LLVM can do in a file."""
    tree, name = ast.parse(path.read_text(encoding="utf-8")), path.relative_to(ROOT).as_posix()
    found = attributes(tree)
    asks, alone = bool(found & {"LLVM", "expand_threshold"}), found & {*OWNED}
    if asks and name not in ASK:
        yield f"{name} asks for the backend: add it to ASK once the other backends have a way"
    if alone and not asks:
        yield f"{name}: {alone} work with LLVM alone; ask for the backend beside them"
    for one in of_one_backend(tree):
        yield f"{name}: {one} is of one backend; take the namespace of an array by arrays_of"
    for one in written_into(tree):
        yield f"{name}: {one} is a copy on a GPU, so writing into it changes nothing there; upload it anew"


def test_what_only_llvm_can_do_has_a_way_beside_it():
    assert not [fault for path in SOURCES for fault in faults(path)]


def test_every_file_that_may_ask_does():
    """A list that names more than there is would let new cases pass."""
    for name in ASK:
        assert attributes(ast.parse((ROOT / name).read_text(encoding="utf-8"))) & {"LLVM", "expand_threshold"}, name


@pytest.mark.parametrize("source, wrong", [
    ("import drjit.llvm.ad", of_one_backend), ("x = dr.cuda.Float(1)", of_one_backend),
    ("def f(a):\n    b = a.numpy()\n    b[0] = 1", written_into),
    ("def f(a):\n    b = a.numpy().reshape(2, -1)\n    b *= 2", written_into)])
def test_such_code_is_found(source, wrong):
    assert list(wrong(ast.parse(source)))


@pytest.mark.parametrize("source", ["def f(a):\n    b = a.numpy().copy()\n    b[0] = 1",
                                    "def f(a):\n    b = a.numpy()\n    return b + 1"])
def test_a_copy_may_be_written_into(source):
    assert not list(written_into(ast.parse(source)))
