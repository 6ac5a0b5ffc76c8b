"""The outline of what is selected, rasterised from its triangles: it follows a drag at once, whatever the
path tracer is doing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from incpt import transform
from incpt.scene import Camera, Mesh, Object, Scene

Rect = tuple[float, float, float, float]
"""x, y, width, height in pixels of the framebuffer, from its top left corner."""
PixelRect = tuple[int, int, int, int]

FULL_SCREEN = """#version 330 core
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
"""
"""Vertex shader of one triangle that covers the viewport; draw 3 vertices of an empty array."""

LINE_PX, RIM_PX = 2.0, 1.0
"""Width of the line and of the dark rim around it, at a DPI scale of 1."""
ACTIVE, SELECTED, RIM = (1.0, 0.66, 0.22), (0.93, 0.42, 0.05), (0.06, 0.04, 0.02)

_NEAR = 1e-4
_BLOCK = 8
_MOST_REACH = 12

_FLAT_VERTEX = """#version 330 core
uniform mat4 clip_from_object;
in vec3 position;
void main() { gl_Position = clip_from_object * vec4(position, 1.0); }
"""

_FLAT_FRAGMENT = """#version 330 core
uniform float number;
out float mask;
void main() { mask = number; }
"""

# The least and the greatest number in and around each block: where they are equal there is no edge near.
_BLOCKS = f"""#version 330 core
uniform sampler2D mask;
uniform int reach;
out vec2 range;
void main() {{
    ivec2 low = ivec2(gl_FragCoord.xy) * {_BLOCK} - reach;
    ivec2 high = low + {_BLOCK} + 2 * reach;
    ivec2 last = textureSize(mask, 0) - 1;
    low = max(low, 0);
    high = min(high, last + 1);
    range = vec2(1.0, 0.0);
    for (int y = low.y; y < high.y; y++)
        for (int x = low.x; x < high.x; x++) {{
            float number = texelFetch(mask, ivec2(x, y), 0).r;
            range = vec2(min(range.x, number), max(range.y, number));
        }}
}}
"""

# A line outside of each object, around all that has a smaller number; soft by half a pixel on either side.
_EDGE = f"""#version 330 core
uniform sampler2D mask;
uniform sampler2D blocks;
uniform int reach;
uniform float line;
uniform float rim;
uniform vec3 active_color;
uniform vec3 selected_color;
uniform vec3 rim_color;
out vec4 result;
void main() {{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 range = texelFetch(blocks, pixel / {_BLOCK}, 0).rg;
    if (range.x == range.y) {{
        result = vec4(0.0);
        return;
    }}
    ivec2 last = textureSize(mask, 0) - 1;
    float own = texelFetch(mask, pixel, 0).r;
    float nearest = 1e6;
    float top = 0.0;
    for (int y = -reach; y <= reach; y++)
        for (int x = -reach; x <= reach; x++) {{
            float number = texelFetch(mask, clamp(pixel + ivec2(x, y), ivec2(0), last), 0).r;
            float away = float(x * x + y * y);
            if (number > own) {{
                nearest = min(nearest, away);
                top = away <= (line + 0.5) * (line + 0.5) ? max(top, number) : top;
            }}
        }}
    // Pixel centres lie half a pixel inside the silhouette.
    float away = sqrt(nearest) - 0.5;
    float on_line = clamp(line + 0.5 - away, 0.0, 1.0);
    float on_rim = clamp(line + rim + 0.5 - away, 0.0, 1.0) * 0.7;
    vec3 color = mix(rim_color, top > 0.999 ? active_color : selected_color, on_line);
    result = vec4(color, max(on_line, on_rim));
}}
"""

_OVER = """#version 330 core
uniform sampler2D lines;
uniform ivec2 origin;
out vec4 result;
void main() { result = texelFetch(lines, ivec2(gl_FragCoord.xy) - origin, 0); }
"""


@dataclass(frozen=True)
class Outlined:
    """Objects of a scene by name, and which of them is the active one."""

    scene: Scene
    names: frozenset[str]
    active: str | None = None

    @property
    def objects(self) -> tuple[Object, ...]:
        """Those that are visible, the farthest first and the active one last: what comes later covers what
        was before."""
        found = [o for o in self.scene.objects if o.name in self.names and o.visible]

        def place(obj: Object) -> tuple[bool, float]:
            return obj.name == self.active, -math.dist(
                obj.world_bounds.mean(axis=0), self.scene.camera.position
            )

        return tuple(sorted(found, key=place))


def inside(rect_px: Rect, clip_px: Rect | None, framebuffer_size: tuple[int, int] | None) -> PixelRect | None:
    """The whole pixels that a rectangle touches inside others; None where there are none."""
    x0, y0 = math.floor(rect_px[0]), math.floor(rect_px[1])
    x1, y1 = math.ceil(rect_px[0] + rect_px[2]), math.ceil(rect_px[1] + rect_px[3])
    bounds = [] if clip_px is None else [clip_px]
    if framebuffer_size is not None:
        bounds.append((0, 0, *framebuffer_size))
    for x, y, width, height in bounds:
        x0, y0 = max(x0, round(x)), max(y0, round(y))
        x1, y1 = min(x1, round(x + width)), min(y1, round(y + height))
    return (x0, y0, x1 - x0, y1 - y0) if x0 < x1 and y0 < y1 else None


def viewport_of(part: PixelRect, framebuffer_height: int) -> PixelRect:
    """The same rectangle counted from the bottom left, as OpenGL does."""
    x, y, width, height = part
    return x, framebuffer_height - y - height, width, height


def clip_from_world(camera: Camera, aspect: float, rect_px: Rect, part: PixelRect) -> npt.NDArray[np.float64]:
    """(4, 4) matrix that projects world space as the path tracer does, for an image that lies at `rect_px`
    and a viewport that covers `part` of it. Depth only clips what lies behind the camera."""
    right, up, forward = transform.camera_frame(
        camera.position, camera.target, camera.up, camera.fov_y, aspect
    )
    rows = np.stack([right / (right @ right), up / (up @ up), forward])
    view = np.column_stack([rows, -rows @ np.asarray(camera.position, np.float64)])
    across, down, depth = view
    x, y, width, height = rect_px
    part_x, part_y, part_width, part_height = part
    # Along an axis of the viewport: the image's own -1 to 1, scaled and moved to where the viewport sees it.
    scale_x, scale_y = width / part_width, height / part_height
    move_x = (2 * (x - part_x) + width) / part_width - 1
    move_y = 1 - (2 * (y - part_y) + height) / part_height
    near = depth - np.array([0, 0, 0, 2 * _NEAR])
    return np.stack([scale_x * across + move_x * depth, scale_y * down + move_y * depth, near, depth])


class Outline:
    """Draws the outline of objects. Keeps the triangles of each mesh on the GPU while it is selected,
    and the lines until camera, rectangle or objects change."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._flat = context.program(vertex_shader=_FLAT_VERTEX, fragment_shader=_FLAT_FRAGMENT)
        self._blocks = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_BLOCKS)
        self._edge = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_EDGE)
        self._over = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_OVER)
        self._programs = (self._flat, self._blocks, self._edge, self._over)
        self._arrays = {p: context.vertex_array(p, []) for p in self._programs[1:]}
        self._meshes: dict[int, _MeshBuffers] = {}
        self._targets: _Targets | None = None
        self._drawn: tuple[object, ...] | None = None

    def draw(
        self,
        target: moderngl.Framebuffer,
        part: PixelRect,
        rect_px: Rect,
        framebuffer_height: int,
        selection: Outlined,
        aspect: float,
        scale: float = 1.0,
    ) -> None:
        """Blend the outline into `target`: of the image at `rect_px` the pixels of `part`; both count from
        the top left. `aspect` is the image's, width over height; `scale` is the DPI scale."""
        objects = selection.objects
        self._keep_meshes(objects)
        if not objects:
            return
        key = (selection.scene.camera, aspect, rect_px, part, scale, selection.active, *objects)
        if key != self._drawn:
            self._render(objects, selection, clip_from_world(key[0], aspect, rect_px, part), part, scale)
            self._drawn = key
            target.use()
            self._context.scissor = None
        assert self._targets is not None
        x, y, width, height = viewport_of(part, framebuffer_height)
        self._context.viewport = (x, y, width, height)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._over["origin"] = (x, y)
        self._over["lines"] = 0
        self._targets.lines.color_attachments[0].use(0)
        self._arrays[self._over].render(moderngl.TRIANGLES, vertices=3)
        self._context.disable(moderngl.BLEND)

    def release(self) -> None:
        """Give all GL objects back."""
        self._keep_meshes(())
        if self._targets is not None:
            self._targets.release()
        for array in self._arrays.values():
            array.release()
        for program in self._programs:
            program.release()

    def mask(self) -> npt.NDArray[np.uint8]:
        """(h, w) the mask that was rasterised last, row 0 on top: 0 where nothing selected is, 255 where the
        active object is, other numbers for other objects."""
        assert self._targets is not None, "nothing was drawn yet"
        width, height = self._targets.mask.size
        pixels = np.frombuffer(self._targets.mask.read(components=1, alignment=1), np.uint8)
        return pixels.reshape(height, width)[::-1]

    def _keep_meshes(self, objects: tuple[Object, ...]) -> None:
        wanted = {id(o.mesh): o.mesh for o in objects}
        for key in self._meshes.keys() - wanted.keys():
            self._meshes.pop(key).release()
        for key, mesh in wanted.items():
            if key not in self._meshes:
                self._meshes[key] = _MeshBuffers(self._context, self._flat, mesh)

    def _render(
        self,
        objects: tuple[Object, ...],
        selection: Outlined,
        clip: npt.NDArray[np.float64],
        part: PixelRect,
        scale: float,
    ) -> None:
        context = self._context
        context.enable_only(moderngl.NOTHING)
        if self._targets is None or self._targets.mask.size != part[2:]:
            if self._targets is not None:
                self._targets.release()
            self._targets = _Targets(context, part[2:])
        targets = self._targets
        targets.mask.use()
        targets.mask.clear()
        for number, obj in enumerate(objects):
            world = np.vstack([obj.world_from_object, [0, 0, 0, 1]])
            self._flat["clip_from_object"].write((clip @ world).T.astype(np.float32).tobytes())
            last = obj.name == selection.active
            self._flat["number"] = 1.0 if last else (1 + number % 254) / 255
            self._meshes[id(obj.mesh)].array.render(moderngl.TRIANGLES)
        line = LINE_PX * scale
        reach = min(math.ceil(line + RIM_PX * scale + 0.5), _MOST_REACH)
        self._blocks["mask"], self._blocks["reach"] = 0, reach
        targets.mask.color_attachments[0].use(0)
        targets.blocks.use()
        self._arrays[self._blocks].render(moderngl.TRIANGLES, vertices=3)
        self._edge["mask"], self._edge["blocks"], self._edge["reach"] = 0, 1, reach
        self._edge["line"], self._edge["rim"] = line, RIM_PX * scale
        self._edge["active_color"], self._edge["selected_color"] = ACTIVE, SELECTED
        self._edge["rim_color"] = RIM
        targets.blocks.color_attachments[0].use(1)
        targets.lines.use()
        self._arrays[self._edge].render(moderngl.TRIANGLES, vertices=3)


class _MeshBuffers:
    def __init__(self, context: moderngl.Context, program: moderngl.Program, mesh: Mesh) -> None:
        self.mesh = mesh  # holds on to it, so that its id stays its own
        self._vertices = context.buffer(mesh.vertices.tobytes())
        self._faces = context.buffer(mesh.faces.tobytes())
        self.array = context.vertex_array(
            program, [(self._vertices, "3f", "position")], index_buffer=self._faces, index_element_size=4
        )

    def release(self) -> None:
        for resource in (self.array, self._vertices, self._faces):
            resource.release()


class _Targets:
    def __init__(self, context: moderngl.Context, size: tuple[int, int]) -> None:
        width, height = size
        block_size = (-(-width // _BLOCK), -(-height // _BLOCK))
        self._textures = (
            context.texture(size, 1),
            context.texture(block_size, 2),
            context.texture(size, 4),
        )
        self.mask, self.blocks, self.lines = (context.framebuffer([t]) for t in self._textures)

    def release(self) -> None:
        for resource in (self.mask, self.blocks, self.lines, *self._textures):
            resource.release()
