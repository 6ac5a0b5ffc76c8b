"""Scenes of Mitsuba 3 (XML): `reader.read_mitsuba` makes a Scene of one."""
