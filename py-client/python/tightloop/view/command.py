"""The subcommand `tightloop view`: a daemon or a recording in the browser."""

from __future__ import annotations

import argparse
import json
import signal
import socket
import sys
import threading
import webbrowser
from typing import NoReturn

from tightloop import system
from tightloop.errors import TightloopError
from tightloop.terminal import printable
from tightloop.view import dependencies
from tightloop.view.browser import gate

_WORLDS_MAX = 1024
_EPILOG = """examples:
  tightloop view franka                    observe the daemon `franka`, and control it while nobody trains
  tightloop view run.tlrec --worlds 16     play a recording"""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        prog="tightloop view",
        description="Show the worlds of a daemon or a recording in the browser. Prints the address of the page; "
        "anyone who has this address can control the worlds. Stop with Ctrl-C.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("target", metavar="NAME|FILE.tlrec", help="name of a daemon, or a recording")
    made.add_argument(
        "--port", type=_port, default=8080, help="port of the page; the next free port if it is taken (default 8080)"
    )
    made.add_argument(
        "--host",
        type=_host,
        default="127.0.0.1",
        help="address to listen on; 0.0.0.0 is for other machines too, without encryption (default 127.0.0.1)",
    )
    made.add_argument(
        "--allow-host",
        type=_name,
        action="append",
        default=[],
        metavar="NAME",
        help="also answer to this host name, such as that of a proxy; repeat it for more names",
    )
    made.add_argument(
        "--worlds", type=_worlds, default=256, help=f"most worlds to show, up to {_WORLDS_MAX} (default 256)"
    )
    made.add_argument("--open", action="store_true", help="open the page in this machine's browser")
    made.add_argument("--parent", type=int, help=argparse.SUPPRESS)
    # whether the parent steps the worlds, and says what it gets for it
    made.add_argument("--linked", action="store_true", help=argparse.SUPPRESS)
    return made


def main(arguments: list[str]) -> int:
    """Run the subcommand; returns its exit code: 0 done, 1 failed, 2 misused."""
    given = _parsed(arguments)
    stopped = threading.Event()
    for number in system.stop_signals():
        signal.signal(number, lambda *_: stopped.set())
    try:
        dependencies.check("viser")
        from tightloop.view.browser.loop_link import LoopLink
        from tightloop.view.browser.server import Server

        # the simulation goes first where there are not enough cores for both
        system.give_way()
        names = given.allow_host
        place = {"host": given.host, "port": given.port, "names": names}
        server = Server(given.target, **place, worlds=given.worlds)
    except (TightloopError, OSError) as problem:
        if given.parent is None:
            print(printable(f"tightloop: {problem}"), file=sys.stderr)
        else:
            _answer(type(problem).__name__, str(problem))
        return 1
    try:
        if server.port != given.port:
            print(f"tightloop: port {given.port} is taken; the page is at {server.port}", file=sys.stderr, flush=True)
        print(server.url, flush=True)
        if given.linked:
            # before a browser is started, which would keep the pipes open
            server.link = LoopLink(system.take_pipes())
        if given.open:
            webbrowser.open(server.url_once())
        server.run(stopped, given.parent)
    finally:
        server.close()
    return 0


def _parsed(arguments: list[str]) -> argparse.Namespace:
    """Read the arguments; a process that waits for an answer gets what is wrong with them."""
    made = parser()
    if any(argument.startswith("--parent") for argument in arguments):

        def tell(message: str) -> NoReturn:
            _answer("ArgumentError", message)
            raise SystemExit(2)

        made.error = tell
    return made.parse_args(arguments)


def _answer(kind: str, message: str) -> None:
    """Tell `tightloop.sim.viewer_process.Viewer` why there is no page."""
    print(json.dumps({"error": {"kind": kind, "message": message}}), flush=True)


def _host(text: str) -> str:
    # viser waits for ever for a server that cannot listen there
    try:
        family, kind, _, _, place = socket.getaddrinfo(text, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as tried:
            tried.bind(place)
    except (OSError, UnicodeError) as problem:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no address of this machine; give 127.0.0.1 or 0.0.0.0"
        ) from problem
    return text


def _name(text: str) -> str:
    try:
        return gate.host_name(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


def _port(text: str) -> int:
    try:
        port = int(text)
    except ValueError:
        port = 0
    if not 0 < port < 65536:
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give 1 to 65535")
    return port


def _worlds(text: str) -> int:
    try:
        worlds = int(text)
    except ValueError:
        worlds = 0
    if not 0 < worlds <= _WORLDS_MAX:
        raise argparse.ArgumentTypeError(f"{text!r} worlds cannot be shown; give 1 to {_WORLDS_MAX}")
    return worlds
