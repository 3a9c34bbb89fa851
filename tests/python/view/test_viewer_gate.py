"""Who reaches the viewer's page: requests without its token, of foreign pages and under foreign names are refused."""

from __future__ import annotations

import contextlib
import http.client
import http.server
import io
import os
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
import viser
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

import tightloop as tl
from processes import started, wait_until
from tightloop.view import Film
from tightloop.view.browser import guarded_server
from tightloop.view.browser.gate import Gate, host_name
from tightloop.view.command import main

# What viser's client names, and the server asks for.
PROTOCOL: Any = f"viser-v{viser.__version__}"


class Served:
    """A viewer's address, taken apart."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        assert parts.port is not None
        self.url, self.port, self.path = url, parts.port, parts.path
        self.socket = f"ws://localhost:{self.port}{self.path}"
        self.origin = f"http://localhost:{self.port}"

    def get(self, path: str | None = None, **headers: str) -> tuple[int, str]:
        """Status and text of the answer to a request, sent as it is; a ``Host`` in ``headers`` replaces its own."""
        given = {"Host": f"localhost:{self.port}"} | headers
        lines = [f"GET {self.path if path is None else path} HTTP/1.1", *(f"{k}: {v}" for k, v in given.items())]
        with socket.create_connection(("127.0.0.1", self.port)) as to:
            to.sendall("\r\n".join([*lines, "", ""]).encode())
            answer = http.client.HTTPResponse(to)
            answer.begin()
            return answer.status, answer.read().decode()

    def shakes_hands(self, path: str | None = None, **headers: str) -> tuple[int, str]:
        """Status and text of the answer to a request for a websocket."""
        shake = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        return self.get(path, **shake, **{"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", **headers})


@pytest.fixture
def sim(pendulum: tl.Scene, unique: Callable[[], str]) -> Iterator[tl.Sim]:
    """A simulation whose trainer has let go of control."""
    with tl.launch(pendulum, worlds=1, name=unique()) as sim:
        sim.reset()
        sim.release()
        yield sim


@pytest.fixture
def served(sim: tl.Sim) -> Served:
    return Served(sim.view(port=8380).url)


def test_the_address_that_is_printed_opens_the_page_and_its_websocket(served: Served) -> None:
    status, text = served.get()
    assert status == 200 and "<html" in text
    assert served.get(served.path.rstrip("/"))[0] == 200
    assert served.get(f"{served.path}?fixedDpr=1")[0] == 200
    with connect(served.socket, origin=served.origin, subprotocols=[PROTOCOL], max_size=None) as to:  # pyright: ignore[reportArgumentType]
        assert to.recv(timeout=60)


@pytest.mark.parametrize("path", ["/", "/index.html", "/favicon.ico", "/wrong/", "/" + "A" * 32 + "/", "//", "/%2e"])
def test_without_the_token_nothing_is_served(served: Served, path: str) -> None:
    for ask in (served.get, served.shakes_hands):
        status, text = ask(path)
        assert status == 403
        assert "token" in text and "open the whole address that `tightloop view` printed" in text
        assert served.path not in text


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "https://localhost.evil.example", "http://localhost:1", "http://127.0.0.1", "null", "x"],
)
def test_a_page_of_another_origin_is_refused_even_with_the_token(served: Served, origin: str) -> None:
    for ask in (served.get, served.shakes_hands):
        status, text = ask(Origin=origin)
        assert status == 403
        assert origin in text and "open the viewer's own page" in text
    with pytest.raises(InvalidStatus, match="403"), connect(served.socket, origin=origin):  # pyright: ignore[reportArgumentType]
        pass


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "localhost.evil.example", "10.0.0.1", "a@b", ""])
def test_a_name_that_only_points_here_is_refused_even_with_the_token(served: Served, host: str) -> None:
    for ask in (served.get, served.shakes_hands):
        status, text = ask(Host=host, Origin=f"http://{host}")
        assert status == 403
        assert repr(host) in text and "open it as `localhost`" in text
    if host == "evil.example":
        assert "--allow-host evil.example" in text


@pytest.mark.parametrize("host", ["localhost:1", "127.0.0.1", "[::1]:9000", "LOCALHOST"])
def test_a_tunnel_may_end_at_any_port(served: Served, host: str) -> None:
    assert served.get(Host=host)[0] == 200
    assert served.shakes_hands(Host=host, Origin=f"http://{host.lower()}")[0] == 101


@pytest.mark.parametrize(
    "path", ["../", "..%2f..%2fetc/passwd", "../../../../../../etc/passwd", "assets/x.js", "%00", "a\\..\\b", "."]
)
def test_there_are_no_files_beside_the_page(served: Served, path: str) -> None:
    for ask in (served.get, served.shakes_hands):
        status, text = ask(served.path + path)
        assert status == 404 and "no such file" in text and "open the whole address" in text


def test_what_is_too_large_is_refused_and_the_page_goes_on(served: Served, sim: tl.Sim) -> None:
    with connect(served.socket, subprotocols=[PROTOCOL], max_size=None) as to:
        to.send(b"\0" * (2 << 20))
        with pytest.raises(ConnectionClosedError) as closed:
            while True:
                to.recv(timeout=60)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009 and "exceeds limit of 1048576 bytes" in closed.value.rcvd.reason
    for request in (
        f"GET {served.path}{'x' * 100_000} HTTP/1.1\r\n\r\n",
        f"GET {served.path} HTTP/1.1\r\nHost: localhost\r\nCookie: {'x' * 100_000}\r\n\r\n",
        f"GET {served.path} HTTP/1.1\r\n{'A: b' * 1000}\r\n",
        f"POST {served.path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000000\r\n\r\n",
        "\0\r\n\r\n",
    ):
        with socket.create_connection(("127.0.0.1", served.port)) as to, contextlib.suppress(ConnectionError):
            to.sendall(request.encode())
            assert to.recv(1 << 16) == b"", request[:80]
    assert served.get()[0] == 200
    sim.step()


def test_what_strangers_send_prints_little(sim: tl.Sim) -> None:
    command = [sys.executable, "-m", "tightloop", "view", sim.name, "--port=8380"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as viewer:
        assert viewer.stdout is not None
        served = Served(viewer.stdout.readline().strip())
        for number in range(20):
            served.get("/")
            served.shakes_hands(Origin=f"http://evil{number}.example")
            with socket.create_connection(("127.0.0.1", served.port)) as to:
                to.sendall(b"\0\r\n\r\n")
                assert to.recv(1) == b""
        viewer.terminate()
        _, printed = viewer.communicate(timeout=60)
    lines = printed.splitlines()
    assert len(lines) == 4, "the first refusals of pages; a proxy of another name is mended by what they say"
    assert "evil0.example" in lines[0] and "--allow-host evil0.example" in lines[0]
    assert served.path.strip("/") not in printed


def test_names_that_the_user_gives_are_accepted(sim: tl.Sim) -> None:
    served = Served(sim.view(port=8380, hosts=["hub.example"]).url)
    assert served.get(Host="HUB.example:443")[0] == 200
    # a proxy that says where it asks, but not where it was asked
    assert served.shakes_hands(Origin="https://hub.example")[0] == 101
    assert served.shakes_hands(Origin="https://other.example")[0] == 403
    assert served.get(Host="other.example")[0] == 403


def test_a_viewer_for_all_machines_has_its_ip_addresses_and_no_other_names() -> None:
    gate = Gate("0.0.0.0")
    path = f"/{gate.token}/"
    assert gate.check(path, ["192.168.1.7:8080"], ["http://192.168.1.7:8080"]) is None
    assert gate.check(path, ["[fe80::1]:8080"], []) is None
    refused = gate.check(path, ["evil.example"], [])
    assert refused is not None and "by its IP address" in refused.text
    assert Gate("10.1.2.3").check("/", ["10.1.2.4"], []) is not None
    twice = Gate("127.0.0.1").check(path, ["localhost", "evil.example"], [])
    assert twice is not None and twice.status == 400


def test_tokens_are_long_and_never_the_same() -> None:
    tokens = {Gate("127.0.0.1").token for _ in range(100)}
    assert len(tokens) == 100 and all(len(token) == 32 for token in tokens)


def test_an_address_for_a_browsers_command_line_leads_to_the_page_once() -> None:
    gate = Gate("127.0.0.1")
    assert gate.check("/once/", ["localhost"], []) is not None
    once = gate.path_once()
    assert gate.token not in once
    stolen = gate.check(once, ["evil.example"], [])
    assert stolen is not None and stolen.location is None
    answer = gate.check(once, ["localhost"], [])
    assert answer is not None and answer.status == 303 and answer.location == f"../{gate.token}/"
    again = gate.check(once, ["localhost"], [])
    assert again is not None and again.status == 403


def test_the_command_line_of_a_browser_has_no_token(sim: tl.Sim, tmp_path: Path) -> None:
    browser, opened = tmp_path / "browser", tmp_path / "opened"
    browser.write_text(f'#!/bin/sh\nprintf %s "$*" > {opened}.new && mv {opened}.new {opened}\n')
    browser.chmod(0o755)
    command = [sys.executable, "-m", "tightloop", "view", sim.name, "--port=8380", "--open"]
    env = os.environ | {"BROWSER": f"{browser} %s"}
    with started(command, stdout=subprocess.PIPE, text=True, env=env) as viewer:
        assert viewer.stdout is not None
        served = Served(viewer.stdout.readline().strip())
        assert wait_until(opened.exists, 60)
        url = opened.read_text()
        assert served.path not in url and urlsplit(url).port == served.port
        with urllib.request.urlopen(url, timeout=60) as answer:
            assert answer.url == served.url and b"<html" in answer.read()
        assert served.get(urlsplit(url).path)[0] == 403
        viewer.terminate()
        assert viewer.wait(60) == 0


@pytest.mark.parametrize("wrong", ["http://hub.example/", "hub.example:80", "", "a b", "[::1"])
def test_a_host_name_is_given_alone(wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["franka", "--allow-host", wrong])
    assert end.value.code == 2 and "hub.example.org" in capsys.readouterr().err
    assert host_name("Hub.example") == "hub.example" and host_name("::1") == "::1"


def test_a_viser_that_cannot_be_guarded_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[Any] = []

    class Other:
        def __init__(self, *_: Any, **__: Any) -> None:
            started.append(self)

        def stop(self) -> None:
            started.remove(self)

    monkeypatch.setattr(viser, "ViserServer", Other)
    with pytest.raises(tl.MissingLibrary, match="cannot guard"):
        guarded_server.start(Gate("127.0.0.1"), "127.0.0.1", 0)
    assert not started


def test_nobody_can_look_at_a_film_that_is_being_made(sim: tl.Sim, tmp_path: Path) -> None:
    def listening() -> set[int]:
        rows = [line.split() for line in Path("/proc/self/net/tcp").read_text().splitlines()[1:]]
        return {int(row[1].split(":")[1], 16) for row in rows if row[3] == "0A" and row[1].startswith("0100007F")}

    before = listening()
    with Film(tmp_path / "run.html", sim):
        opened = listening() - before
        assert opened
        assert all(Served(f"http://localhost:{port}/").get()[0] == 403 for port in opened)


@contextlib.contextmanager
def forwarder(port: int) -> Iterator[int]:
    """A tunnel to a port of this machine, as ssh -L makes one; yields its own port."""

    def pump(source: socket.socket, to: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(1 << 16):
                to.sendall(data)
        for end in (source, to):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                near = entry.accept()[0]
                far = socket.create_connection(("127.0.0.1", port))
                for pair in ((near, far), (far, near)):
                    threading.Thread(target=pump, args=pair, daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as entry:
        threading.Thread(target=serve, daemon=True).start()
        yield entry.getsockname()[1]
        entry.shutdown(socket.SHUT_RDWR)


@contextlib.contextmanager
def page_of(html: str) -> Iterator[int]:
    """A web server with one page, as a notebook or an attacker has it; yields its port."""

    class Page(http.server.SimpleHTTPRequestHandler):
        def send_head(self) -> Any:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            return io.BytesIO(html.encode())

        def log_message(self, format: str, *args: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


def test_the_page_works_through_a_tunnel_and_takes_control_only_by_a_click(served: Served, sim: tl.Sim) -> None:
    from browser import View, chromium

    with chromium() as browser, forwarder(served.port) as port:
        view = View(browser, f"http://localhost:{port}{served.path}")
        assert sim.controller() is None and sim.forward().step[0] == 0, "who only looks changes nothing"
        sim.release()
        view.press("Play")
        view.wait(lambda: "you drive" in view.text, "the page drives")
        assert wait_until(lambda: sim.controller() is not None, 60)
        view.press("Pause")
        view.wait(lambda: sim.controller() is None, "the page has given control back")
        assert not view.errors


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1"])
def test_the_page_works_in_a_cell_of_a_notebook(served: Served, sim: tl.Sim, name: str) -> None:
    """Under another port of the same host, and under another host, where a browser sends no cookies."""
    from browser import PATIENCE_SECONDS, chromium

    frame = f'<iframe src="{served.url}" width="900" height="500" allowfullscreen></iframe>'
    with chromium() as browser, page_of(frame) as port:
        page = browser.new_page(viewport={"width": 1000, "height": 600})
        page.set_default_timeout(PATIENCE_SECONDS * 1000)
        page.goto(f"http://{name}:{port}/")
        page.frame_locator("iframe").get_by_role("button", name="Play", exact=True).click()
        page.frame_locator("iframe").get_by_text("you drive").wait_for()
        assert sim.controller() is not None


def test_a_foreign_page_gets_no_websocket(served: Served, sim: tl.Sim) -> None:
    from browser import chromium

    ask = """(url => new Promise(done => {
        const to = new WebSocket(url, PROTOCOL);
        to.onopen = () => done('open');
        to.onerror = () => done('refused');
    }))""".replace("PROTOCOL", repr(PROTOCOL))
    with chromium() as browser, page_of("<p>a page of somebody else") as port:
        page = browser.new_page()
        for origin in (f"http://localhost:{port}/", f"http://127.0.0.1:{port}/"):
            page.goto(origin)
            for url in (f"ws://localhost:{served.port}", served.socket):
                assert page.evaluate(f"{ask}({url!r})") == "refused"
        # the same websocket in the viewer's own page is the control of this test
        page.goto(served.url)
        assert page.evaluate(f"{ask}({served.socket!r})") == "open"
    assert sim.controller() is None
