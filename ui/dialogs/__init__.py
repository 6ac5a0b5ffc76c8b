"""Dialogs: what stands over everything else until it is answered."""
