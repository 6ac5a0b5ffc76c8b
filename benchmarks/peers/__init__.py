"""Renderers that are compared: one adapter each, behind the same protocol, each in a process of its own."""
