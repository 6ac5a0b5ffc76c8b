"""The scene shaded by OpenGL, in place of the rendered picture: for editing where the device is slow.

Solid is every object in the plain colour of its material, material preview has textures, roughness and metal
under the lamps of a studio that moves with the camera. Neither has shadows, nor the light of the scene.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt
import PIL.Image

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.layout import TextureSlot
from incpt.scene import edits
from incpt.scene.camera import Camera
from incpt.scene.material import Material, texture_of
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.texture import Bitmap, Texture
from incpt.ui.display.projection import clip_from_world, viewport_of
from incpt.ui.display.shaders import FULL_SCREEN
from incpt.ui.rect import Rect
from incpt.ui.widgets.thumbnails import as_shown

_SAMPLES = 4
"""Samples of each pixel, where the device has so many: edges are smooth."""
_NEAR_SHARE = 2e-3
"""How far from the camera shading begins, as a share of the way to its target. Depth has 24 bits: from
nearer on they would not tell apart what is far."""
_TEXTURE_SIZE = 1024
"""The most pixels that an image has a side here."""
_BACKGROUND = (0.215, 0.215, 0.22)
"""sRGB."""
_SLOTS = {
    "base_map": TextureSlot.BASE_COLOR,
    "rough_map": TextureSlot.METALLIC_ROUGHNESS,
    "emission_map": TextureSlot.EMISSION,
}
"""The images that are shown, by the name of their sampler."""
_WRAPS = {"repeat": 0, "mirror": 1, "clamp": 2}
_CORNER = np.dtype([("position", "3f4"), ("normal", "4f2"), ("uv0", "2f4"), ("uv1", "2f4"), ("color", "4u1")])
"""What a corner of a triangle has on the GPU. Half floats come in fours, so that all are aligned."""

_VERTEX = """#version 330 core
uniform mat4 clip_from_object;
uniform mat4 world_from_object;
uniform mat3 normal_matrix;
uniform vec3 eye;
uniform vec3 forward;
uniform bool orthographic;
in vec3 position;
in vec4 normal;
in vec2 uv0;
in vec2 uv1;
in vec4 color;
out vec3 n;
out vec3 to_eye;
out vec2 uvs[2];
out vec4 tint;
void main() {
    gl_Position = clip_from_object * vec4(position, 1.0);
    n = normal_matrix * normal.xyz;
    to_eye = orthographic ? -forward : eye - (world_from_object * vec4(position, 1.0)).xyz;
    uvs[0] = uv0;
    uvs[1] = uv1;
    tint = color;
}
"""

_FRAGMENT = """#version 330 core
uniform bool solid;
uniform mat3 studio;  // right, up and back of the camera
uniform vec4 base;
uniform vec3 emission;
uniform float metallic;
uniform float roughness;
uniform float specular;
uniform float transmission;
uniform bool unlit;
uniform int alpha_mode;  // 0 opaque, 1 mask, 2 blend
uniform float alpha_cutoff;
uniform sampler2D base_map;
uniform sampler2D rough_map;
uniform sampler2D emission_map;
uniform mat3 places[3];
uniform ivec3 reads[3];  // set of coordinates, wrap along u and along v
in vec3 n;
in vec3 to_eye;
in vec2 uvs[2];
in vec4 tint;
out vec4 result;

const float see_through = 0.6;  // the share of pixels that clear glass leaves out
const vec3 lamps[3] = vec3[3](vec3(-0.45, 0.65, 0.61), vec3(0.80, 0.20, 0.56), vec3(0.15, -0.60, -0.78));
const vec3 strengths = vec3(2.2, 0.8, 0.7);

vec3 linear(vec3 x) {
    return mix(x / 12.92, pow((x + 0.055) / 1.055, vec3(2.4)), greaterThan(x, vec3(0.04045)));
}

vec3 srgb(vec3 x) {
    x = clamp(x, 0.0, 1.0);
    vec3 curved = 1.055 * pow(max(x, 1e-10), vec3(1.0 / 2.4)) - 0.055;
    return mix(12.92 * x, curved, greaterThan(x, vec3(0.0031308)));
}

float wrapped(float x, int way) {
    if (way == 2)
        return clamp(x, 0.0, 1.0);
    return way == 1 ? 1.0 - abs(mod(x, 2.0) - 1.0) : fract(x);
}

vec4 read(sampler2D map, int slot) {
    vec2 at = (places[slot] * vec3(reads[slot].x == 1 ? uvs[1] : uvs[0], 1.0)).xy;
    vec2 place = vec2(wrapped(at.x, reads[slot].y), wrapped(at.y, reads[slot].z));
    return textureGrad(map, place, dFdx(at), dFdy(at));
}

// Bayer's order of a square of 4 x 4 pixels: what covers in part is drawn on so many of them.
float threshold() {
    ivec2 at = ivec2(gl_FragCoord.xy) & 3;
    int x = at.x ^ at.y;
    int order = ((x & 1) << 3) | ((at.y & 1) << 2) | (x & 2) | ((at.y & 2) >> 1);
    return (float(order) + 0.5) / 16.0;
}

// The walls of the studio: bright above, dark below.
vec3 around(vec3 way, float blur) {
    float height = dot(way, studio[1]);
    float sharp = smoothstep(-0.05 - blur, 0.05 + blur, height);
    return vec3(mix(0.18, 0.75, sharp) + 0.35 * smoothstep(0.5 - blur, 0.9 + blur, height));
}

vec3 shaded(vec3 color, float metal, float rough, vec3 N, vec3 V) {
    vec3 f0 = mix(vec3(0.04 * specular), color, metal);
    vec3 diffuse = color * (1.0 - metal) * (1.0 - transmission);
    float a = max(rough * rough, 0.02), nv = max(dot(N, V), 1e-3);
    vec3 R = reflect(-V, N);
    // The share of the surroundings that is reflected: Karis, "Physically Based Shading on Mobile" (2014).
    vec4 r = rough * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float b = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
    vec2 ab = vec2(-1.04, 1.04) * b + r.zw;
    vec3 sum = diffuse * around(N, 1.0) + (f0 * ab.x + ab.y) * around(R, rough);
    sum += transmission * (1.0 - metal) * color * around(refract(-V, N, 0.7), rough);
    for (int i = 0; i < 3; i++) {
        vec3 L = normalize(studio * lamps[i]), H = normalize(L + V);
        float nl = max(dot(N, L), 0.0), nh = max(dot(N, H), 0.0);
        float d = a * a / (3.14159 * pow(nh * nh * (a * a - 1.0) + 1.0, 2.0));
        float k = a / 2.0;
        float g = 1.0 / ((nv * (1.0 - k) + k) * (nl * (1.0 - k) + k) * 4.0);
        vec3 f = f0 + (1.0 - f0) * pow(1.0 - max(dot(V, H), 0.0), 5.0);
        sum += strengths[i] * nl * (diffuse / 3.14159 + min(d * g, 8.0) * f);
    }
    return sum;
}

void main() {
    vec3 V = normalize(to_eye), N = normalize(n);
    N = dot(N, V) < 0.0 ? -N : N;
    vec4 color = base * tint;
    if (solid) {
        float light = 0.30;
        for (int i = 0; i < 3; i++)
            light += 0.30 * strengths[i] * max(dot(N, normalize(studio * lamps[i])), 0.0);
        result = vec4(srgb(mix(vec3(0.5), color.rgb, 0.75) * light), 1.0);
        return;
    }
    vec4 texel = read(base_map, 0);
    color *= vec4(linear(texel.rgb), texel.a);
    float cover = (alpha_mode == 2 ? color.a : 1.0) * (1.0 - see_through * transmission);
    if ((alpha_mode == 1 && color.a < alpha_cutoff) || cover < threshold())
        discard;
    vec4 maps = read(rough_map, 1);
    vec3 lit = unlit ? color.rgb : shaded(color.rgb, metallic * maps.b, roughness * maps.g, N, V);
    lit += unlit ? vec3(0.0) : emission * linear(read(emission_map, 2).rgb);
    // Bright parts keep their colour: the curve of Reinhard et al. (2002), with white at 4.
    result = vec4(srgb(lit * (1.0 + lit / 16.0) / (1.0 + 0.6 * lit)), 1.0);
}
"""

_PUT = """#version 330 core
uniform sampler2D shaded;
uniform ivec2 origin;
out vec4 result;
void main() { result = vec4(texelFetch(shaded, ivec2(gl_FragCoord.xy) - origin, 0).rgb, 1.0); }
"""
"""Fragment shader that puts what was shaded where the picture is."""


class Shading:
    """Draws scenes. Keeps meshes and images on the GPU while a scene has them, and what was drawn until
    something of it changes."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._put = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_PUT)
        self._put_array = context.vertex_array(self._put, [])
        self._white = context.texture((1, 1), 4, b"\xff\xff\xff\xff")
        self._meshes: dict[int, _ShadedMesh] = {}
        self._images: dict[int, tuple[Bitmap, moderngl.Texture]] = {}
        self._target: _ShadedTarget | None = None
        self._drawn: tuple[object, ...] | None = None

    def draw(
        self,
        target: moderngl.Framebuffer,
        part: Rect[int],
        rect_px: Rect[float],
        framebuffer_height: int,
        scene: Scene,
        kind: str,
    ) -> None:
        """Draw a scene into `target`: of the image at `rect_px` the pixels of `part`; both count from the top
        left. `kind` is "solid" or "material"."""
        key = (scene.objects, scene.materials, scene.camera, kind, rect_px, part)
        if self._drawn is None or any(new is not old and new != old
                                      for new, old in zip(key, self._drawn, strict=True)):  # fmt: skip
            self._render(scene, kind, rect_px, part)
            self._drawn = key
        assert self._target is not None
        target.use()
        context, viewport = self._context, viewport_of(part, framebuffer_height)
        context.scissor, context.viewport = None, viewport
        context.enable_only(moderngl.NOTHING)
        self._put["shaded"], self._put["origin"] = 0, viewport[:2]
        self._target.texture.use(0)
        self._put_array.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Give all GL objects back."""
        self._keep((), {}, False)
        if self._target is not None:
            self._target.release()
        for resource in (self._white, self._put_array, self._program, self._put):
            resource.release()

    @property
    def counts(self) -> tuple[int, int]:
        """How many meshes and images are kept on the GPU."""
        return len(self._meshes), len(self._images)

    def _render(self, scene: Scene, kind: str, rect_px: Rect[float], part: Rect[int]) -> None:
        objects = tuple(one for one in scene.objects if one.visible)
        has_images = kind == "material"
        self._keep(objects, scene.materials, has_images)
        shown, context = self._make_target(part.size), self._context
        shown.samples.use()
        context.viewport, context.scissor = (0, 0, *part.size), None
        context.enable_only(moderngl.DEPTH_TEST)
        shown.samples.clear(*_BACKGROUND, 1.0, depth=1.0)
        width, height = scene.settings.size
        clip = clip_from_world(scene.camera, width / height, rect_px, part)
        clip[2] = _depth_row(scene, clip[3])
        self._set_camera(scene.camera, is_solid=not has_images)
        for one in objects:
            self._set_material(scene.materials[one.material], one, has_images)
            self._draw_object(one, clip)
        context.enable_only(moderngl.NOTHING)
        context.copy_framebuffer(shown.resolved, shown.samples)

    def _set_camera(self, camera: Camera, is_solid: bool) -> None:
        program = self._program
        right, up, forward = camera.image_plane(1.0)
        axes = np.array([right / np.linalg.norm(right), up / np.linalg.norm(up), -forward])
        program["solid"] = is_solid
        program["studio"] = tuple(axes.ravel())
        program["eye"], program["forward"] = camera.position, tuple(forward)
        program["orthographic"] = camera.is_orthographic

    def _draw_object(self, one: Object, clip: npt.NDArray[np.float64]) -> None:
        world = np.vstack([one.world_from_object, [0, 0, 0, 1]])
        program = self._program
        program["clip_from_object"] = tuple((clip @ world).T.ravel())
        program["world_from_object"] = tuple(world.T.ravel())
        # Its transpose, column by column, is the inverse row by row.
        program["normal_matrix"] = tuple(np.linalg.inv(world[:3, :3]).ravel())
        self._meshes[id(one.mesh)].array.render(moderngl.TRIANGLES)

    def _set_material(self, material: Material, one: Object, has_images: bool) -> None:
        program = self._program
        alpha = 1.0 if material.alpha_mode == "opaque" else material.alpha
        program["base"] = (*material.base_color, alpha)
        if not has_images:
            return
        program["base"] = (*_seen_color(material, one), alpha)
        for name in (
            "emission",
            "metallic",
            "roughness",
            "specular",
            "transmission",
            "unlit",
            "alpha_cutoff",
        ):
            program[name] = getattr(material, name)
        program["alpha_mode"] = ("opaque", "mask", "blend").index(material.alpha_mode)
        places, reads = [], []
        for unit, (name, slot) in enumerate(_SLOTS.items()):
            texture = texture_of(material, slot)
            # Without texture coordinates all of a surface has those of the corner, as in the renderer.
            self._image(texture).use(unit)
            program[name] = unit
            matrix = np.eye(3) if texture is None else np.vstack([texture.matrix, [0, 0, 1]])
            places.append(matrix.T.ravel())
            reads.append((0, 0, 0) if texture is None else _read(texture, one.mesh))
        program["places"] = [tuple(place) for place in places]
        program["reads"] = reads

    def _image(self, texture: Texture | None) -> moderngl.Texture:
        return self._white if texture is None else self._images[id(texture.bitmap)][1]

    def _keep(self, objects: tuple[Object, ...], materials: Mapping[str, Material], has_images: bool) -> None:
        meshes = {id(one.mesh): one.mesh for one in objects}
        for key in self._meshes.keys() - meshes.keys():
            self._meshes.pop(key).release()
        for key, mesh in meshes.items():
            if key not in self._meshes:
                self._meshes[key] = _ShadedMesh(self._context, self._program, mesh)
        used = {one.material: materials[one.material] for one in objects} if has_images else {}
        textures = [texture_of(one, slot) for one in used.values() for slot in _SLOTS.values()]
        bitmaps = {id(one.bitmap): one.bitmap for one in textures if one is not None}
        # Images stay while there is solid shading in between.
        for key in self._images.keys() - bitmaps.keys() if has_images or not objects else ():
            self._images.pop(key)[1].release()
        for key, bitmap in bitmaps.items():
            if key not in self._images:
                self._images[key] = bitmap, _uploaded(self._context, bitmap)

    def _make_target(self, size: tuple[int, int]) -> _ShadedTarget:
        if self._target is None or self._target.size != size:
            if self._target is not None:
                self._target.release()
            self._target = _ShadedTarget(self._context, size)
        return self._target


class _ShadedMesh:
    def __init__(self, context: moderngl.Context, program: moderngl.Program, mesh: Mesh) -> None:
        self.mesh = mesh  # While it is held, no other mesh can have its id, by which it is found.
        self._corners = context.buffer(corners(mesh).tobytes())
        names = _CORNER.names or ()
        self.array = context.vertex_array(program, [(self._corners, "3f4 4f2 2f4 2f4 4f1", *names)])

    def release(self) -> None:
        self.array.release()
        self._corners.release()


class _ShadedTarget:
    def __init__(self, context: moderngl.Context, size: tuple[int, int]) -> None:
        samples = min(_SAMPLES, context.max_samples)
        self.size, self.texture = size, context.texture(size, 4)
        self._buffers = (
            context.renderbuffer(size, 4, samples=samples),
            context.depth_renderbuffer(size, samples=samples),
        )
        self.samples = context.framebuffer([self._buffers[0]], self._buffers[1])
        self.resolved = context.framebuffer([self.texture])

    def release(self) -> None:
        for resource in (self.samples, self.resolved, *self._buffers, self.texture):
            resource.release()


def corners(mesh: Mesh) -> npt.NDArray[Any]:
    """(3 F,) of _CORNER: what each corner of each face has."""
    positions = mesh.vertices[mesh.faces]
    found = np.zeros((len(mesh.faces), 3), _CORNER)
    found["position"] = positions
    normals = mesh.normals
    if normals is None:
        across = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
        lengths = np.linalg.norm(across, axis=1, keepdims=True)
        normals = np.repeat((across / np.maximum(lengths, 1e-30))[:, None], 3, axis=1)
    found["normal"][..., :3] = normals
    for name, uvs in zip(("uv0", "uv1"), mesh.uvs, strict=False):
        found[name] = uvs
    found["color"] = 255 if mesh.colors is None else np.round(mesh.colors * 255)
    return found.ravel()


def _seen_color(material: Material, one: Object) -> Vector:
    """The base colour, of what is clear with what its body absorbs along half of its size."""
    if not material.transmission or material.thin_walled:
        return material.base_color
    low, high = one.world_bounds
    half = float((high - low).mean()) / 2
    r, g, b = (c * math.exp(-a * half) for c, a in zip(material.base_color, material.absorption, strict=True))
    return r, g, b


def _read(texture: Texture, mesh: Mesh) -> tuple[int, int, int]:
    uv_set = texture.uv_set if texture.uv_set < len(mesh.uvs) else 0
    return uv_set, _WRAPS[texture.wrap[0]], _WRAPS[texture.wrap[1]]


def _uploaded(context: moderngl.Context, bitmap: Bitmap) -> moderngl.Texture:
    """A bitmap with at most `_TEXTURE_SIZE` pixels a side, as a display shows its numbers."""
    step = max(max(bitmap.width, bitmap.height) // (2 * _TEXTURE_SIZE), 1)
    shown = as_shown(bitmap.pixels[::step, ::step])
    rgba = np.ones((*shown.shape[:2], 4))
    rgba[..., :3] = shown[..., :1] if bitmap.channels < 3 else shown[..., :3]
    if bitmap.has_alpha:
        rgba[..., 3] = shown[..., -1]
    image = PIL.Image.fromarray((np.clip(rgba, 0, 1) * 255 + 0.5).astype(np.uint8), "RGBA")
    image.thumbnail((_TEXTURE_SIZE, _TEXTURE_SIZE), PIL.Image.Resampling.BOX)
    texture = context.texture(image.size, 4, np.asarray(image).tobytes())
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture


def _depth_row(scene: Scene, divisor: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(4,) the row of a clip matrix by which what is nearer covers what is farther; `divisor` is its last
    row."""
    camera = scene.camera
    one = np.array([0.0, 0.0, 0.0, 1.0])
    if not camera.is_orthographic:
        near = max(camera.near, _NEAR_SHARE * math.dist(camera.position, camera.target))
        return np.asarray(divisor - 2 * near * one)
    forward = camera.image_plane(1.0)[2]
    depth = np.append(forward, -forward @ np.asarray(camera.position))
    bounds = edits.bounds_of(scene)
    far = 1.0 if bounds is None else float((affine.box_corners(bounds) @ forward + depth[3]).max())
    near = camera.near
    span = 2 / max(1.01 * far - near, 1e-3)
    return np.asarray(span * (depth - near * one) - one)
