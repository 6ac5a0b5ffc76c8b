"""What keys of scene files mean, where no docstring has a line for each of them."""

from __future__ import annotations

VALUES: dict[tuple[str, object], str] = {
    ("slots_per_step", None): "whole number, 1 to 16777216",
    ("wrap", ("repeat", "repeat")): '`"repeat"`, `"mirror"` or `"clamp"`, or a list of two of them',
    ("image", None): "name of an image",
    ("sky", None): "table",
}
"""What cannot be asked of the checks, by key and default."""

FILE = {
    "version": "`2`; files of version 1, which has no textures, are read too. It has to be there.",
    "camera": "A camera, which is then called `camera`; without any there is one with the defaults.",
    "cameras": "Tables `[cameras.NAME]`, a camera each.",
    "active_camera": "The name of the camera that the scene is seen through; without it the first.",
    "environment": "Light from far away, with `[environment.sky]`.",
    "render": "How the scene proposes to be rendered.",
    "materials": "Tables `[materials.NAME]`, at most 65,534.",
    "objects": "Tables `[[objects]]`, one for each object.",
    "lights": "Tables `[[lights]]`, one for each light.",
}

CAMERA = {
    "position": "where it stands, world space, metres",
    "target": "the point in the middle of the picture, where that is not shifted, world space, metres",
    "shift_x": "how far the picture is moved right in its plane, as a fraction of its larger side",
    "shift_y": "the same upwards: vertical lines stay vertical where it looks up instead of the target",
}

ENVIRONMENT = {
    "color": "radiance; beside an image or a sky a factor of it, and then `[1, 1, 1]` by default",
    "image": "lat-long image, relative to the scene file: OpenEXR, Radiance, or one for displays",
    "rotation_y": "turns the image, or the sky with its sun, right-handed about +y, degrees",
    "intensity": "factor of colour, image and sky",
    "sky": "a clear sky with its sun, in place of an image: see [below](#sky)",
}

_TEXTURE_OF = {
    "base_color": "colour times `base_color`; its alpha times `alpha`",
    "metallic_roughness": "blue times `metallic`, green times `roughness`",
    "normal": "bends the shading normal: red along the tangent, green upwards in the image",
    "emission": "colour times `emission`, which is black unless it is given",
    "transmission": "red times `transmission`",
    "specular": "alpha times `specular`",
    "specular_color": "colour times `specular_color`",
    "clearcoat": "red times `clearcoat`",
    "clearcoat_roughness": "green times `clearcoat_roughness`",
    "clearcoat_normal": "bends the clearcoat's normal, which is smooth without it",
    "sheen_color": "colour times `sheen_color`",
    "sheen_roughness": "alpha times `sheen_roughness`",
    "anisotropy": "blue times `anisotropy`; red and green are its direction",
    "iridescence": "red times `iridescence`",
    "iridescence_thickness": "green leads from `iridescence_least_thickness` to `iridescence_thickness`",
    "diffuse_transmission": "alpha times `diffuse_transmission`",
    "diffuse_transmission_color": "colour times `diffuse_transmission_color`",
    "bump": "red times `bump_scale` is a height over the surface",
}
VALUES |= {(f"{slot}_texture", None): "[texture](#textures)" for slot in _TEXTURE_OF}

MATERIAL = {
    "base_color": "diffuse albedo, of metals the reflectance, of glass a tint of the surface; linear",
    "metallic": "0: dielectric, 1: metal",
    "roughness": "GGX alpha is its square",
    "specular": "scales the dielectric layer; 0 is exactly Lambertian",
    "ior": "index of refraction, of the dielectric layer and of glass",
    "transmission": "share of the light that goes through unscattered; 1: glass",
    "absorption": "per metre of the way inside of a transmissive body",
    "priority": "where transparent bodies overlap the higher one wins; 0 is the highest of all",
    "emission": "radiance, from the front side; linear",
    "double_sided": "whether it emits from its back side too",
    "alpha": "share of what is behind it that it covers, where `alpha_mode` uses it",
    "alpha_mode": "`opaque`: alpha means nothing; `mask`: all is covered from `alpha_cutoff` on; `blend`: "
    "alpha is the share that is covered",
    "alpha_cutoff": "from which alpha on a mask covers",
    "normal_scale": "times the slopes of `normal_texture`; below 0 bumps are dents",
    "specular_color": "colour of the dielectric layer; linear",
    "clearcoat": "share that a colourless lacquer covers, of an index of refraction of 1.5",
    "clearcoat_roughness": "of the lacquer; GGX alpha is its square",
    "clearcoat_normal_scale": "times the slopes of `clearcoat_normal_texture`",
    "sheen_color": "fuzz of cloth; black: none",
    "sheen_roughness": "low: the fuzz is seen at the edges only",
    "anisotropy": "how far reflections are stretched, along the direction of u, or around the object's y "
    "axis where the mesh has no texture coordinates",
    "anisotropy_rotation": "turns that direction, degrees, counter-clockwise",
    "iridescence": "share that a thin film covers",
    "iridescence_ior": "index of refraction of the film",
    "iridescence_thickness": "of the film, nm; where its texture is white",
    "iridescence_least_thickness": "of the film, nm, where its texture is black",
    "diffuse_transmission": "share of the diffuse light that goes through to the other side: leaves, paper",
    "diffuse_transmission_color": "colour of that light; linear",
    "thin_walled": "whether what is transmissive is a wall without a thickness, and no body",
    "dispersion": "20 over Abbe's number: how far glass parts colours",
    "bump_scale": "how much higher white of `bump_texture` is than black, metres of the world; below 0 bumps "
    "are dents",
    "unlit": "whether it shines with its base colour on both sides, and reflects nothing",
    **{f"{slot}_texture": text for slot, text in _TEXTURE_OF.items()},
}

TEXTURE_FILE = {
    "file": ("name of an image", "has to be there", "relative to the scene file"),
    "image": ("whole number, 0 to 65535", "–", "of a glTF file: which of its images, counted from 0"),
}
TEXTURE = {
    "wrap": "beyond the edges: the image again, its mirror image, or the pixels at its edge; of two texts "
    "the first is along u, the second along v",
    "filter": "between the centres of pixels: interpolated, or the nearest one",
    "offset": "what is read lies at offset + rotation (scale (u, v)), as in KHR_texture_transform",
    "rotation": "degrees, counter-clockwise as seen on the image",
    "scale": "how often the image comes along u and v",
}

_PLACEMENT = {
    "position": ("list of 3 numbers, each -1e9 to 1e9", "`[0.0, 0.0, 0.0]`", "of its origin, metres"),
    "rotation": (
        "list of 3 numbers, each -1e9 to 1e9", "`[0.0, 0.0, 0.0]`", "degrees about x, then y, then z",
    ),
    "scale": (
        "list of 3 numbers, each -1e9 to 1e9, none below 1e-6 without its sign", "`[1.0, 1.0, 1.0]`",
        "factors along its own axes",
    ),
    "matrix": (
        "three or four rows of four numbers", "–",
        "an affine matrix in place of the three, where they do not describe the placement: shear",
    ),
    "visible": ("`true` or `false`", "`true`", "whether it is there"),
}  # fmt: skip

OBJECT = {
    "name": ("text", "has to be there", "differs from those of all other objects and lights"),
    "shape": ("one of the shapes below", "–", "a built-in mesh; either this or `mesh`"),
    "mesh": ("name of a [mesh file](files.md)", "–", "relative to the scene file"),
    "part": ("text", "–", "one mesh of a file with several, as the file places it; without it all of them"),
    "geometry": ("text", "–", "one mesh of a file, in its own space; not beside `part`"),
    "material": ("text", "has to be there", "the name of one of `[materials]`"),
    **_PLACEMENT,
}

_STRENGTH = "number, 0 to 1e12"
LIGHT = {
    "name": ("text", "has to be there", "differs from those of all other lights and objects"),
    "kind": (
        '`"point"`, `"spot"`, `"sun"`, `"rectangle"`, `"disk"` or `"sphere"`', "has to be there",
        "see [below](#kinds-of-lights)",
    ),
    "power": (_STRENGTH, "100, but of a sun", "radiant power in all directions together, watt"),
    "radiance": (_STRENGTH, "–", "of its surface, W / (m² sr); only with a size"),
    "irradiance": (_STRENGTH, "3 of a sun", "on a surface that faces a sun, W / m²"),
    **_PLACEMENT,
}  # fmt: skip

EDITS_FILE = {
    "capture": (
        "list of whole numbers", "`[0, 2, 5, 10]`", "steps after each edit at which pictures are taken",
    ),
    "cumulative": (
        "`true` or `false`", "`true`", "each edit upon the one before; `false`: each upon the scene",
    ),
    "edits": (
        "tables `[[edits]]`", "has to be there", "the edits, ordered by step where they are cumulative",
    ),
}  # fmt: skip

EDIT = {
    "name": ("text", "the name of the target", "label of the edit in tables and names of files"),
    "step": (
        "whole number, 0 to 10000000",
        "`0`",
        "rendering step after the base picture at which it happens",
    ),
    "pixel": ("list of 2 whole numbers", "–", 'the point of change, for `point_of_change = "pixel"`'),
    "capture": ("list of whole numbers", "the file's", "steps at which pictures are taken after this edit"),
    "object": ("text", "–", "target: an object by its name"),
    "material": ("text", "–", "target: a material by its name; beside `object` a new value of it"),
    "light": ("text", "–", "target: a light by its name"),
    "camera": ("`true` or text", "–", "target: the active camera, or one by its name"),
    "environment": ("`true`", "–", "target: the environment"),
}

EDIT_VALUES = {
    "object": "those of `[[objects]]` but `name`",
    "material": "those of `[materials.NAME]`; `false` takes a texture away",
    "light": "those of `[[lights]]` but `name`",
    "camera": "those of `[camera]`, and `active = true`: the scene is seen through it from then on",
    "environment": "those of `[environment]`; `sky` is a table with the keys of `[environment.sky]`",
}
