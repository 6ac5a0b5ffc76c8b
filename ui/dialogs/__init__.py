"""Dialogs: each is drawn until it is answered, and returns the answer; see `editor/dialog.py`."""
