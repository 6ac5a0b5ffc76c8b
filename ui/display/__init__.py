"""The picture on the screen, by OpenGL."""
