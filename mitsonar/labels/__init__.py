"""Labelled pictures of one record: frames, grey values, annotations, and their forms in files."""
