"""Acceleration structures: trees over triangles and objects, and brute force where there are few."""
