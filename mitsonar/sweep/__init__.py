"""Sweeps: many renders of a scene, described by a plan, run to their end however often they are interrupted."""
import importlib

__all__ = ["Outcome", "Plan", "Render", "load_plan", "run"]

_HOME = {"Outcome": "execute", "run": "execute", "Plan": "plan", "Render": "plan", "load_plan": "plan"}


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module 'mitsonar.sweep' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
