"""Bodies in three dimensions on a page: the component of ``klack show``, fed from the server."""

from collections.abc import Callable, Mapping
from typing import Any

from nicegui.element import Element

__all__ = ["Scene"]

Pick = Callable[[str, str], Any]
"""Called with the names of a body and of one of its faces."""


class Scene(Element, component="scene_element.js"):  # type: ignore[call-arg]
    """Bodies that are drawn in the browser, from a payload that it fetches.

    The drawing context is released when the element goes: a browser has sixteen of them or so.

    Parameters
    ----------
    address : str
        Of the payload, from :class:`klack.app.state.Sounds`.
    on_pick, on_hover : callable or None
        Called when a face is clicked, and when the pointer comes to another one.
    has_panel : bool
        Whether views, bodies and names of faces stand beside; a click on a name copies it.
    """

    def __init__(
        self,
        address: str,
        *,
        on_pick: Pick | None = None,
        on_hover: Pick | None = None,
        has_panel: bool = True,
    ) -> None:
        super().__init__()
        self._props["address"] = address
        self._props["faces"] = has_panel
        self.classes("k-scene")
        for name, handler in (("pick", on_pick), ("hover", on_hover)):
            if handler is not None:
                self.on(name, lambda event, handler=handler: _told(handler, event.args))

    def highlight(self, body: str, face: str) -> None:
        """Lighten a face; empty names for none."""
        self.run_method("highlight", f"{body}.{face}" if body else None)

    def cut_open(self, on: bool) -> None:
        """Remove the half in front of the axis."""
        self.run_method("setCut", on)

    def show_body(self, body: str, on: bool) -> None:
        """Show or hide a body."""
        self.run_method("setVisible", body, on)

    def set_roles(self, roles: Mapping[str, str]) -> None:
        """Mark faces, ``needle.tip``, as ``"contact"`` or ``"held"``; all others as neither."""
        self._props["roles"] = dict(roles)
        self.update()


def _told(handler: Pick, name: Any) -> Any:
    body, _, face = str(name or "").partition(".")
    return handler(body, face)
