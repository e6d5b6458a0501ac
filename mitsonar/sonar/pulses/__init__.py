"""Pulses that a sonar transmits."""
