"""What surfaces look like in scenes of other renderers, as values of our materials."""
