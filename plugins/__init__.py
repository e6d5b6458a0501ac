"""Mitsuba plugins of mitsonar: thin adapters from XML to the physics, one folder for each kind of plugin.

`mitsonar.scene.registration` lists them and registers them with Mitsuba.
"""
if __name__ != "mitsonar.plugins":
    raise ImportError("import mitsonar.plugins, not plugins: the folder is part of the package mitsonar")

from mitsonar.scene.registration import BASES, MODULES, PLUGINS, install

__all__ = ["BASES", "MODULES", "PLUGINS", "install"]
