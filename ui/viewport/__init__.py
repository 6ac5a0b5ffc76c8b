"""The viewport: mouse and camera, the gizmo, and what is drawn over the picture."""
