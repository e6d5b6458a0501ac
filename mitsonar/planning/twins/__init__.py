"""Scenes after recordings: of vehicles, of sidescans."""
