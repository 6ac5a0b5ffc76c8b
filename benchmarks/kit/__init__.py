"""What measurements are made with: timing, results on disk, tables, plots, pictures, scenes."""
