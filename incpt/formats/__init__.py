"""Files in and out: scene files, edit scripts, meshes, images."""
