"""Scenes as immutable values, edits that make one from another, and the difference between two."""
