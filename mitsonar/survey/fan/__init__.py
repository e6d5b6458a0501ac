"""Fans of beams of an array, and forward-looking sonars."""
