"""`incpt render`: a scene as a picture."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from incpt.cli.console import Stopped, complain, interruption, path_progress
from incpt.cli.options import (
    BouncesOption,
    ClipOption,
    DeviceOption,
    MissingOption,
    OutsideOption,
    ParameterOption,
    SceneArgument,
    SeedOption,
    SizeOption,
    StrictOption,
    TimeOption,
    UnitOption,
    UpOption,
    import_options,
    padded_pixels,
    settings_from,
)
from incpt.core.errors import InputError
from incpt.core.settings import CUT_OFF_WORTH_TELLING, STRATEGIES

if TYPE_CHECKING:
    from incpt.render.final import FinalRender
    from incpt.render.session import Session, StepReport
    from incpt.scene.model import Scene


def render(
    scene_file: SceneArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help=".exr: linear radiance; .png: tone-mapped sRGB.")
    ],
    spp: Annotated[int, typer.Option(help="Samples per pixel.", min=1)] = 256,
    size: SizeOption = None,
    seed: SeedOption = None,
    strategy: Annotated[str | None, typer.Option(help=f"{' or '.join(STRATEGIES)}.")] = None,
    max_bounces: BouncesOption = None,
    texture_limit: Annotated[
        int | None, typer.Option(help="Halve images with more pixels a side, where memory is short.", min=0)
    ] = None,
    camera: Annotated[
        str | None, typer.Option(help="A camera of the scene by its name, in place of the active one.")
    ] = None,
    aovs: Annotated[
        bool,
        typer.Option(
            "--aovs",
            help="Add base colours and normals (means over the samples), depth and object ids (at pixel "
            "centres) to the .exr.",
        ),
    ] = False,
    transparent: Annotated[
        bool,
        typer.Option(
            "--transparent",
            help="Leave out the environment behind everything, and give the picture an alpha.",
        ),
    ] = False,
    denoise: Annotated[
        bool,
        typer.Option(
            "--denoise",
            help="Show a denoised picture in the .png, or add one to the .exr as a layer, as far as there is "
            "noise; needs the extra denoise.",
        ),
    ] = False,
    time: TimeOption = None,
    clip: ClipOption = None,
    frames: Annotated[
        str | None,
        typer.Option(
            help="A sequence of pictures, such as 1-48: frame N shows N / fps seconds of animations."
        ),
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames per second of a sequence.", min=1e-3)] = 24.0,
    strict: StrictOption = False,
    allow_outside: OutsideOption = False,
    allow_missing: MissingOption = False,
    up: UpOption = None,
    unit: UnitOption = None,
    define: ParameterOption = None,
    device: DeviceOption = None,
) -> None:
    """Render a scene to a picture. Ctrl-C keeps what is done."""
    from incpt.render.final import FinalRender, FinalSettings
    from incpt.render.session import Session

    if aovs and output.suffix.lower() != ".exr":
        raise InputError(f"--aovs: {output} cannot hold them; use an .exr")
    wanted = FinalSettings(output, spp, aovs=aovs, denoise=denoise)
    wanted.check_place()
    asked = import_options(
        up, unit, define, clip=clip, allow_outside=allow_outside, allow_missing=allow_missing
    )
    shots = [(output, time)] if frames is None else _shots(output, frames, fps, time)
    session: Session | None = None
    for path, moment in shots:
        scene = _scene(scene_file, strict, session is None, time=moment, **asked)
        scene = scene if camera is None else scene.with_active_camera(camera)
        if session is None:
            settings = settings_from(
                scene,
                size=size,
                seed=seed,
                strategy=strategy,
                max_bounces=max_bounces,
                texture_limit=texture_limit,
            )
            settings = replace(settings, transparent=settings.transparent or transparent)
            wanted = replace(wanted, aovs=aovs or settings.aovs)
            if frames is not None:
                # They are pictures of their own: nothing of the one before is kept.
                settings = replace(settings, strategy="restart")
            session = Session(scene, settings=wanted.of_session(settings), device=device)
        else:
            session.edit(_seen_as(session.scene, scene))
        _render_picture(FinalRender(session, replace(wanted, path=path)))


def _render_picture(final: FinalRender) -> None:
    """Raises Stopped after Ctrl-C, with what is done in the file."""
    session, spp = final.session, final.wanted.spp
    pixels, tally = padded_pixels(session.settings), _Tally()
    with interruption() as stop, path_progress("rendering", spp * pixels, pixels) as progress:
        try:
            while not final.is_done:
                report = final.step()
                tally.add(report)
                progress.advance(report.paths)
                stop.check()
        except KeyboardInterrupt:
            if not stop.requested:
                raise
        # Still inside, so that another Ctrl-C does not tear the picture that is kept.
        final.write()
    tally.complain()
    print(f"{final.wanted.path}: {session.size[0]} x {session.size[1]}, {final.spp} samples per pixel")
    if stop.requested:
        raise Stopped(f"stopped at {final.spp} of {spp} samples per pixel")


def _seen_as(first: Scene, scene: Scene) -> Scene:
    """A later scene of a sequence. A file without a camera of its own is framed anew at each time, which
    would hold what moves in the middle: it is seen as in the first picture."""
    from incpt.scene.model import CAMERA_NAME

    return replace(scene, camera=first.camera) if list(scene.cameras) == [CAMERA_NAME] else scene


def _shots(output: Path, frames: str, fps: float, time: float | None) -> list[tuple[Path, float | None]]:
    """The file and the time of each frame of a sequence. Raises InputError."""
    match = re.fullmatch(r"(\d{1,6})-(\d{1,6})", frames.strip())
    if match is None or int(match[1]) > int(match[2]):
        raise InputError(f"--frames: {frames!r} is no first and last frame; write them like 1-48")
    if time is not None:
        raise InputError("--time: stands beside --frames; give one or the other")
    numbers = range(int(match[1]), int(match[2]) + 1)
    return [(output.with_suffix(f".{number:04d}{output.suffix}"), number / fps) for number in numbers]


def _scene(file: Path, strict: bool, is_first: bool, **options: Any) -> Scene:
    """The scene of a file. Warns, if it is the first, of a picture that shows nothing and of what is left out
    of it: once, and in short. Raises InputError for the latter where that is asked for."""
    from incpt.formats import registry
    from incpt.formats.import_report import Fate
    from incpt.scene import summary

    scene, report = registry.load_with_report(file, **options)
    if strict:
        report.check_whole()
    if is_first:
        for problem in summary.scene_problems(scene):
            complain(f"warning: {file}: {problem}", 0)
        lost = report.of(Fate.LEFT_OUT)
        for remark in lost[:1]:
            more = f" (and {len(lost) - 1:,} more; `incpt check` tells all)" if len(lost) > 1 else ""
            complain(f"warning: {remark}{more}", 0)
    return scene


@dataclass
class _Tally:
    """What steps have counted."""

    paths: int = 0
    nonfinite: int = 0
    cut_off: int = 0

    def add(self, report: StepReport) -> None:
        self.paths += report.paths
        self.nonfinite += report.nonfinite
        self.cut_off += report.cut_off

    def complain(self) -> None:
        """Tell what is wrong with the picture."""
        if self.nonfinite:
            complain(f"warning: {self.nonfinite:,} samples were not finite and count as black", 0)
        if self.cut_off > CUT_OFF_WORTH_TELLING * self.paths:
            share = 100 * self.cut_off / self.paths
            complain(f"warning: {share:.1f} % of the paths ended in glass; raise transmission_bounces", 0)
