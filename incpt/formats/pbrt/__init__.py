"""Scenes of pbrt-v4: `reader.read_pbrt` makes a Scene of one."""
