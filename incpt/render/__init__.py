"""Rendering a scene step by step: plan, paths, film, strategies, session."""
