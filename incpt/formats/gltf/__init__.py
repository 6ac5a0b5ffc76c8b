"""glTF 2.0, read by modules for each of its parts; `reader` puts them together."""
