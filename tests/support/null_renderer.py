"""A renderer for tests of the editor."""

from __future__ import annotations

from incpt.viewer.renderer import Message, Pick, Picked, Request
from incpt.viewer.view import View


class NullRenderer:
    """Renders nothing. It keeps the `views` and `requests` it is given; a Pick is
    answered with `picks[point]` (None where there is no such point), and `messages` are polled next."""

    def __init__(self) -> None:
        self.views: list[View] = []
        self.requests: list[Request] = []
        self.picks: dict[tuple[float, float], str | None] = {}
        self.messages: list[Message] = []
        self.closed = False

    def show(self, view: View) -> None:
        self.views.append(view)

    def request(self, request: Request) -> None:
        self.requests.append(request)
        if isinstance(request, Pick):
            name = self.picks.get(request.point)
            self.messages.append(Picked(request.point, name, request.additive))

    def poll(self) -> list[Message]:
        messages, self.messages = self.messages, []
        return messages

    def close(self) -> None:
        self.closed = True
