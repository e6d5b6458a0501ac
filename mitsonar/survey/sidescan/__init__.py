"""Render sidescans: faces, rays of either side, and images."""
