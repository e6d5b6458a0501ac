"""Scenes with the tracks of vehicles."""
