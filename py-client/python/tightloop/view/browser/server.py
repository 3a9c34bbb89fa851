"""The viewer's process: a viser server that shows a daemon or a recording until it is stopped."""

from __future__ import annotations

import contextlib
import io
import threading
import time
from collections.abc import Sequence

import viser

from tightloop import system
from tightloop.errors import DaemonLost, TightloopError, UnknownDaemon
from tightloop.view.browser import guarded_server
from tightloop.view.browser.frame_stream import FEW_WORLDS, FrameStream, open_stream
from tightloop.view.browser.gate import Gate
from tightloop.view.browser.loop_link import LoopLink
from tightloop.view.browser.page import Page

# Least time between frames: with few worlds all 60 frames per second are shown, with many worlds every other one.
_SPACING_SECONDS, _SPACING_MANY_SECONDS = 0.015, 0.025
# Without a page open, the server checks for one this often.
_UNSEEN_SECONDS = 0.1
_WAIT_SECONDS = 0.5
_PARENT_SECONDS = 0.5
# Messages reach browsers within this time.
_FAREWELL_SECONDS = 0.3


class Server:
    """Shows a daemon or a recording in browsers.

    Attributes:
        url: Address of the page, with the token that opens it.
        port: Port of the page: the requested one, or the next free one.
        link: As of `Panel`, for pages to come.

    Args:
        target: Name of a daemon, or path of a recording.
        host: Address to listen on.
        port: First port to try.
        worlds: Largest number of worlds to show.
        names: Host names of the page, besides ``localhost`` and ``host``.

    Raises:
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
    """

    def __init__(
        self,
        target: str,
        *,
        host: str,
        port: int,
        worlds: int,
        names: Sequence[str] = (),
    ) -> None:
        self._target = target
        self.link: LoopLink | None = None
        self._worlds = worlds
        self._stream: FrameStream | None = open_stream(target, worlds)
        self._page: Page | None = None
        self._reported = ""
        self._gate = Gate(host, names)
        self._viser = guarded_server.start(self._gate, host, port, f"tightloop · {target}")
        self._viser.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        # registered once, for all pages to come
        self._viser.on_client_connect(self._aim)
        self.port: int = self._viser.get_port()
        shown = "localhost" if host in ("0.0.0.0", "127.0.0.1", "::") else f"[{host}]" if ":" in host else host
        self._place = f"http://{shown}:{self.port}"
        self.url = f"{self._place}/{self._gate.token}/"

    def url_once(self) -> str:
        """Return an address that leads to the page once, for the command line of a browser."""
        return self._place + self._gate.path_once()

    def run(self, stopped: threading.Event, parent: int | None = None) -> None:
        """Show frames until ``stopped`` is set or the parent process ends."""
        looked_at = time.monotonic()
        while not stopped.is_set():
            began = time.monotonic()
            if parent is not None and began - looked_at > _PARENT_SECONDS:
                looked_at = began
                if system.is_orphan(parent):
                    return
            try:
                arrived = self._update()
                if arrived is not None:
                    # counted from the arrival, so that the time to show a frame does not delay the next one
                    time.sleep(max(arrived + self._spacing() - time.monotonic(), 0.0))
            except (DaemonLost, UnknownDaemon) as lost:
                self._report_loss(lost)
            except TightloopError as problem:
                if self._page is None or self._stream is None:
                    raise
                self._stream.driver.problem = str(problem)
                self._page.update_text()
                time.sleep(_WAIT_SECONDS)

    def close(self) -> None:
        """Detach from the source, say on the page that it ended, and close it."""
        if self._stream is not None:
            self._stream.close()
        if self._viser.get_clients():
            self._report(
                "Run ended", "The program that showed this run has ended or closed it. This is its last picture."
            )
            time.sleep(_FAREWELL_SECONDS)
        with contextlib.redirect_stdout(io.StringIO()):
            self._viser.stop()

    def _update(self) -> float | None:
        """Show the next frame; return when it arrived, or None without a new frame."""
        if self._stream is None:
            self._await_restart()
            return None
        if self._page is None:
            first = self._stream.poll(_WAIT_SECONDS)
            if first is not None:
                self._page = Page(self._viser, self._stream, first, link=self.link)
                for client in self._viser.get_clients().values():
                    self._page.aim_client(client)
            return None
        if not self._viser.get_clients():
            self._stream.rest()
            time.sleep(_UNSEEN_SECONDS)
            return None
        return self._page.update(0.05)

    def _aim(self, client: viser.ClientHandle) -> None:
        page = self._page
        if page is not None:
            page.aim_client(client)

    def _spacing(self) -> float:
        assert self._stream is not None
        return _SPACING_SECONDS if self._stream.worlds <= FEW_WORLDS else _SPACING_MANY_SECONDS

    def _report_loss(self, lost: TightloopError) -> None:
        """Report on the page that the daemon went away, and wait for another of its name."""
        if self._stream is not None:
            self._stream.close()
        self._reported = ""
        self._report(
            "Daemon lost", f"{lost}\n\nThis page goes on when a daemon of the name `{self._target}` is started."
        )
        self._stream = self._page = None

    def _report(self, title: str, text: str) -> None:
        """Show a message in place of the controls, beside the last picture."""
        if self._page is not None:
            self._page.hide_controls()
        else:
            self._viser.gui.reset()
        self._viser.gui.set_panel_label(f"tightloop · {self._target} · {title.lower()}")
        self._viser.gui.add_markdown(f"## {title}\n{text}")
        for client in self._viser.get_clients().values():
            client.add_notification(title, text, auto_close_seconds=None, color="red")

    def _await_restart(self) -> None:
        try:
            self._stream = open_stream(self._target, self._worlds)
        except (UnknownDaemon, DaemonLost):
            time.sleep(_WAIT_SECONDS)
            return
        except TightloopError as problem:
            # reported once, not after every attempt
            if str(problem) != self._reported:
                self._reported = str(problem)
                self._viser.gui.add_markdown(f"It cannot be shown: {problem}")
            time.sleep(_WAIT_SECONDS)
            return
        self._viser.gui.reset()
        self._viser.scene.reset()
