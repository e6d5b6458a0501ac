"""Beam domain: images of an array from echoes on a grid of time and sine, without signals of elements."""
