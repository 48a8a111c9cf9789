"""What the page is made of beside viser's client: our own script and style, which the server hands out itself."""

from __future__ import annotations

import gzip
import http
from functools import lru_cache
from pathlib import Path

import viser
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

FOLDER = Path(__file__).parent / "web"
KINDS = {"/page.js": "text/javascript; charset=utf-8", "/page.css": "text/css; charset=utf-8"}
"""Files that are ours, by their path."""

HEAD = '<link rel="stylesheet" href="/page.css"><script defer src="/page.js"></script></head>'


def asset(request: Request) -> Response | None:
    """The answer to a request for the page or one of our files; None for anything else."""
    path = request.path.partition("?")[0]
    if request.headers.get("Upgrade", "").lower() == "websocket":
        return None
    if path in KINDS:
        return _answer((FOLDER / path[1:]).read_bytes(), KINDS[path], request)
    if path in ("/", "/index.html"):
        return _answer(_page(), "text/html; charset=utf-8", request)
    return None


@lru_cache(maxsize=1)
def _page() -> bytes:
    """viser's page with our title, script and style."""
    text = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text("utf-8")
    text = text.replace("<title>Viser</title>", "<title>Ligature</title>", 1)
    text = text.replace('content="Viser client"', 'content="A simulator for robot-assisted suturing"', 1)
    before, _, after = text.rpartition("</head>")
    return (before + HEAD + after).encode()


@lru_cache(maxsize=4)
def _small(content: bytes) -> bytes:
    return gzip.compress(content, 6)


def _answer(content: bytes, kind: str, request: Request) -> Response:
    headers = Headers({"Content-Type": kind, "Cache-Control": "no-cache"})
    if "gzip" in request.headers.get("Accept-Encoding", ""):
        content = _small(content)
        headers["Content-Encoding"] = "gzip"
    headers["Content-Length"] = str(len(content))
    return Response(http.HTTPStatus.OK, "OK", headers, content)
