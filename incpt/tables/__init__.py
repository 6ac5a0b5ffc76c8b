"""A scene as the kernels read it: geometry, objects, materials, lights, environment."""
