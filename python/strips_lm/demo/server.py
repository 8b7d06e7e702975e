"""The demo over HTTP: one page, and JSON beside it; a plan in the making comes as one JSON object a line.

Nothing but the standard library. It is for one person on one machine: a request that names another host is refused, so
that a foreign page cannot reach it through DNS; only JSON is taken, so that a foreign form cannot; sizes and times are
bounded.
"""

from __future__ import annotations

import json
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import TYPE_CHECKING, Any, ClassVar
from urllib.parse import parse_qs, urlsplit

from strips_lm import _native
from strips_lm.config import ConfigError

if TYPE_CHECKING:
    from strips_lm.demo.service import Service

MAX_BODY = 256 * 1024
"""Bytes of the largest request."""

FILES = {
    "/": ("page.html", "text/html"),
    "/demo.js": ("demo.js", "text/javascript"),
    "/demo.css": ("demo.css", "text/css"),
}
"""What the page is made of."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'"
)
"""The page loads nothing from elsewhere, and nothing that a text on it may smuggle in."""


def make_server(service: Service, host: str, port: int) -> ThreadingHTTPServer:
    """The server, bound but not yet serving; port 0 takes a free one.

    Raises:
        ConfigError: the address is taken or not ours.
    """
    names = {host, "127.0.0.1", "localhost"} if host in {"127.0.0.1", "localhost"} else set[str]()
    handler = type("DemoHandler", (Handler,), {"service": service, "names": names})
    try:
        server = ThreadingHTTPServer((host, port), handler)
    except (OSError, OverflowError) as error:
        reason = str(getattr(error, "strerror", None) or error).lower()
        raise ConfigError(f"cannot listen at {host}:{port}: {reason}\nhint: --port 0 takes a free port") from None
    server.daemon_threads = True
    return server


class RefusedError(Exception):
    """A request that gets no answer but a status and a sentence."""

    def __init__(self, status: HTTPStatus, message: str) -> None:
        super().__init__(message)
        self.status = status


class Handler(BaseHTTPRequestHandler):
    """One request."""

    service: ClassVar[Any]
    names: ClassVar[set[str]]
    """Hosts that a request may name; empty where the demo was opened to the network on purpose."""
    timeout = 30
    server_version = "strips-lm"

    def do_GET(self) -> None:
        """The page's files, what there is to choose from, and example problems."""
        self._answer(self._get)

    def do_POST(self) -> None:
        """PDDL to be read, or a plan to be made."""
        self._answer(self._post)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Requests are not logged."""

    def _answer(self, work: Any) -> None:
        try:
            self._check_host()
            work()
        except RefusedError as refused:
            self._json({"error": str(refused)}, refused.status)
        except (BrokenPipeError, ConnectionResetError, TimeoutError):
            self.close_connection = True

    def _check_host(self) -> None:
        name = urlsplit(f"//{self.headers.get('Host', '')}").hostname
        if self.names and name not in self.names:
            raise RefusedError(HTTPStatus.FORBIDDEN, "this demo answers to its own address alone")

    def _get(self) -> None:
        place = urlsplit(self.path)
        if place.path in FILES:
            name, kind = FILES[place.path]
            self._send((files("strips_lm.demo") / name).read_bytes(), f"{kind}; charset=utf-8")
        elif place.path == "/about":
            self._json(self.service.about())
        elif place.path == "/example":
            asked = {key: values[-1] for key, values in parse_qs(place.query).items()}
            number = asked.get("number", "0")
            if not number.isascii() or not number.isdigit() or len(number) > 6:
                raise RefusedError(HTTPStatus.BAD_REQUEST, "`number` is a whole number")
            self._json(self._told(lambda: self.service.example(asked.get("domain", ""), int(number))))
        else:
            raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such page")

    def _post(self) -> None:
        place, asked = urlsplit(self.path).path, self._body()
        domain, problem = asked.get("domain"), asked.get("problem")
        if not isinstance(domain, str) or not isinstance(problem, str):
            raise RefusedError(HTTPStatus.BAD_REQUEST, "`domain` and `problem` are texts")
        if place == "/read":
            self._json(self._told(lambda: self.service.read(domain, problem)))
        elif place == "/solve":
            self._stream(domain, problem, str(asked.get("decode", "greedy")))
        else:
            raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such page")

    def _body(self) -> dict[str, Any]:
        if self.headers.get_content_type() != "application/json":
            raise RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "JSON is wanted")
        length = self.headers.get("Content-Length", "")
        if not length.isascii() or not length.isdigit():
            raise RefusedError(HTTPStatus.LENGTH_REQUIRED, "the request's length is wanted")
        if int(length) > MAX_BODY:
            raise RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"at most {MAX_BODY // 1024} KiB are taken")
        try:
            found = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            raise RefusedError(HTTPStatus.BAD_REQUEST, "this is no JSON") from None
        if not isinstance(found, dict):
            raise RefusedError(HTTPStatus.BAD_REQUEST, "a JSON object is wanted")
        return found

    def _stream(self, domain: str, problem: str, decode: str) -> None:
        """A plan's events, one JSON object a line, as they happen; the last may be an error."""
        self._head(HTTPStatus.OK, "application/x-ndjson")

        def tell(event: dict[str, Any]) -> None:
            self.wfile.write(json.dumps(event).encode() + b"\n")
            self.wfile.flush()

        found = self._told(lambda: self.service.solve(domain, problem, decode, tell) or {})
        if found:
            tell({"event": "error", **found})

    def _told(self, work: Any) -> dict[str, Any]:
        """What `work` gives, or a known error as the oracle puts it."""
        try:
            found: dict[str, Any] = work()
        except (_native.LimitError, _native.PddlError, _native.DataError) as error:
            return {"error": str(error)}
        except ValueError as error:
            if type(error).__module__.startswith("strips_lm."):
                return {"error": str(error)}
            raise
        return found

    def _json(self, value: dict[str, Any], status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(json.dumps(value).encode(), "application/json", status)

    def _send(self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._head(status, kind, len(body))
        self.wfile.write(body)

    def _head(self, status: HTTPStatus, kind: str, length: int | None = None) -> None:
        self.send_response(status)
        headers = {"Content-Type": kind, "Cache-Control": "no-store", "Content-Security-Policy": POLICY}
        headers |= {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
        headers |= {} if length is None else {"Content-Length": str(length)}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
