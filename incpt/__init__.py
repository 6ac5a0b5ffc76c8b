"""incpt: an OpenCL path tracer that keeps its picture across an edit.

```python
scene = incpt.load("scenes/editing.toml")
session = incpt.Session(scene, size=(960, 540))
session.render(spp=64)
session.edit(scene.with_object("red cube", rotation=(0, 30, 35)))
session.render(spp=64)  # until it is worth as much again
image = session.image()  # (H, W, 3) float32 linear radiance
```

Names are loaded when they are first used: scenes need numpy, sessions pyopencl, and `incpt --help` neither.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from incpt.core.errors import (
        DeviceError as DeviceError,
        InputError as InputError,
        InputWarning as InputWarning,
        OutputError as OutputError,
    )
    from incpt.core.settings import RenderSettings as RenderSettings
    from incpt.device.device import Device as Device
    from incpt.formats.bitmaps import load_bitmap as load_bitmap
    from incpt.formats.gltf_writer.export import export as export
    from incpt.formats.images import load_image as load_image, write_exr as write_exr, write_png as write_png
    from incpt.formats.mesh_files import load_mesh as load_mesh
    from incpt.formats.pack import pack as pack
    from incpt.formats.registry import load as load
    from incpt.formats.scene_save import save as save
    from incpt.picture.tone_mapping import tone_map as tone_map
    from incpt.render.first_hits import FirstHits as FirstHits
    from incpt.render.modes import Mode as Mode
    from incpt.render.session import Session as Session, Snapshot as Snapshot, StepReport as StepReport
    from incpt.scene.camera import Camera as Camera
    from incpt.scene.change import Change as Change, diff as diff
    from incpt.scene.environment import Environment as Environment
    from incpt.scene.image import Image as Image
    from incpt.scene.light import Light as Light
    from incpt.scene.material import Material as Material
    from incpt.scene.mesh import Mesh as Mesh, MeshSource as MeshSource
    from incpt.scene.model import Object as Object, Scene as Scene
    from incpt.scene.shapes import shape as shape
    from incpt.scene.sky import Sky as Sky
    from incpt.scene.texture import Bitmap as Bitmap, BitmapSource as BitmapSource, Texture as Texture
    from incpt.scene.transform import Transform as Transform

_HOMES = {
    "Bitmap": "scene.texture",
    "BitmapSource": "scene.texture",
    "Camera": "scene.camera",
    "Change": "scene.change",
    "Device": "device.device",
    "DeviceError": "core.errors",
    "Environment": "scene.environment",
    "FirstHits": "render.first_hits",
    "Image": "scene.image",
    "InputError": "core.errors",
    "InputWarning": "core.errors",
    "Light": "scene.light",
    "Material": "scene.material",
    "Mesh": "scene.mesh",
    "MeshSource": "scene.mesh",
    "Mode": "render.modes",
    "Object": "scene.model",
    "OutputError": "core.errors",
    "RenderSettings": "core.settings",
    "Scene": "scene.model",
    "Session": "render.session",
    "Sky": "scene.sky",
    "Snapshot": "render.session",
    "StepReport": "render.session",
    "Texture": "scene.texture",
    "Transform": "scene.transform",
    "diff": "scene.change",
    "export": "formats.gltf_writer.export",
    "load": "formats.registry",
    "load_bitmap": "formats.bitmaps",
    "load_image": "formats.images",
    "load_mesh": "formats.mesh_files",
    "pack": "formats.pack",
    "save": "formats.scene_save",
    "shape": "scene.shapes",
    "tone_map": "picture.tone_mapping",
    "write_exr": "formats.images",
    "write_png": "formats.images",
}
"""The module of each public name. What type checkers read stands above; a test compares both."""

__all__ = list(_HOMES)

if not TYPE_CHECKING:  # They would take any name for a public one.

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *_HOMES})
