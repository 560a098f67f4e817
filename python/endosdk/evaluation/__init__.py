"""Metrics, scores and the methods that are compared."""
