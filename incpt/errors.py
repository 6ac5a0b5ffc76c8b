"""The two kinds of failure that a user meets, each one line that names the fix."""

from __future__ import annotations


class InputError(ValueError):
    """What the user gave is wrong: a file, a key, a name, a number. Exit status 2."""


class DeviceError(RuntimeError):
    """The machine cannot do it: no device, a kernel that does not build, too little memory. Exit status 1."""
