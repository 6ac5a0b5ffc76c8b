"""Makes many_lamps.toml: `python scenes/make_many_lamps.py [FOLDER]`, in a moment.

A market in an alley after rain. Strings of bulbs hang across it, lanterns at the stalls, and the gate and
the trees at its end are drawn in bulbs: every one is a light of its own. Lengths are metres; the same run
gives the same file.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

Place = tuple[float, float, float]

WARM, AMBER, ROSE = (1.0, 0.5, 0.18), (1.0, 0.25, 0.03), (1.0, 0.05, 0.1)
TEAL, BLUE, VIOLET = (0.03, 0.8, 0.5), (0.06, 0.2, 1.0), (0.45, 0.08, 1.0)
MOTLEY = (WARM, AMBER, ROSE, TEAL, BLUE, VIOLET)
FABRICS = ("red cloth", "teal cloth", "ochre cloth", "white cloth")
HALF_WIDTH, STALL = 3.1, 3.25
"""Of the alley, from its middle to the stalls; and of a stall with its gap, along the alley."""


def numbers(values: tuple[float, ...]) -> str:
    """A list as TOML has it."""
    return "[" + ", ".join(f"{value:.4g}" for value in values) + "]"


FILE = """\
# A night market: {} lights and {} objects.
# Written by make_many_lamps.py; change that instead.
version = 1
camera = {{ position = [0.55, 1.55, 6.6], target = [-0.15, 1.85, -10.0], fov_y = 42.0 }}
environment = {{ color = [0.004, 0.006, 0.014] }}
render = {{ size = [960, 540], max_bounces = 3 }}
objects = [
    {},
]
lights = [
    {},
]

"""
MATERIALS = """\
[materials]
street = { base_color = [0.05, 0.052, 0.06], roughness = 0.24 }
wood = { base_color = [0.3, 0.17, 0.09], roughness = 0.5 }
"dark wood" = { base_color = [0.1, 0.06, 0.04], roughness = 0.45 }
plaster = { base_color = [0.4, 0.37, 0.34], specular = 0.0 }
lacquer = { base_color = [0.5, 0.04, 0.03], roughness = 0.28 }
"red cloth" = { base_color = [0.6, 0.06, 0.05], specular = 0.0 }
"teal cloth" = { base_color = [0.05, 0.35, 0.36], specular = 0.0 }
"ochre cloth" = { base_color = [0.65, 0.38, 0.08], specular = 0.0 }
"white cloth" = { base_color = [0.7, 0.66, 0.6], specular = 0.0 }
fruit = { base_color = [0.85, 0.3, 0.04], roughness = 0.4 }
lime = { base_color = [0.35, 0.6, 0.08], roughness = 0.35 }
plum = { base_color = [0.25, 0.05, 0.2], roughness = 0.25 }
copper = { base_color = [0.93, 0.51, 0.36], metallic = 1.0, roughness = 0.22 }
"""


class Market:
    """What stands in the file so far: objects and lights, each a line."""

    def __init__(self) -> None:
        self.random = np.random.default_rng(11)
        self.objects: list[str] = []
        self.lights: list[str] = []

    def add(
        self, shape: str, material: str, position: Place, scale: Place, rotation: Place = (0, 0, 0)
    ) -> None:
        """An object."""
        turned = f", rotation = {numbers(rotation)}" if any(rotation) else ""
        self.objects.append(
            f'{{ name = "{shape} {len(self.objects)}", shape = "{shape}", material = "{material}", '
            f"position = {numbers(position)}{turned}, scale = {numbers(scale)} }}"
        )

    def bulb(self, position: Place, color: Place, power: float, radius: float = 0.034) -> None:
        """A ball that shines."""
        self.lights.append(
            f'{{ name = "{len(self.lights)}", kind = "sphere", radius = {radius:g}, '
            f"position = {numbers(position)}, power = {0.8 * power:.2g}, color = {numbers(color)} }}"
        )

    def string(
        self, start: Place, end: Place, count: int, sag: float, colors: tuple[Place, ...], power: float
    ) -> None:
        """Bulbs along a cord that hangs through."""
        for i, t in enumerate((np.arange(count) + 0.5) / count):
            x, y, z = (1 - t) * np.array(start) + t * np.array(end) + self.random.normal(0, 0.012, 3)
            self.bulb((x, y - 4 * sag * t * (1 - t), z), colors[i % len(colors)], power)

    def stall(self, side: float, z: float) -> None:
        """A counter with goods below a tilted cloth, on four posts."""
        x, cloth = side * (HALF_WIDTH + 0.75), FABRICS[self.random.integers(len(FABRICS))]
        self.add("cube", "wood", (x, 0.45, z), (1.1, 0.9, 2.5))
        self.add("cube", "dark wood", (x + side * 1.2, 1.2, z), (0.1, 2.4, 2.7))
        for dz in (-1.3, 1.3):
            self.add("cylinder", "dark wood", (side * (HALF_WIDTH + 0.1), 1.2, z + dz), (0.07, 2.4, 0.07))
        self.add("cube", cloth, (x - side * 0.2, 2.5, z), (2.3, 0.03, 2.9), (0, 0, -side * 16))
        self.add("cube", cloth, (side * (HALF_WIDTH - 0.5), 2.07, z), (0.02, 0.3, 2.9))
        for row in range(3):
            for place in range(9):
                at = (x - side * (0.35 - 0.3 * row), 0.98 + 0.03 * row, z - 1.1 + 0.27 * place)
                goods = ("fruit", "lime", "plum", "copper")[(row + self.random.integers(2) + place // 3) % 4]
                size = self.random.uniform(0.15, 0.21)
                self.add("sphere", goods, at, (size, size, size))
        color = (WARM, AMBER)[self.random.integers(2)]
        self.string((x, 2.25, z - 1.2), (x, 2.25, z + 1.2), 8, 0.06, (color,), 1.6)
        for dz in (-1.25, 1.25):
            self.bulb((side * (HALF_WIDTH - 0.35), 1.72, z + dz), (1.0, 0.16, 0.04), 4.0, 0.14)

    def gate(self, z: float) -> None:
        """Two pillars and two beams, their edges drawn in bulbs."""
        for x in (-2.6, 2.6):
            self.add("cylinder", "lacquer", (x, 2.4, z), (0.5, 4.8, 0.5))
            for turn in np.linspace(0, 14 * np.pi, 150):
                y = 0.2 + 4.3 * turn / (14 * np.pi)
                self.bulb((x + 0.29 * np.cos(turn), y, z + 0.29 * np.sin(turn)), ROSE, 0.5)
        for y, width in ((4.1, 6.6), (5.0, 8.0)):
            self.add("cube", "lacquer", (0, y, z), (width, 0.35, 0.5))
            for edge in (-0.22, 0.22):
                start, end = (-width / 2, y + edge, z + 0.3), (width / 2, y + edge, z + 0.3)
                self.string(start, end, 84, 0.0, (AMBER, WARM), 0.6)
        self.add("cube", "dark wood", (0, 5.45, z), (8.8, 0.12, 1.6))

    def tree(self, x: float, z: float, colors: tuple[Place, ...]) -> None:
        """A trunk, and bulbs where its leaves were."""
        self.add("cylinder", "dark wood", (x, 1.2, z), (0.28, 2.4, 0.28))
        for i in range(260):
            y, turn = 1 - 2 * (i + 0.5) / 260, i * 2.39996
            around, reach = np.sqrt(1 - y * y), 1.5 * self.random.uniform(0.82, 1.0)
            at = (
                x + reach * around * np.cos(turn),
                3.6 + 1.25 * reach * y,
                z + reach * around * np.sin(turn),
            )
            self.bulb(at, colors[i % len(colors)], 0.5)

    def text(self) -> str:
        """The text of the file."""
        self.add("plane", "street", (0, 0, -20), (60, 1, 100))
        for side in (-1.0, 1.0):
            for i in range(11):
                self.stall(side, 1.0 - STALL * i + 0.8 * (side > 0))
            for i in range(6):
                height = self.random.uniform(5.5, 9)
                place = (side * (HALF_WIDTH + 5.2), height / 2, 1 - 6.6 * i)
                self.add("cube", "plaster", place, (5, height, 6.3))
            self.string((side * 2.5, 2.12, 2.5), (side * 2.5, 2.12, -33), 220, 0.0, (WARM,), 0.5)
        for i in range(26):
            z = 2.2 - 1.35 * i
            colors = (MOTLEY, (WARM,), (AMBER, ROSE), (TEAL, BLUE, VIOLET))[i % 4]
            left, right, aside = self.random.uniform((3.6, 3.6, -0.5), (4.0, 4.0, 0.5)).tolist()
            self.string((-3.0, left, z), (3.0, right, z + aside), 34, 0.55, colors, 0.8)
        self.gate(-35.5)
        self.tree(-5.2, -38, (WARM, AMBER))
        self.tree(5.0, -39, (BLUE, VIOLET))
        self.tree(-1.6, -43, (TEAL,))
        self.tree(1.9, -44, (ROSE, AMBER))
        lists = (",\n    ".join(lines) for lines in (self.objects, self.lights))
        return FILE.format(len(self.lights), len(self.objects), *lists) + MATERIALS


def main(folder: Path) -> None:
    """Write the file into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "many_lamps.toml").write_text(Market().text(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
