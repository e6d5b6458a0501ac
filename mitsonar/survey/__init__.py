"""Pings along a track: what each kind of sonar receives."""
