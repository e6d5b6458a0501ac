"""Fits to images: scene values, heights, sediments, poses."""
