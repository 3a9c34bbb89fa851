"""The gate of the viewer: which requests reach the page. Each needs the token of the address that the viewer prints.

Web pages of other origins cannot read that address. `Host` and `Origin` are checked as well, so that a name that an
attacker's DNS server points to this machine opens nothing, even with a stolen token.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from http import HTTPStatus

_TOKEN_BYTES = 24
_LOOPBACK = ("localhost", "127.0.0.1", "::1")
_AUTHORITY = re.compile(r"(?:\[(?P<six>[0-9a-f:.]+)\]|(?P<name>[a-z0-9._-]+))(?::[0-9]{1,5})?")
_WHOLE = "open the whole address that `tightloop view` printed (in Python, `viewer.url`)"


@dataclass(frozen=True)
class Answer:
    """The answer to a request that does not reach the page.

    Attributes:
        status: Status of HTTP.
        text: What is wrong, and what to do.
        location: Where the page is, if this answer redirects to it.
    """

    status: HTTPStatus
    text: str
    location: str | None = None


class Gate:
    """Checks requests for the page of one viewer.

    Attributes:
        token: The secret in the address of the page.

    Args:
        address: Address that the viewer listens on.
        names: Host names that the page may have besides ``localhost`` and that address, such as that of a proxy.
    """

    def __init__(self, address: str, names: Sequence[str] = ()) -> None:
        self.token = secrets.token_urlsafe(_TOKEN_BYTES)
        self._once: str | None = None
        self._proxies = {name.lower() for name in names}
        self._hosts = {*_LOOPBACK, address.lower(), *self._proxies}
        self._everywhere = _is_wildcard(address)

    def path_once(self) -> str:
        """Return a path that redirects to the page once.

        Other users of the machine can read the command line of a browser, which should not have the token in it.
        """
        self._once = secrets.token_urlsafe(_TOKEN_BYTES)
        return f"/once/{self._once}"

    def check(self, path: str, hosts: Sequence[str], origins: Sequence[str]) -> Answer | None:
        """Check a request.

        Args:
            path: Its path, with the query.
            hosts: Its ``Host`` headers.
            origins: Its ``Origin`` headers.

        Returns:
            None if the request reaches the page, else the answer to it.
        """
        return self._check_host(hosts) or self._check_origin(origins, hosts[0]) or self._check_path(path)

    def _check_host(self, hosts: Sequence[str]) -> Answer | None:
        if len(hosts) != 1:
            return Answer(HTTPStatus.BAD_REQUEST, f"{len(hosts)} Host headers; send one")
        name = _name_of(hosts[0])
        if name is not None and (name in self._hosts or (self._everywhere and _is_ip(name))):
            return None
        cure = "open it as `localhost`" + (" or by its IP address" if self._everywhere else "")
        cure += "" if name is None else f", or start it with {_option(name)}"
        return Answer(HTTPStatus.FORBIDDEN, f"the viewer has no host name {hosts[0]!r}; {cure}")

    def _check_origin(self, origins: Sequence[str], host: str) -> Answer | None:
        # programs other than browsers send none
        if not origins:
            return None
        scheme, _, authority = origins[0].lower().partition("://")
        name = _name_of(authority)
        if len(origins) == 1 and scheme in ("http", "https") and name is not None:
            if authority == host.lower() or name in self._proxies:
                return None
            cure = f"behind a proxy of that name, start the viewer with {_option(name)}"
        else:
            cure = "show the page in a frame without a sandbox"
        problem = f"a page of the origin {', '.join(origins)!r} cannot use the viewer of {host!r}"
        return Answer(HTTPStatus.FORBIDDEN, f"{problem}; open the viewer's own page, or, {cure}")

    def _check_path(self, path: str) -> Answer | None:
        root, first, *rest = [*path.partition("?")[0].split("/"), ""]
        if root:
            return Answer(HTTPStatus.BAD_REQUEST, f"a path begins with /; {_WHOLE}")
        if _equal(first, self.token):
            # the page is a single file
            return None if not any(rest) else Answer(HTTPStatus.NOT_FOUND, f"there is no such file here; {_WHOLE}")
        if self._once is not None and first == "once" and _equal(rest[0] if rest else "", self._once):
            self._once = None
            return Answer(HTTPStatus.SEE_OTHER, "the page has moved", f"../{self.token}/")
        return Answer(HTTPStatus.FORBIDDEN, f"the token in the address is wrong or missing; {_WHOLE}")


def host_name(text: str) -> str:
    """Check a host name or an IP address that is given without a port.

    Raises:
        ValueError: It is something else, such as an address of a page.
    """
    name = _name_of(f"[{text}]" if text.count(":") > 1 and "[" not in text else text)
    if name is None or name != text.lower().strip("[]"):
        raise ValueError(f"{text!r} is no host name; give it without `http://`, port and path, such as hub.example.org")
    return name


def _name_of(authority: str) -> str | None:
    """Return the host of ``host:port`` in lower case, or None for something else."""
    found = _AUTHORITY.fullmatch(authority.lower())
    return None if found is None else found["six"] or found["name"]


def _option(name: str) -> str:
    return f"`--allow-host {name}` (in Python, `sim.view(hosts=[{name!r}])`)"


def _equal(given: str, secret: str) -> bool:
    """Compare in a time that does not depend on where the texts differ."""
    return hmac.compare_digest(given.encode(errors="surrogateescape"), secret.encode())


def _is_ip(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_wildcard(address: str) -> bool:
    return _is_ip(address) and ipaddress.ip_address(address).is_unspecified
