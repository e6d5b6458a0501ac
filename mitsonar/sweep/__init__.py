"""Sweeps: many renders of a scene, described by a plan, run to their end however often they are interrupted."""
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .execute import Outcome, run
    from .plan import Plan, Render, load_plan

__all__ = ["Outcome", "Plan", "Render", "load_plan", "run"]

_HOME = {"Outcome": "execute", "run": "execute", "Plan": "plan", "Render": "plan", "load_plan": "plan"}


def __getattr__(name: str):
    if name not in _HOME:
        raise AttributeError(f"module 'mitsonar.sweep' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
