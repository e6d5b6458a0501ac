"""Pulses: what a sonar transmits."""
