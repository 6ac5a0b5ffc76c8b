"""Each renderer in a process of its own: their libraries (three LLVMs, two Embrees) do not meet, and one that
falls over takes only itself away. A worker waits, without using a core, until it is asked."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from multiprocessing.connection import Connection
from typing import Any

from incpt.benchmarks.peers.peer import FloatImage, Job, MissingPeer, make
from incpt.core.affine import Vector
from incpt.core.errors import one_line
from incpt.device.device import DEVICE_VARIABLE

_START_S = 300.0


class Worker:
    """The renderer `name`, with `threads` of its own; incpt on the `device` of that name. Implements Peer.
    Raises MissingPeer where it is not installed, and where its process ends before its time."""

    def __init__(self, name: str, threads: int, device: str | None = None) -> None:
        self.name = name
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(name, threads, device, other), daemon=True)
        self._process.start()
        other.close()
        try:
            if not self._pipe.poll(_START_S):
                raise MissingPeer(f"{name} did not start within {_START_S:.0f} s")
            self._answer()
        except BaseException:
            self.close()
            raise

    def load(self, job: Job) -> None:
        self._ask("load", job)

    def time(self, spp: int, seed: int) -> float:
        return float(self._ask("time", spp, seed))

    def image(self, spp: int, seed: int) -> FloatImage:
        image: FloatImage = self._ask("image", spp, seed)
        return image

    def move(self, name: str, position: Vector, seed: int) -> float:
        return float(self._ask("move", name, position, seed))

    def first_tiles(self, name: str, position: Vector, seed: int) -> float:
        """Of incpt alone; see IncptPeer."""
        return float(self._ask("first_tiles", name, position, seed))

    def close(self) -> None:
        """End the process."""
        self._pipe.close()
        self._process.terminate()
        self._process.join(10)

    def _ask(self, method: str, *arguments: Any) -> Any:
        try:
            self._pipe.send((method, arguments))
        except (BrokenPipeError, OSError):
            raise MissingPeer(f"{self.name} has ended") from None
        return self._answer()

    def _answer(self) -> Any:
        try:
            problem, answer = self._pipe.recv()
        except (EOFError, OSError):
            raise MissingPeer(f"{self.name} ended before it had an answer") from None
        if problem is not None:
            raise MissingPeer(problem)
        return answer


def _serve(name: str, threads: int, device: str | None, pipe: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    os.environ["POCL_MAX_PTHREAD_COUNT"] = str(threads)
    if device is not None:
        os.environ[DEVICE_VARIABLE] = device
    # Blender tells of every frame on stdout, which is for results.
    sys.stdout.flush()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    try:
        peer = make(name)
    except Exception as error:
        pipe.send((one_line(error), None))
        return
    pipe.send((None, None))
    while True:
        try:
            method, arguments = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send((None, getattr(peer, method)(*arguments)))
        except Exception as error:
            pipe.send((one_line(f"{type(error).__name__}: {error}"), None))
