"""The command line; `main` has its commands."""
