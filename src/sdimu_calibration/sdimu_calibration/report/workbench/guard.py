"""What the pages that this machine serves answer: themselves, in requests of a page's size, and never with silence.

A page of another site can reach a server on the loopback interface by a name that it lets point there (DNS rebinding).
Its requests carry that name as Host: only names of this machine are answered.
"""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

import dash
from flask import Flask, Response, abort, request
from werkzeug.exceptions import HTTPException

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError

LOOPBACK = ("127.0.0.1", "localhost", "::1")
LARGEST = 1_000_000
"""Largest body of a request (bytes): a hundred effects of one's own, each with all that was tried before it."""

POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; object-src 'none'; base-uri 'self'; "
    "form-action 'self'; frame-ancestors 'none'"
)
"""Content-Security-Policy of every answer: the page talks to this server alone, and stands in no other page. Dash and
plotly need scripts in the page, and make some while they run."""


def guard(server: Flask, host: str) -> None:
    """Answer only what is asked of this machine, by name, and what can be understood.

    `host`: address that is listened on; another one than loopback is answered too, with the names of this machine.
    """
    names = {*LOOPBACK, *(() if host in LOOPBACK else _own_names(host))}
    server.config["MAX_CONTENT_LENGTH"] = server.config["MAX_FORM_MEMORY_SIZE"] = LARGEST

    @server.before_request
    def refuse_strangers() -> None:
        asked, origin = f"//{request.headers.get('Host', '')}", request.headers.get("Origin")
        if _name(asked) not in names:
            abort(403, "Only this machine is answered.")
        # A server on another port of this machine is another site, too.
        if origin and (_name(origin) not in names or urlsplit(origin).netloc.lower() != asked[2:].lower()):
            abort(403, "Only the page of this server is answered.")

    @server.after_request
    def keep_to_itself(response: Response) -> Response:
        response.headers["Content-Security-Policy"] = POLICY
        response.headers["X-Frame-Options"] = "DENY"
        response.headers["X-Content-Type-Options"] = "nosniff"
        return response

    @server.get("/alive")
    def alive() -> Response:
        """Let a page know that there is a server."""
        return Response(status=204)

    @server.errorhandler(Exception)
    def say(error: Exception) -> HTTPException | Response:
        if isinstance(error, HTTPException):
            return error
        server.logger.error("a request could not be understood (%s)", type(error).__name__)
        return Response("The request could not be understood.", 400, mimetype="text/plain")


def tell_error(error: Exception) -> None:
    """Say in the page what a callback could not do; the page stays as it is."""
    why = " ".join(str(error).split())[:_LONGEST]
    if not isinstance(error, (DataError, UnitError)):
        dash.get_app().server.logger.error("a click could not be answered (%s: %s)", type(error).__name__, why)
        why = "the page asked for something that there is not; reload it"
    dash.set_props("message", {"children": f"Not done: {why}"})


_LONGEST = 500
"""Length of a message (characters): more is no message that anyone reads."""


def _name(address: str) -> str | None:
    """Host in an address, in small letters; None where there is none, or more than a host and its port."""
    try:
        parts = urlsplit(address)
    except ValueError:
        return None
    more = parts.path or parts.query or parts.fragment or _NO_HOST & set(parts.netloc)
    return None if more else parts.hostname


_NO_HOST = frozenset("@\\, ")
"""Characters that no name of a host has: what reads beside them reads another host than we do."""


def _own_names(host: str) -> list[str]:
    name = socket.gethostname().lower()
    try:
        addresses = socket.gethostbyname_ex(name)[2]
    except OSError:
        addresses = []
    return [host, name, *addresses]
