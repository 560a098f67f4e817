"""Data sets on disk: our layout, the public ones, and the samples inside the package."""
