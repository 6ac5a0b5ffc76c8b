"""Small USD files, made in tests as text."""

from __future__ import annotations

from pathlib import Path

import pytest

from incpt.formats.import_report import ImportReport
from incpt.formats.registry import load_with_report
from incpt.scene.model import Scene

pytest.importorskip("pxr", reason="usd-core is not installed")

METRES = "metersPerUnit = 1"
QUAD = """
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
"""
"""A square from -1 to 1 in the plane of x and y, facing z."""
QUAD_MESH = f'def Mesh "quad" {{ {QUAD} }}'


def write_usda(path: Path, body: str, head: str = METRES) -> Path:
    """A text file of these prims, below this metadata of the layer. Braces may close in a line with what is
    between them, which the format does not have."""
    path.write_text(f"#usda 1.0\n(\n{head}\n)\n" + body.replace("}", "\n}\n"))
    return path


def load_usda(folder: Path, body: str, head: str = METRES, **options: object) -> tuple[Scene, ImportReport]:
    """The scene of such a file, and its report."""
    return load_with_report(write_usda(folder / "a.usda", body, head), **options)  # type: ignore[arg-type]


def placed(*operations: str) -> str:
    """The lines that place a prim by operations, each such as "double3 translate = (1, 2, 3)"."""
    lines = [one.replace(" ", " xformOp:", 1) for one in operations]
    names = ", ".join(f'"xformOp:{one.split()[1]}"' for one in operations)
    return "\n".join([*lines, f"uniform token[] xformOpOrder = [{names}]"])


def preview_surface(inputs: str, shaders: str = "", name: str = "look") -> str:
    """A material with one surface shader of these inputs, and further shaders beside it."""
    return f"""def Material "{name}" {{
        token outputs:surface.connect = </{name}/surface.outputs:surface>
        def Shader "surface" {{
            uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface
        }}
        {shaders}
    }}"""


def bound_quad(more: str = "", name: str = "look") -> str:
    """The square with a material."""
    return f"""def Mesh "quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        {QUAD}
        rel material:binding = </{name}>
        {more}
    }}"""


def uv_texture(file: str, inputs: str = "", name: str = "image", placed_by: str = "reader") -> str:
    """A shader that reads an image at what another shader of the material "look" says, and one that reads the
    texture coordinates "st"."""
    return f"""def Shader "{name}" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st.connect = </look/{placed_by}.outputs:result>
            {inputs}
            float3 outputs:rgb
            float outputs:r
            float outputs:g
            float outputs:b
            float outputs:a
        }}
        def Shader "reader" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}"""
