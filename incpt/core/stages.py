"""The stages that paths go through on each ray: in which order, which paths, and when.

`STAGES` is what says it, for both schedules. The wavefront (render/wavefront.py) launches a kernel for each
stage over a list of paths. Blocks of paths (cl/cpu/trace_blocks.cl) call a function for each, which loops
over paths of the block; the header has these calls as STAGES_OF_RAY.

Whether a condition holds is known at three times. Features are known when kernels are built: a stage that
lacks one is left out, and one that has it does not ask. Whether there is a sky, and whether lights differ
between two scenes, is known when paths are traced; the rest, ray by ray.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from enum import Flag, auto

from incpt.core import layout
from incpt.core.layout import PathList


class When(Flag):
    """Conditions of stages."""

    LIGHTS = auto()
    """There are lights to sample: emissive triangles, lights of their own, or an image of the environment."""
    LAMPS = auto()
    """Not only the environment is among them."""
    SHAPED_LIGHTS = auto()
    """There are lights that are objects of their own, which rays may meet."""
    LIGHT_TREE = auto()
    """Lights are so many that they are chosen, and met, by a tree."""
    MEDIA = auto()
    """There are materials that let light through."""
    AOVS = auto()
    """Auxiliary images are asked for."""
    CHANGES = auto()
    """It is asked of paths whether they meet something that changed between two scenes."""
    CHANGED_LIGHTS = auto()
    """Some of the lights differ between the two scenes."""
    SKY = auto()
    """The ray sees light from far away, if it meets nothing."""
    CAMERA_RAY = auto()
    """The ray comes from the camera."""
    GOES_ON = auto()
    """Paths may go on after the ray."""
    ENDS = auto()
    """All paths end with the ray. Where there are media, no ray is known to be the last."""


@dataclass(frozen=True)
class Stage:
    """A stage of a ray.

    kernel  the kernel of cl/path/ that does it for a list of paths; None: that of another stage does it.
    loop    the function of cl/cpu/trace_blocks.cl that does it for a block; None: that of another stage does
            it for these paths too.
    paths   which paths go through it.
    when    all that must hold.
    sorts   the lists that these paths then join, by what they wait for; LIVE is that of the next ray. Only a
            wavefront has lists: the functions of a block find their paths themselves.
    """

    kernel: str | None
    loop: str | None
    paths: PathList
    when: When = When(0)
    sorts: tuple[PathList, ...] = ()


_TOUCHES_LIGHTS = When.CHANGES | When.LAMPS | When.CHANGED_LIGHTS

STAGES = (
    Stage("intersect", "trace_rays", PathList.LIVE, sorts=(PathList.SURFACE, PathList.MISS, PathList.MEDIUM)),
    # The kernel `write_aovs` does it; a block no longer knows then which paths have met a light.
    Stage(None, "write_alpha", PathList.LIVE, When.AOVS | When.CAMERA_RAY),
    Stage("touch_rays", "touch_rays", PathList.LIVE, When.CHANGES),
    # The kernel that finds the hit of a ray ends the path where it is one on a light.
    Stage(None, "shade_lights", PathList.LIVE, When.SHAPED_LIGHTS),
    Stage("shade_miss", "shade_misses", PathList.MISS, When.SKY),
    Stage(None, "setup_surfaces", PathList.LIVE),
    Stage("write_aovs", "write_aovs", PathList.LIVE, When.AOVS | When.CAMERA_RAY),
    Stage("choose_lights", "choose_lights", PathList.SURFACE, When.LIGHT_TREE),
    Stage("choose_lights", None, PathList.MEDIUM, When.LIGHT_TREE | When.MEDIA),
    Stage("touch_lights", "touch_lights", PathList.SURFACE, _TOUCHES_LIGHTS | When.GOES_ON),
    Stage("touch_lights", None, PathList.MEDIUM, _TOUCHES_LIGHTS | When.MEDIA),
    Stage("sample_lights", None, PathList.SURFACE, When.LIGHTS | When.GOES_ON),
    Stage("sample_lights", None, PathList.MEDIUM, When.LIGHTS | When.MEDIA),
    # Paths that turn out to stand on an opaque surface join those that are shaded as such.
    Stage("shade_medium", "shade_media", PathList.MEDIUM, When.MEDIA,
          sorts=(PathList.SURFACE, PathList.SHADOW, PathList.LIVE)),
    Stage("shade", "shade_surfaces", PathList.SURFACE, When.GOES_ON, sorts=(PathList.SHADOW, PathList.LIVE)),
    Stage("shade", "finish_paths", PathList.SURFACE, When.ENDS),
    Stage("touch_shadow_rays", "touch_shadow_rays", PathList.SHADOW,
          When.CHANGES | When.LIGHTS | When.GOES_ON),
    Stage("trace_shadow", "trace_shadows", PathList.SHADOW, When.LIGHTS | When.GOES_ON),
)  # fmt: skip
"""All stages of a ray, in order. They lie between `generate`, which starts paths, and the next ray."""

_BY_FEATURES = (
    When.LIGHTS | When.LAMPS | When.SHAPED_LIGHTS | When.LIGHT_TREE | When.MEDIA | When.AOVS | When.CHANGES
)
_HOLDS = {
    "ENVIRONMENT_IMAGE": When.LIGHTS,
    "TRIANGLE_LIGHTS": When.LIGHTS | When.LAMPS,
    "SHAPED_LIGHTS": When.LIGHTS | When.LAMPS | When.SHAPED_LIGHTS,
    "LIGHT_TREE": When.LIGHT_TREE,
    "MEDIA": When.MEDIA | When.GOES_ON,
    "AOVS": When.AOVS,
    "CHANGES": When.CHANGES,
}
"""What holds on every ray where kernels have a feature."""

_IN_C = {
    When.CHANGED_LIGHTS: "(block)->changes->change.has_lights",
    When.SKY: "(ray)->number >= (block)->params->first_sky_ray",
    When.CAMERA_RAY: "(ray)->number == 0",
    When.GOES_ON: "(ray)->number != (block)->params->last_ray",
    When.ENDS: "(ray)->number == (block)->params->last_ray",
}
"""What a block asks."""


def stages_of(features: Collection[str]) -> tuple[Stage, ...]:
    """The stages of a ray where kernels have these features (program.FEATURES), in order; of their conditions
    those that features leave open."""
    holds = When(0)
    for name in _HOLDS.keys() & set(features):
        holds |= _HOLDS[name]
    fails = _BY_FEATURES & ~holds
    if When.GOES_ON in holds:
        fails |= When.ENDS
    return tuple(replace(stage, when=stage.when & ~holds) for stage in STAGES if not stage.when & fails)


def last_ray(max_bounces: int, has_media: bool) -> int:
    """The number of the last ray that a path may have. Without media every ray is a scattering event, so that
    it is the last of all paths."""
    return layout.MOST_RAYS - 1 if has_media else min(max_bounces + 1, layout.MOST_RAYS - 1)


def holding(ray: int, last: int, sees_sky: bool, has_changed_lights: bool = False) -> When:
    """What holds on ray number `ray`, beside what features say; `last` is the number of the last one."""
    holds = When.ENDS if ray == last else When.GOES_ON
    if ray == 0:
        holds |= When.CAMERA_RAY
    if sees_sky:
        holds |= When.SKY
    return holds | When.CHANGED_LIGHTS if has_changed_lights else holds


def c_header(features: Collection[str]) -> str:
    """OpenCL C text of STAGES_OF_RAY(block, ray) under these features."""
    calls = [_c_call(stage) for stage in stages_of(features) if stage.loop is not None]
    return "#define STAGES_OF_RAY(block, ray)" + "".join(f" \\\n    {call}" for call in calls) + "\n"


def _c_call(stage: Stage) -> str:
    conditions = " && ".join(text for when, text in _IN_C.items() if when in stage.when)
    return f"{f'if ({conditions}) ' if conditions else ''}{stage.loop}(block, ray);"
