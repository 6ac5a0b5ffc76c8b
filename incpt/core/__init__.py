"""What everything stands on: transforms, settings, memory layouts, errors, files."""
