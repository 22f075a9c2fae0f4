"""MkDocs hook: what mkdocs-click makes of the commands, mended.

It takes a help text as Markdown, in which the lines of an example would run together, and shows the
mark by which click tells that an option has no default.
"""

from __future__ import annotations

import re
from typing import Any

_EXAMPLE = re.compile(r"<p>(Examples?:)\n(.*?)</p>", re.DOTALL)
_NOTHING = re.compile(r"<td>(?:<code>Sentinel\.UNSET</code>|N/A)</td>")


def on_page_content(html: str, **_: Any) -> str:
    """Called by MkDocs with the HTML of each page."""
    html = _EXAMPLE.sub(_block, html)
    return _NOTHING.sub("<td></td>", html)


def _block(found: re.Match[str]) -> str:
    lines = "\n".join(line.strip() for line in found[2].splitlines())
    return f"<p>{found[1]}</p>\n<pre><code>{lines}</code></pre>"
