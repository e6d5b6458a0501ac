"""Sidescans."""
