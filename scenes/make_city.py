"""Makes city.toml and the meshes that it shares: `python scenes/make_city.py [FOLDER]`, some seconds.

A grid of blocks between a river and the horizon. Each building is a frame of slabs and piers, one of four
meshes that hundreds of objects share, around a plain glass body. In the middle stands a twisted tower whose
frame alone has more than 300,000 triangles. Lengths are metres; the same run gives the same files.
"""

from __future__ import annotations

import io
import sys
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Arrays = tuple[Floats, npt.NDArray[np.int32]]

GRID = 1 / 32
"""Coordinates are rounded to it, so that the meshes compress."""
TOWER_FLOORS, TOWER_SIDES, FLOOR_HEIGHT = 120, 180, 1.5
PITCH, STREET, BLOCKS = 44.0, 12.0, 11
QUADS = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))


def boxes(low: Floats, high: Floats) -> Arrays:
    """(8 N, 3) vertices and (12 N, 3) faces, seen from outside, of N boxes between corners (N, 3)."""
    choose = np.array([[(i >> axis) & 1 for axis in range(3)] for i in range(8)])
    corners = np.where(choose[None] == 1, high[:, None, :], low[:, None, :])
    return corners.reshape(-1, 3), _per_item(QUADS, len(low), 8)


def _per_item(quads: Iterable[Sequence[int]], count: int, stride: int) -> npt.NDArray[np.int32]:
    """Faces of `count` items with the same quads, each item with `stride` vertices."""
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))], np.int32)
    offsets = np.arange(count, dtype=np.int32) * stride
    return (faces[None] + offsets[:, None, None]).reshape(-1, 3)


def joined(*parts: Arrays) -> Arrays:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = [faces + np.int32(start) for (_, faces), start in zip(parts, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def tower_radius(angle: Floats, height: Floats) -> Floats:
    """Outline of the tower: a square with round corners that turns by 150 degrees and tapers upwards."""
    part = height / (TOWER_FLOORS * FLOOR_HEIGHT)
    turned = angle - np.radians(150) * part
    rounded_square = (np.abs(np.cos(turned)) ** 5 + np.abs(np.sin(turned)) ** 5) ** (-1 / 5)
    return np.asarray(19.0 * rounded_square * (1 - 0.45 * part**1.5))


def _ring(radius_factor: float, angle: Floats, height: Floats) -> Floats:
    radius = tower_radius(angle, height) * radius_factor
    return np.stack(
        [radius * np.sin(angle), np.broadcast_to(height, angle.shape), radius * np.cos(angle)], -1
    )


def tower_frame() -> Arrays:
    """A ring-shaped slab for each floor, and a pier at each of its corners."""
    floors = np.arange(TOWER_FLOORS, dtype=np.float64)[:, None] * FLOOR_HEIGHT
    angle = np.broadcast_to(np.arange(TOWER_SIDES) * (2 * np.pi / TOWER_SIDES), (TOWER_FLOORS, TOWER_SIDES))
    slab = np.stack(
        [_ring(factor, angle, floors + up) for factor in (0.9, 1.0) for up in (0.0, 0.35)], axis=2
    )
    here = np.arange(TOWER_SIDES, dtype=np.int32) * 4
    there = np.roll(here, -1)
    pairs = ((1, 3), (3, 2), (2, 0))  # top, outer side, bottom
    quads = [
        (h + a, h + b, t + b, t + a)
        for a, b in pairs
        for h, t in zip(here.tolist(), there.tolist(), strict=True)
    ]
    slabs = slab.reshape(-1, 3), _per_item(quads, TOWER_FLOORS, 4 * TOWER_SIDES)
    half = 0.16 * 2 * np.pi / TOWER_SIDES
    pier = np.stack(
        [
            _ring(factor, angle + sign * half, floors + up)
            for factor in (0.93, 1.015)
            for up in (0.35, FLOOR_HEIGHT)
            for sign in (-1, 1)
        ],
        axis=2,
    )
    # Corners count sideways, then up, then outwards; piers end in the slabs, so they need no top or bottom.
    sides = ((4, 5, 7, 6), (0, 2, 3, 1), (0, 4, 6, 2), (1, 3, 7, 5))
    return joined(slabs, (pier.reshape(-1, 3), _per_item(sides, TOWER_FLOORS * TOWER_SIDES, 8)))


def tower_body(rings: int = 60, sides: int = 90) -> Arrays:
    """The glass within the frame, closed at the top."""
    height: Floats = np.linspace(0.0, TOWER_FLOORS * FLOOR_HEIGHT, rings + 1)[:, None]
    angle = np.broadcast_to(np.arange(sides) * (2 * np.pi / sides), (rings + 1, sides))
    wall = _ring(0.95, angle, height).reshape(-1, 3)
    side = np.arange(sides, dtype=np.int32)
    after = (side + 1) % sides
    quads = np.stack([side, after, after + sides, side + sides], axis=1)
    top = np.stack([side + rings * sides, after + rings * sides, np.full(sides, len(wall))], axis=1)
    faces = np.concatenate([_per_item(quads.tolist(), rings, sides), top.astype(np.int32)])
    return np.vstack([wall, [[0.0, height[-1, 0], 0.0]]]), faces


def frame(width: float, depth: float, floors: int, bays: tuple[int, int], reach: float = 0.5) -> Arrays:
    """Slabs and piers around a body of width x depth that stands on y = 0, three metres a floor, and a roof
    with an edge."""
    x, z, height = width / 2 + reach, depth / 2 + reach, floors * 3.0
    low = [(-x, floor * 3.0 - 0.6, -z) for floor in range(1, floors + 1)]
    high = [(x, floor * 3.0, z) for floor in range(1, floors + 1)]
    for axis, count, along, across in ((0, bays[0], x, z), (2, bays[1], z, x)):
        for place in np.linspace(-along + 0.4, along - 0.4, count + 1):
            for sign in (-1, 1):
                corner = [0.0, 0.0, 0.0]
                corner[axis], corner[2 - axis] = place, sign * (across - 0.25)
                half = [0.4, 0.0, 0.25] if axis == 0 else [0.25, 0.0, 0.4]
                low.append((corner[0] - half[0], 0.0, corner[2] - half[2]))
                high.append((corner[0] + half[0], height + 0.9, corner[2] + half[2]))
    low += [(-x * 0.4, height, -z * 0.5)]
    high += [(x * 0.5, height + 2.8, z * 0.3)]
    return boxes(np.array(low), np.array(high))


def stepped_frame() -> Arrays:
    """Three frames on top of each other, each narrower."""
    parts, base = [], 0.0
    for width, floors, bays in ((22.0, 7, 8), (16.0, 6, 6), (10.0, 5, 4)):
        vertices, faces = frame(width, width, floors, (bays, bays))
        parts.append((vertices + np.array([0.0, base, 0.0]), faces))
        base += floors * 3.0
    return joined(*parts)


def tree() -> Arrays:
    """A trunk and a lumpy crown of 320 triangles."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    lumps = 1 + 0.16 * np.sin(5 * ball.vertices @ np.array([[1.0], [0.7], [-0.6]]))
    crown = ball.vertices * lumps * [1.7, 2.1, 1.7] + [0, 4.2, 0]
    trunk = boxes(np.array([[-0.2, 0.0, -0.2]]), np.array([[0.2, 3.0, 0.2]]))
    return joined(trunk, (np.asarray(crown), np.asarray(ball.faces, np.int32)))


def meshes() -> dict[str, Arrays]:
    """Every mesh by the name of its file."""
    return {
        "tower": tower_frame(),
        "tower_body": tower_body(),
        "office": frame(18.0, 18.0, 16, (9, 9)),
        "housing": frame(26.0, 11.0, 7, (9, 4), reach=1.1),
        "stepped": stepped_frame(),
        "slab": frame(28.0, 9.0, 22, (14, 4)),
        "tree": tree(),
    }


BODIES = {
    "office": [(18.0, 18.0, 0.0, 48.0)],
    "housing": [(26.0, 11.0, 0.0, 21.0)],
    "stepped": [(22.0, 22.0, 0.0, 21.0), (16.0, 16.0, 21.0, 39.0), (10.0, 10.0, 39.0, 54.0)],
    "slab": [(28.0, 9.0, 0.0, 66.0)],
}
"""What stands in each frame: width, depth, foot and top of boxes."""


def npz(mesh: Arrays) -> bytes:
    """A mesh archive, with a fixed date in it."""
    vertices, faces = mesh
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in (
            ("vertices", (np.round(vertices / GRID) * GRID).astype(np.float32)),
            ("faces", faces.astype(np.int32)),
        ):
            stored = io.BytesIO()
            np.save(stored, np.asfortranarray(array))  # like coordinates side by side compress better
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), stored.getvalue(), 8, 9)
    return content.getvalue()


def _line(name: str, key: str, what: str, material: str, **placement: Sequence[float]) -> str:
    numbers = "".join(
        f", {k} = [{', '.join(f'{x + 0.0:.6g}' for x in v)}]" for k, v in placement.items() if v is not None
    )
    return f'    {{ name = "{name}", {key} = "{what}", material = "{material}"{numbers} }},'


def building(
    name: str, kind: str, material: str, place: Sequence[float], turn: float, tall: float
) -> list[str]:
    """The lines of a frame and of what stands in it."""
    x, z = place
    lines = [
        _line(
            name,
            "mesh",
            f"city_{kind}.npz",
            material,
            position=(x, 0.3, z),
            rotation=(0, turn, 0),
            scale=(1, tall, 1),
        )
    ]
    for number, (width, depth, foot, top) in enumerate(BODIES[kind], 1):
        lines.append(
            _line(
                f"{name} glass {number}",
                "shape",
                "cube",
                "glass",
                position=(x, 0.3 + (foot + top) / 2 * tall, z),
                rotation=(0, turn, 0),
                scale=(width, (top - foot) * tall, depth),
            )
        )
    return lines


def city() -> list[str]:
    """A line for each object."""
    rng = np.random.default_rng(11)
    lines: list[str] = []
    middle = (BLOCKS - 1) / 2
    for row in range(BLOCKS):
        for column in range(BLOCKS):
            x, z = (column - middle) * PITCH, (row - middle) * PITCH
            name = f"block {'ABCDEFGHIJKLMN'[row]}{column + 1}"
            lines += block(name, x, z, rng)
    return lines


def hills() -> list[str]:
    """Low domes on the horizon."""
    rng = np.random.default_rng(3)
    lines = []
    for number, x in enumerate(np.linspace(-1700, 3100, 17), 1):
        place = (x, -20, -1000 - rng.uniform(0, 800))
        size = (rng.uniform(700, 1200), rng.uniform(180, 420), rng.uniform(500, 900))
        lines.append(_line(f"hill {number}", "shape", "sphere", "hills", position=place, scale=size))
    return lines


def block(name: str, x: float, z: float, rng: np.random.Generator) -> list[str]:
    """The pavement of a block with its buildings, or a park. The middle is the tower's."""
    side = PITCH - STREET
    distance = float(np.hypot(x, z))
    park = distance > 10 and rng.random() < 0.13
    ground = "grass" if park else "pavement"
    lines = [_line(name, "shape", "cube", ground, position=(x, 0.15, z), scale=(side, 0.3, side))]
    if distance < 10:
        lines.append(_line("tower", "mesh", "city_tower.npz", "bronze", position=(x, 0.3, z)))
        lines.append(_line("tower glass", "mesh", "city_tower_body.npz", "glass", position=(x, 0.3, z)))
        return lines
    trees: list[tuple[float, float]] = []
    if park:
        trees += [(float(a), float(b)) for a, b in rng.uniform(-side / 2 + 3, side / 2 - 3, (9, 2))]
    else:
        lines += _buildings(name, x, z, distance, rng)
        corner = side / 2 - 1.8
        trees += [(s * corner, t * corner) for s in (-1, 1) for t in (-1, 0, 1)]
    for number, (a, b) in enumerate(trees, 1):
        size = float(rng.uniform(0.75, 1.3))
        lines.append(
            _line(
                f"{name} tree {number}",
                "mesh",
                "city_tree.npz",
                "leaves",
                position=(x + a, 0.3, z + b),
                rotation=(0, float(rng.integers(0, 360)), 0),
                scale=(size, size, size),
            )
        )
    return lines


def _buildings(name: str, x: float, z: float, distance: float, rng: np.random.Generator) -> list[str]:
    """One large building or two rows of flats; the taller, the nearer to the middle."""
    material = str(rng.choice(["concrete", "brick", "sandstone", "white"], p=[0.3, 0.25, 0.25, 0.2]))
    tall = float(np.clip(1.25 - distance / 420 + rng.normal(0, 0.12), 0.55, 1.5))
    turn = float(rng.choice([0.0, 90.0]))
    kind = str(rng.choice(["office", "stepped", "slab", "housing"], p=[0.25, 0.22, 0.18, 0.35]))
    if kind != "housing":
        return building(f"{name} {kind}", kind, material, (x, z), turn, tall)
    lines: list[str] = []
    for number, shift in enumerate((-8.4, 8.4), 1):
        place = (x + shift, z) if turn == 90 else (x, z + shift)
        lines += building(f"{name} flats {number}", kind, material, place, turn, min(tall, 1.1))
    return lines


HEAD = """\
# A city of {objects} objects that share {meshes} meshes; the frame of its tower has {triangles:,} triangles.
# Written by make_city.py; change that instead.
version = 1
camera = {{ position = [-290.0, 120.0, 590.0], target = [12.0, 66.0, 0.0], fov_y = 26.0 }}
environment = {{ color = [0.42, 0.6, 0.9], intensity = 0.9 }}
render = {{ size = [960, 540], max_bounces = 3 }}
objects = [
"""

TAIL = """\
]

[materials.asphalt]
base_color = [0.09, 0.09, 0.1]
specular = 0.0

[materials.pavement]
base_color = [0.36, 0.35, 0.33]
specular = 0.0

[materials.grass]
base_color = [0.1, 0.2, 0.04]
specular = 0.0

[materials.hills]
base_color = [0.13, 0.21, 0.12]
specular = 0.0

[materials.leaves]
base_color = [0.09, 0.22, 0.05]
specular = 0.0

[materials.concrete]
base_color = [0.5, 0.49, 0.47]
specular = 0.0

[materials.white]
base_color = [0.78, 0.77, 0.74]
specular = 0.0

[materials.sandstone]
base_color = [0.62, 0.47, 0.31]
specular = 0.0

[materials.brick]
base_color = [0.46, 0.17, 0.1]
specular = 0.0

[materials.bronze]
base_color = [0.9, 0.68, 0.42]
metallic = 1.0
roughness = 0.45

[materials.glass] # of windows: opaque, a dark room behind
base_color = [0.02, 0.03, 0.035]
roughness = 0.15
ior = 1.8

[materials.water]
base_color = [0.015, 0.05, 0.07]
roughness = 0.2
ior = 1.33

[materials.sun]
base_color = [0.0, 0.0, 0.0]
emission = [330.0, 265.0, 185.0]
"""


def main(folder: Path) -> None:
    """Writes the scene and its meshes."""
    made = meshes()
    for name, mesh in made.items():
        (folder / f"city_{name}.npz").write_bytes(npz(mesh))
    reach = BLOCKS * PITCH
    lines = [
        _line("streets", "shape", "cube", "asphalt", position=(0, -5, 0), scale=(reach, 10, reach)),
        _line(
            "land", "shape", "cube", "grass", position=(0, -5.5, -2000 + reach / 2), scale=(8000, 10, 4000)
        ),
        _line("river", "shape", "plane", "water", position=(0, -4, 1000), scale=(8000, 1, 6000)),
        _line(
            "sun",
            "shape",
            "plane",
            "sun",
            position=(-620, 560, 340),
            rotation=(128.378, 118.74, 0),
            scale=(120, 1, 120),
        ),
        *hills(),
        *city(),
    ]
    head = HEAD.format(objects=len(lines), meshes=len(made), triangles=len(made["tower"][1]))
    (folder / "city.toml").write_text(head + "\n".join(lines) + "\n" + TAIL, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
