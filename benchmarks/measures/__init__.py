"""The measurements of incpt itself; each command of `incpt bench` is a module here or in `peers`."""
