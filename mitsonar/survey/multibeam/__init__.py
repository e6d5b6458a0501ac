"""Swaths of multibeam echo sounders: sectors, steering, beams, and the soundings they make."""
