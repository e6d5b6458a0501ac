"""Kinds of sonar."""
