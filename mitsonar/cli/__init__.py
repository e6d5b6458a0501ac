"""Command line; `main` runs its commands."""
