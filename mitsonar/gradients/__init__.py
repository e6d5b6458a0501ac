"""Gradients of records: how what is heard moves with what is in the scene."""
