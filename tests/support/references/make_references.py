"""Renders the scenes of support/reference_scenes.py with Mitsuba 3, and stores what test_mitsuba.py reads.

    pip install mitsuba                    # 3.9 made the stored files; its LLVM variant needs libLLVM;
                                           # MITSUBA_VARIANT=scalar_rgb does without
    python tests/support/references/make_references.py [NAME ...]

Each NAME.npz holds `mean` (48, 64, 3) and `error` (same shape), the standard error of that mean from sixteen
independent renders, both float16.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1]))

from support.reference_scenes import REFERENCES, SIZE, Reference  # noqa: E402

from incpt.benchmarks.peers.mitsuba_scene import scene_dict  # noqa: E402

RENDERS = 16


def render(reference: Reference) -> tuple[Any, Any]:
    """Mean and standard error of RENDERS renders. A path of our `max_bounces` has two segments more, one
    before the first hit and one to the light; passages through glass are not counted apart there."""
    scene = reference.scene()
    glassy = any(m.transmission > 0 for m in scene.materials.values())
    depth = 64 if glassy else reference.max_bounces + 2
    with tempfile.TemporaryDirectory() as folder:
        loaded = mi.load_dict(scene_dict(scene, SIZE, depth, Path(folder)))
        spp = reference.reference_spp // RENDERS
        images = np.stack([np.array(mi.render(loaded, spp=spp, seed=seed)) for seed in range(RENDERS)])
    return images.mean(axis=0), images.std(axis=0, ddof=1) / np.sqrt(RENDERS)


def main(names: list[str]) -> None:
    """Render the named scenes, or all."""
    mi.set_variant(os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb"))
    for name in names or list(REFERENCES):
        mean, error = render(REFERENCES[name])
        np.savez_compressed(
            HERE / f"{name}.npz", mean=mean.astype(np.float16), error=error.astype(np.float16)
        )
        print(f"{name}: mean {mean.mean(axis=(0, 1))}, median error {np.median(error) / mean.mean():.2%}")


if __name__ == "__main__":
    main(sys.argv[1:])
