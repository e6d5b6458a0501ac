"""The water."""
