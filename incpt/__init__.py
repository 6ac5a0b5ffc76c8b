"""incpt: an OpenCL path tracer that keeps its picture across an edit.

```python
scene = incpt.load("scenes/editing.toml")
session = incpt.Session(scene, size=(960, 540))
session.render(spp=64)
session.edit(scene.with_object("red cube", rotation=(0, 30, 35)))
while session.mode is incpt.Mode.INCREMENTAL:
    session.step()
image = session.image()  # (H, W, 3) float32 linear radiance
```
"""

from incpt.device import Device
from incpt.errors import DeviceError, InputError, InputWarning, OutputError
from incpt.image_io import load_image, tone_map, write_exr, write_png
from incpt.mesh_io import load_mesh
from incpt.modes import Mode
from incpt.scene import Camera, Change, Environment, Image, Material, Mesh, Object, Scene, diff, shape
from incpt.scene_io import load, save
from incpt.session import Aovs, Session, StepReport
from incpt.settings import RenderSettings

__all__ = [
    "Aovs",
    "Camera",
    "Change",
    "Device",
    "DeviceError",
    "Environment",
    "Image",
    "InputError",
    "InputWarning",
    "Material",
    "Mesh",
    "Mode",
    "Object",
    "OutputError",
    "RenderSettings",
    "Scene",
    "Session",
    "StepReport",
    "diff",
    "load",
    "load_image",
    "load_mesh",
    "save",
    "shape",
    "tone_map",
    "write_exr",
    "write_png",
]
