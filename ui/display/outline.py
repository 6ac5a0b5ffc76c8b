"""The outline of what is selected, rasterised from its triangles: it follows a drag at once, whatever the
path tracer is doing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.ui.display.projection import clip_from_world, covered, viewport_of
from incpt.ui.display.shaders import FULL_SCREEN, OVER
from incpt.ui.rect import Rect

LINE_PX, RIM_PX = 2.0, 1.0
"""Width of the line and of the dark rim around it, at a DPI scale of 1."""
ACTIVE, SELECTED, RIM = (1.0, 0.66, 0.22), (0.93, 0.42, 0.05), (0.06, 0.04, 0.02)
"""Colours of the line around the active object and around the others, and of the rim: sRGB, 0 to 1."""

_BLOCK = 8
"""Width and height of a block of pixels that is looked at as one, where there is no edge near."""
_MOST_REACH = 12
"""The farthest that the search for an edge goes, in pixels."""
_TARGET_STEP = 64
"""Width and height of render targets are whole multiples of this, in pixels."""

_FLAT_VERTEX = """#version 330 core
uniform mat4 clip_from_object;
in vec3 position;
void main() { gl_Position = clip_from_object * vec4(position, 1.0); }
"""
"""Vertex shader of the mask."""

_FLAT_FRAGMENT = """#version 330 core
uniform float number;
out float mask;
void main() { mask = number; }
"""
"""Fragment shader of the mask: each object writes its number, 0 to 1."""

# The result is the least and the greatest number in and around each block. Where they are equal, no edge is
# near, and the shader that looks for edges has nothing to do.
_BLOCKS = f"""#version 330 core
uniform sampler2D mask;
uniform ivec2 size;
uniform int reach;
out vec2 range;
void main() {{
    ivec2 low = max(ivec2(gl_FragCoord.xy) * {_BLOCK} - reach, 0);
    ivec2 high = min(ivec2(gl_FragCoord.xy) * {_BLOCK} + {_BLOCK} + reach, size);
    range = vec2(1.0, 0.0);
    for (int y = low.y; y < high.y; y++)
        for (int x = low.x; x < high.x; x++) {{
            float number = texelFetch(mask, ivec2(x, y), 0).r;
            range = vec2(min(range.x, number), max(range.y, number));
        }}
}}
"""

# The result is a line around each object: it lies on pixels whose own number is smaller than the object's,
# and is soft by half a pixel on either side.
_EDGE = f"""#version 330 core
uniform sampler2D mask;
uniform sampler2D blocks;
uniform ivec2 size;
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
    ivec2 last = size - 1;
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
"""Fragment shader that lays the finished lines over the picture."""


@dataclass(frozen=True)
class Outlined:
    """Objects of a scene by name, and which of them is the active one."""

    scene: Scene
    names: frozenset[str]
    active: str | None = None

    @property
    def objects(self) -> tuple[Object, ...]:
        """The objects that are visible, the farthest first and the active one last: what comes later covers
        what was before."""
        found = [o for o in self.scene.objects if o.name in self.names and o.visible]

        def place(obj: Object) -> tuple[bool, float]:
            # The farthest corner decides, so that a floor comes before what stands on it.
            ways = np.abs(obj.world_bounds - self.scene.camera.position).max(axis=0)
            return obj.name == self.active, -float(np.linalg.norm(ways))

        return tuple(sorted(found, key=place))


class Outline:
    """Draws the outline of objects. Keeps the triangles of each mesh on the GPU while it is outlined, and
    the lines until camera, rectangle or objects change."""

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
        self._box: Rect[int] | None = None

    def draw(
        self,
        target: moderngl.Framebuffer,
        part: Rect[int],
        rect_px: Rect[float],
        framebuffer_height: int,
        selection: Outlined,
        aspect: float,
        scale: float = 1.0,
    ) -> None:
        """Blend the outline into `target`: of the image at `rect_px` the pixels of `part`; both count from
        the top left. `aspect` is the image's, width over height; `scale` is the DPI scale."""
        objects = selection.objects
        self._keep_meshes(objects)
        key = (selection.scene.camera, aspect, rect_px, part, scale, selection.active, *objects)
        if key != self._drawn:
            self._render(objects, selection, aspect, rect_px, part, scale)
            self._drawn = key
            target.use()
            self._context.scissor = None
        if self._box is None:
            return
        assert self._targets is not None
        x, y, width, height = viewport_of(self._box, framebuffer_height)
        self._context.viewport = (x, y, width, height)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = OVER  # type: ignore[assignment]  # takes four as well
        self._over["origin"] = (x, y)
        self._over["lines"] = 0
        self._targets.lines_texture.use(0)
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

    def mask(self) -> tuple[npt.NDArray[np.uint8], Rect[int]]:
        """The mask that was rasterised last, (h, w), row 0 on top, and where it lies: 0 where none of the
        objects is, 255 where the active one is, other numbers for the others."""
        assert self._targets is not None and self._box is not None, "nothing was drawn yet"
        width, height = self._box.size
        pixels = self._targets.mask.read(viewport=(0, 0, width, height), components=1, alignment=1)
        return np.frombuffer(pixels, np.uint8).reshape(height, width)[::-1], self._box

    @property
    def mesh_count(self) -> int:
        """How many meshes are kept on the GPU."""
        return len(self._meshes)

    def _keep_meshes(self, objects: Sequence[Object]) -> None:
        wanted = {id(o.mesh): o.mesh for o in objects}
        for key in self._meshes.keys() - wanted.keys():
            self._meshes.pop(key).release()
        for key, mesh in wanted.items():
            if key not in self._meshes:
                self._meshes[key] = _MeshBuffers(self._context, self._flat, mesh)

    def _render(
        self,
        objects: Sequence[Object],
        selection: Outlined,
        aspect: float,
        rect_px: Rect[float],
        part: Rect[int],
        scale: float,
    ) -> None:
        """Rasterises the objects into the mask and finds the lines around them."""
        camera = selection.scene.camera
        line, rim = LINE_PX * scale, RIM_PX * scale
        reach = min(math.ceil(line + rim + 0.5), _MOST_REACH)
        self._box = covered(objects, camera, aspect, rect_px, part, reach + 1) if objects else None
        if self._box is None:
            return
        self._context.enable_only(moderngl.NOTHING)
        targets = self._make_targets(self._box.size)
        self._rasterise(objects, selection.active, clip_from_world(camera, aspect, rect_px, self._box))
        for program in (self._blocks, self._edge):
            program["mask"], program["size"], program["reach"] = 0, self._box.size, reach
        targets.mask_texture.use(0)
        self._fill(
            targets.blocks, self._blocks, (-(-self._box.width // _BLOCK), -(-self._box.height // _BLOCK))
        )
        edge = self._edge
        edge["blocks"], edge["line"], edge["rim"] = 1, line, rim
        edge["active_color"], edge["selected_color"], edge["rim_color"] = ACTIVE, SELECTED, RIM
        targets.blocks_texture.use(1)
        self._fill(targets.lines, edge, self._box.size)

    def _rasterise(
        self, objects: Sequence[Object], active: str | None, clip: npt.NDArray[np.float64]
    ) -> None:
        assert self._targets is not None and self._box is not None
        viewport = (0, 0, *self._box.size)
        self._targets.mask.use()
        self._targets.mask.clear(viewport=viewport)
        self._context.viewport = viewport
        for number, obj in enumerate(objects):
            world = np.vstack([obj.world_from_object, [0, 0, 0, 1]])
            self._flat["clip_from_object"] = tuple((clip @ world).T.ravel())
            self._flat["number"] = 1.0 if obj.name == active else (1 + number % 254) / 255
            buffers = self._meshes[id(obj.mesh)]
            # Of a closed surface the faces that look away cover the same pixels as all faces do, in half the
            # time.
            is_mirrored = bool(np.linalg.det(obj.world_from_object[:, :3]) < 0)
            self._context.front_face = "cw" if is_mirrored else "ccw"
            self._context.cull_face = "front"
            self._context.enable_only(moderngl.CULL_FACE if buffers.is_closed else moderngl.NOTHING)
            buffers.array.render(moderngl.TRIANGLES)
        self._context.enable_only(moderngl.NOTHING)
        self._context.front_face, self._context.cull_face = "ccw", "back"

    def _fill(self, target: moderngl.Framebuffer, program: moderngl.Program, size: tuple[int, int]) -> None:
        target.use()
        self._context.viewport = (0, 0, *size)
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)

    def _make_targets(self, size: tuple[int, int]) -> _Targets:
        """Targets that are large enough; they grow by steps and shrink only when far too large."""
        width, height = (-(-n // _TARGET_STEP) * _TARGET_STEP for n in size)
        old = self._targets
        if old is not None:
            has_width, has_height = old.mask.size
            if width <= has_width and height <= has_height and has_width * has_height <= 8 * width * height:
                return old
            old.release()
        self._targets = _Targets(self._context, (width, height))
        return self._targets


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge of a face runs the other way along another one, so that there is no hole.

    By sums of random numbers modulo 2^64 instead of by sorting: wrong once in about 10^18 times.
    """
    draw = np.random.default_rng(0)
    start, end = draw.integers(0, 1 << 63, (2, len(mesh.vertices)), np.uint64)
    total = 0
    for corner in range(3):
        a, b = mesh.faces[:, corner], mesh.faces[:, (corner + 1) % 3]
        total += int((start[a] * end[b] - start[b] * end[a]).sum(dtype=np.uint64))
    return total % (1 << 64) == 0


class _MeshBuffers:
    def __init__(self, context: moderngl.Context, program: moderngl.Program, mesh: Mesh) -> None:
        self.mesh = mesh  # While it is held, no other mesh can have its id, by which it is found.
        self.is_closed = is_closed(mesh)
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
        self.mask_texture = context.texture(size, 1)
        self.blocks_texture = context.texture(block_size, 2)
        self.lines_texture = context.texture(size, 4)
        self._textures = (self.mask_texture, self.blocks_texture, self.lines_texture)
        self.mask, self.blocks, self.lines = (context.framebuffer([t]) for t in self._textures)

    def release(self) -> None:
        for resource in (self.mask, self.blocks, self.lines, *self._textures):
            resource.release()
