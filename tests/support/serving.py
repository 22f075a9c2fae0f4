"""A local HTTP server that misbehaves as it is told to."""

from __future__ import annotations

import http.server
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass
class Plan:
    """What the server does.

    files : path -> bytes; cuts : bytes after which an answer breaks off, one for each answer until
    there are none left; statuses : what the next answers are instead; ranges : whether a Range is
    heeded; chunked : whether the size goes untold; shift : bytes by which an answered range begins
    too late; asked : the Range of each request so far.
    """

    files: dict[str, bytes]
    cuts: list[int] = field(default_factory=list)
    statuses: list[int] = field(default_factory=list)
    ranges: bool = True
    chunked: bool = False
    shift: int = 0
    asked: list[str | None] = field(default_factory=list)


@contextmanager
def serving(plan: Plan) -> Iterator[str]:
    """Yield the address of a server that follows `plan`."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def log_message(self, *args: object) -> None:
            pass

        def do_GET(self) -> None:
            asked = self.headers.get("Range")
            plan.asked.append(asked)
            if plan.statuses:
                self.send_error(plan.statuses.pop(0))
                return
            whole = plan.files.get(self.path.lstrip("/"))
            if whole is None:
                self.send_error(404)
                return
            start = 0
            if asked and plan.ranges:
                start = int(re.fullmatch(r"bytes=(\d+)-", asked)[1]) + plan.shift
            if start >= len(whole):
                self.send_error(416)
                return
            # Before the answer begins: who has its head may ask for more at once.
            end = start + plan.cuts.pop(0) if plan.cuts else len(whole)
            self.send_response(206 if asked and plan.ranges else 200)
            if asked and plan.ranges:
                self.send_header("Content-Range", f"bytes {start}-{len(whole) - 1}/{len(whole)}")
            if not plan.chunked:
                self.send_header("Content-Length", str(len(whole) - start))
            self.end_headers()
            self.wfile.write(whole[start:end])

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
