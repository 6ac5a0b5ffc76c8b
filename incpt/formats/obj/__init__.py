"""OBJ files with their MTL files, as Wavefront's "Object Files" and "MTL Material Format" describe them, with
what programs have added since."""
