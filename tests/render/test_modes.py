"""Every transition of the mode machine, written out."""

from __future__ import annotations

from itertools import product

import pytest

from incpt.render.modes import Event, Mode, next_mode
from incpt.render.strategies import RESTART, STRATEGIES_BY_NAME

BASE, REFINE, INCREMENTAL = Mode.BASE, Mode.REFINE, Mode.INCREMENTAL
GLOBAL, LOCAL, DONE = Event.GLOBAL_CHANGE, Event.LOCAL_CHANGE, Event.QUEUE_DONE


SPIRAL = {
    (BASE, GLOBAL): BASE,
    (REFINE, GLOBAL): BASE,
    (INCREMENTAL, GLOBAL): BASE,
    (BASE, LOCAL): BASE,
    (REFINE, LOCAL): INCREMENTAL,
    (INCREMENTAL, LOCAL): INCREMENTAL,
    (BASE, DONE): REFINE,
    (REFINE, DONE): REFINE,
    (INCREMENTAL, DONE): REFINE,
}


@pytest.mark.parametrize(("mode", "event"), list(product(Mode, Event)))
def test_spiral_transitions(mode: Mode, event: Event) -> None:
    assert next_mode(mode, event, STRATEGIES_BY_NAME["spiral"]) is SPIRAL[mode, event]


@pytest.mark.parametrize("mode", list(Mode))
@pytest.mark.parametrize(("event", "expected"), [(GLOBAL, BASE), (LOCAL, BASE), (DONE, REFINE)])
def test_restart_starts_over_at_every_change(mode: Mode, event: Event, expected: Mode) -> None:
    assert next_mode(mode, event, RESTART) is expected
