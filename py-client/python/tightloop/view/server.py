"""The process that shows a simulation: a viser server, fed until it is told to end."""

from __future__ import annotations

import contextlib
import io
import os
import threading
import time

import viser

from tightloop.errors import DaemonLost, TightloopError, UnknownDaemon
from tightloop.view.feed import FEW_WORLDS, Feed, open_feed
from tightloop.view.page import Page

# Least time from frame to frame: of few worlds all of 60 a second are shown, of many every other one, early ones too.
_SPACING_SECONDS, _SPACING_MANY_SECONDS = 0.015, 0.025
# Without a page open, it is looked for one so often.
_UNSEEN_SECONDS = 0.1
_WAIT_SECONDS = 0.5
_PARENT_SECONDS = 0.5


class Server:
    """Shows a daemon or a recording in browsers.

    Attributes:
        url: Where the page is.
        port: Its port: the one asked for, or the next one that is free.

    Args:
        target: Name of a daemon, or path of a recording.
        host: Address that browsers connect to.
        port: Port that is tried first.
        worlds: The most worlds to show.

    Raises:
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
    """

    def __init__(self, target: str, *, host: str, port: int, worlds: int) -> None:
        self._target = target
        self._worlds = worlds
        self._feed: Feed | None = open_feed(target, worlds)
        self._page: Page | None = None
        self._told = ""
        with contextlib.redirect_stdout(io.StringIO()):  # viser greets
            self._viser = viser.ViserServer(host, port, label=f"tightloop · {target}", verbose=False)
        self._viser.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        # once for all pages that there will be
        self._viser.on_client_connect(self._aim)
        self.port: int = self._viser.get_port()
        self.url = f"http://{'localhost' if host in ('0.0.0.0', '127.0.0.1', '::') else host}:{self.port}"

    def run(self, stopped: threading.Event, parent: int | None = None) -> None:
        """Show frames until an event is set, or the process has ended that started this one."""
        looked_at = time.monotonic()
        while not stopped.is_set():
            began = time.monotonic()
            if parent is not None and began - looked_at > _PARENT_SECONDS:
                looked_at = began
                if os.getppid() != parent:
                    return
            try:
                came = self._turn()
                if came is not None:
                    # counted from when it came, so that the time to show it delays no other
                    time.sleep(max(came + self._spacing() - time.monotonic(), 0.0))
            except (DaemonLost, UnknownDaemon) as lost:
                self._lose(lost)
            except TightloopError as problem:
                if self._page is None or self._feed is None:
                    raise
                self._feed.driver.problem = str(problem)
                self._page.tell()
                time.sleep(_WAIT_SECONDS)

    def close(self) -> None:
        """Detach, and close the page."""
        if self._feed is not None:
            self._feed.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._viser.stop()

    def _turn(self) -> float | None:
        """One look at the feed; when what is new came, if anything is."""
        if self._feed is None:
            self._await_restart()
            return None
        if self._page is None:
            first = self._feed.poll(_WAIT_SECONDS)
            if first is not None:
                self._page = Page(self._viser, self._feed, first)
                for client in self._viser.get_clients().values():
                    self._page.aim_client(client)
            return None
        if not self._viser.get_clients():
            self._feed.rest()
            time.sleep(_UNSEEN_SECONDS)
            return None
        return self._page.update(0.05)

    def _aim(self, client: viser.ClientHandle) -> None:
        page = self._page
        if page is not None:
            page.aim_client(client)

    def _spacing(self) -> float:
        assert self._feed is not None
        return _SPACING_SECONDS if self._feed.worlds <= FEW_WORLDS else _SPACING_MANY_SECONDS

    def _lose(self, lost: TightloopError) -> None:
        """Tell in the page that the daemon is gone, and wait for another of its name."""
        if self._feed is not None:
            self._feed.close()
        self._feed = self._page = None
        self._told = ""
        self._viser.gui.reset()
        self._viser.gui.set_panel_label(f"tightloop · {self._target}")
        self._viser.gui.add_markdown(
            f"## Daemon lost\n{lost}\n\nThis page goes on when a daemon of the name `{self._target}` is started."
        )

    def _await_restart(self) -> None:
        try:
            self._feed = open_feed(self._target, self._worlds)
        except (UnknownDaemon, DaemonLost):
            time.sleep(_WAIT_SECONDS)
            return
        except TightloopError as problem:
            # told once, not with every try
            if str(problem) != self._told:
                self._told = str(problem)
                self._viser.gui.add_markdown(f"It cannot be shown: {problem}")
            time.sleep(_WAIT_SECONDS)
            return
        self._viser.gui.reset()
        self._viser.scene.reset()
