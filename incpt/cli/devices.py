"""`incpt devices`: the OpenCL devices, and which one is taken."""

from __future__ import annotations

from typing import Annotated

import typer

from incpt.cli.console import print_table
from incpt.cli.options import DeviceOption


def devices(
    device: DeviceOption = None,
    test: Annotated[bool, typer.Option("--test", help="Build and run a kernel on the chosen one.")] = False,
) -> None:
    """List the OpenCL devices, and which one is taken."""
    import pyopencl as cl
    from rich.markup import escape
    from rich.table import Table

    from incpt.device.device import all_devices, choose, device_name
    from incpt.render.session import Session
    from incpt.scene.model import Scene

    taken = choose(device)
    table = Table(box=None, pad_edge=False)
    for heading, side in (("", "right"), ("device", "left"), ("kind", "left"), ("units", "right")):
        table.add_column(heading, justify=side)  # type: ignore[arg-type]
    table.add_column("memory", justify="right")
    table.add_column("")
    for i, one in enumerate(all_devices()):
        table.add_row(
            str(i),
            escape(device_name(one)),
            "GPU" if one.type & cl.device_type.GPU else "CPU" if one.type & cl.device_type.CPU else "other",
            str(one.max_compute_units),
            f"{one.global_mem_size / 2**30:.1f} GiB",
            "taken" if one == taken else "",
        )
    print_table(table)
    if test:
        Session(Scene(), size=(16, 16), device=device).step()
        print("the kernels build and run")
