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

from incpt.core.errors import DeviceError, InputError, InputWarning, OutputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.formats.images import load_image, write_exr, write_png
from incpt.formats.mesh_files import load_mesh
from incpt.formats.registry import load
from incpt.formats.scene_save import save
from incpt.picture.tone_mapping import tone_map
from incpt.render.first_hits import FirstHits
from incpt.render.modes import Mode
from incpt.render.session import Session, StepReport
from incpt.scene.camera import Camera
from incpt.scene.change import Change, diff
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.transform import Transform

__all__ = [
    "Camera",
    "Change",
    "Device",
    "DeviceError",
    "Environment",
    "FirstHits",
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
    "Transform",
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
