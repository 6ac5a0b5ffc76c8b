"""`incpt bench agreement`: scenes of Mitsuba as incpt opens them, beside Mitsuba: the means of both."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer
from rich.console import Console
from rich.table import Table

from incpt.benchmarks.kit import options
from incpt.core.errors import InputError, one_line
from incpt.device.device import Device
from incpt.formats import images, registry
from incpt.formats.import_report import Fate
from incpt.render.session import Session

FloatImage = npt.NDArray[np.float32]
_LARGEST_SIDE = 240
"""Pixels: the films of scenes are made that small."""
_VARIANTS = ("scalar_rgb", "llvm_ad_rgb", "scalar_spectral", "llvm_ad_spectral")


def agreement(
    scenes: Annotated[list[Path], typer.Argument(help="Scenes of Mitsuba (.xml).", show_default=False)],
    spp: Annotated[int, typer.Option(help="Samples per pixel of both.", min=1)] = 128,
    variant: Annotated[
        str, typer.Option(help="Of Mitsuba; a spectral one for metals by name, whose RGB one tints.")
    ] = "scalar_rgb",
    device: options.DeviceOption = None,
    output: options.OutputOption = options.DEFAULT_FOLDER,
) -> None:
    """Scenes of Mitsuba beside Mitsuba itself: means of both pictures, which are written side by side."""
    if variant not in _VARIANTS:
        raise InputError(f"--variant: {variant!r} is not known; choose one of {', '.join(_VARIANTS)}")
    table = Table("scene", "incpt", "Mitsuba", "red, green, blue %", "mean %", "told")
    folder = output / "agreement"
    folder.mkdir(parents=True, exist_ok=True)
    opened = Device(device)
    # Its LLVM and its Embree do not meet ours.
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        for number, path in enumerate(scenes):
            try:
                theirs = pool.submit(_mitsubas, str(path), spp, variant).result()
            except (ImportError, RuntimeError, BrokenProcessPool) as error:
                table.add_row(path.name, "", one_line(error)[:60])
                continue
            ours, told = _ours(path, spp, (theirs.shape[1], theirs.shape[0]), opened)
            a, b = ours.mean(axis=(0, 1)), theirs.mean(axis=(0, 1))
            parts = " ".join(f"{100 * (x / y - 1):+.2f}" if y > 0 else "–" for x, y in zip(a, b, strict=True))
            mean = f"{100 * (a.mean() / b.mean() - 1):+.2f}" if b.mean() > 0 else "–"
            table.add_row(path.name, f"{a.mean():.4f}", f"{b.mean():.4f}", parts, mean, str(told))
            beside = np.concatenate([ours, theirs, 2 * np.abs(ours - theirs)], axis=1)
            images.write_png(folder / f"{number:02d}-{path.stem}.png", beside, curve="srgb")
    Console().print(table)


def _ours(path: Path, spp: int, size: tuple[int, int], device: Device) -> tuple[FloatImage, int]:
    """The picture of incpt, and how many things are told of the scene that differ."""
    scene, report = registry.load_with_report(path, allow_outside=True)
    settings = replace(scene.settings, strategy="restart", size=size)
    session = Session(scene, settings=settings, device=device)
    session.render(spp)
    told = [remark for remark in report.remarks if remark.fate is not Fate.READ]
    return np.asarray(session.image(), np.float32)[..., :3], len(told)


def _mitsubas(path: str, spp: int, variant: str) -> FloatImage:
    """The picture of Mitsuba, on a film of at most `_LARGEST_SIDE` pixels a side."""
    import mitsuba as mi

    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    scene: Any = mi.load_file(path)
    parameters: Any = mi.traverse(scene)
    for key in [str(key) for key in parameters.keys() if str(key).endswith("film.size")]:  # noqa: SIM118
        width, height = (int(n) for n in np.array(parameters[key]).ravel())
        scale = max(max(width, height) / _LARGEST_SIDE, 1.0)
        small = mi.ScalarVector2u(round(width / scale), round(height / scale))
        parameters[key] = small
        parameters[key.replace("film.size", "film.crop_size")] = small
    parameters.update()
    return np.asarray(np.array(mi.render(scene, spp=spp))[..., :3], np.float32)
