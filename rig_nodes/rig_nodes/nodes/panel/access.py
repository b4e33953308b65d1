# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who may use the operator's page: a check of Host, Origin and token before every request, the websocket's included.

nodes.panel.server asks it. A browser sends a page of another site with that site's Origin, and one whose name was bound to this
machine (DNS rebinding) with that name as Host; neither has the token.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tornado.httputil import HTTPServerRequest

LOOPBACK = "127.0.0.1"
TOKEN = "token"


class Access:
    """The rule of one server.

    Attributes
    ----------
    token : str
        What a request must hold, as an argument of the address or as the cookie that the page sets.

    Parameters
    ----------
    address : str
        Address on which the server listens.
    port : int
        Its port.
    """

    def __init__(self, address: str, port: int) -> None:
        self.address, self.port, self.token = address, port, secrets.token_urlsafe(18)
        self.cookie = f"rig_panel_{port}"  # cookies are shared by all ports of a host

    @property
    def url(self) -> str:
        """The address for a browser, with the token."""
        host = socket.gethostname() if ipaddress.ip_address(self.address).is_unspecified else self.address
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/?{TOKEN}={self.token}"

    def refusal(self, request: HTTPServerRequest) -> str:
        """Return why a request is refused, as a sentence; empty when it is served."""
        host = request.headers.get("Host", "")
        if not self._is_own(host):
            return "this Host is not the rig's page; open the address that ./rig panel has printed"
        origin = request.headers.get("Origin") or request.headers.get("Sec-Websocket-Origin")
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            return "pages of another origin have no access to the rig"
        if not self._has_token(request):
            return "the token is missing or of an earlier start; open the address that ./rig panel has printed"
        return ""

    def _is_own(self, host: str) -> bool:
        """Return whether a Host names this server; of names only those that no other site can have."""
        name, sign, port = host.rpartition(":")
        if not sign or not port.isdecimal() or int(port) != self.port:
            return False
        name = name.removeprefix("[").removesuffix("]").lower()
        if name == "localhost" or name == self.address:
            return True
        if self.address == LOOPBACK:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name == socket.gethostname().lower()
        return True  # a number cannot be bound to another machine

    def _has_token(self, request: HTTPServerRequest) -> bool:
        given = [value.decode("utf-8", "replace") for value in request.query_arguments.get(TOKEN, [])]
        cookie = request.cookies.get(self.cookie)
        given += [cookie.value] if cookie else []
        return any(hmac.compare_digest(one.encode(), self.token.encode()) for one in given)
