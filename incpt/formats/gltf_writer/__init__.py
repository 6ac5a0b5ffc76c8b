"""Scenes as glTF 2.0, with the extensions that `incpt.formats.gltf` reads; and what that cannot hold."""
