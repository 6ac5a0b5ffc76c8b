"""PLY files, as Greg Turk's "The PLY Polygon File Format" (1994) describes them, with the names of properties
that programs have used since."""
