"""A viser server behind a `Gate`: viser itself serves every request of every page."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import viser
import websockets.asyncio.server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from tightloop.errors import MissingLibrary
from tightloop.view import dependencies
from tightloop.view.browser.gate import Answer, Gate

# Messages of a page are controls and cameras, of less than 10 kB. viser itself takes 50 MB.
_MESSAGE_BYTES_MAX = 1 << 20
# A page that is shut out may try again for ever.
_REPORTS_MAX = 4
_PRIVATE = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"}
# viser has no setting for this: while one server starts, the function that it calls is another one.
_STARTING = threading.Lock()

Handler = Callable[[ServerConnection, Request], Response | None]


def start(gate: Gate, host: str, port: int, label: str | None = None) -> viser.ViserServer:
    """Start a viser server that only answers what a gate lets through.

    Args:
        gate: Checks every request.
        host: Address to listen on.
        port: First port to try; 0 for any.
        label: Title of the page.

    Raises:
        MissingLibrary: This version of viser starts its server in another way.
    """
    with _guarding(gate) as guarded, contextlib.redirect_stdout(io.StringIO()):  # viser prints a greeting
        server = viser.ViserServer(host, port, label=label, verbose=False)
    if not guarded:
        server.stop()
        raise MissingLibrary(f"the viewer cannot guard viser {viser.__version__}: {dependencies.INSTALL}")
    return server


@contextlib.contextmanager
def _guarding(gate: Gate) -> Iterator[list[Gate]]:
    """Put a gate before the server that viser starts within this block; yields what was put before one."""
    guarded: list[Gate] = []
    with _STARTING:
        serve: Any = websockets_server.serve

        def guard(handler: Any, *places: Any, process_request: Handler, **options: Any) -> Any:
            # another thread of this process may start a server of its own
            if not handler.__module__.startswith("viser."):
                return serve(handler, *places, process_request=process_request, **options)
            guarded.append(gate)
            options |= {"max_size": _MESSAGE_BYTES_MAX, "logger": _logger()}
            return serve(handler, *places, process_request=_checked(gate, process_request), **options)

        websockets_server.serve = guard  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield guarded
        finally:
            websockets_server.serve = serve


def _checked(gate: Gate, serve_page: Handler) -> Handler:
    """Return a handler of requests that asks the gate first."""
    reported: set[str] = set()

    def handle(connection: ServerConnection, request: Request) -> Response | None:
        headers = request.headers
        answer = gate.check(request.path, headers.get_all("Host"), headers.get_all("Origin"))
        if answer is not None:
            # a page that cannot connect shows no reason
            if "Origin" in headers and answer.text not in reported and len(reported) < _REPORTS_MAX:
                reported.add(answer.text)
                _report(answer.text)
            return _response(answer)
        if any(name.lower() == "websocket" for name in headers.get_all("Upgrade")):
            return None
        codings = Headers({"Accept-Encoding": ", ".join(headers.get_all("Accept-Encoding"))})
        page = serve_page(connection, Request("/", codings))
        assert page is not None
        page.headers.update(_PRIVATE)
        return page

    return handle


def _response(answer: Answer) -> Response:
    body = f"{answer.text}\n".encode(errors="backslashreplace")
    headers = Headers(_PRIVATE)
    headers["Content-Type"] = "text/plain; charset=utf-8"
    headers["Content-Length"] = str(len(body))
    if answer.location is not None:
        headers["Location"] = answer.location
    return Response(answer.status.value, answer.status.phrase, headers, body)


def _report(text: str) -> None:
    """Print a line to stderr from a thread of its own, since nobody may read stderr."""
    line = f"tightloop: viewer: {text}"
    threading.Thread(target=print, args=(line,), kwargs={"file": sys.stderr, "flush": True}, daemon=True).start()


def _logger() -> logging.Logger:
    """Return a logger without the tracebacks of requests that are not HTTP, which anybody can send."""
    logger = logging.getLogger("tightloop.view.server")
    if not logger.filters:
        logger.addFilter(lambda record: record.getMessage() != "opening handshake failed")
    return logger
