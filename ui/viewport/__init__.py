"""The viewport: mouse and camera, the gizmo, transforms by keys, and what is drawn over the picture."""
