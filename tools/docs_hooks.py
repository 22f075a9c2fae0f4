"""MkDocs hook: the examples in the commands' help texts become code blocks.

mkdocs-click takes a help text as Markdown, in which the lines of an example would run together.
"""

from __future__ import annotations

import re
from typing import Any

_EXAMPLE = re.compile(r"<p>(Examples?:)\n(.*?)</p>", re.DOTALL)


def on_page_content(html: str, **_: Any) -> str:
    """Called by MkDocs with the HTML of each page."""
    return _EXAMPLE.sub(_block, html)


def _block(found: re.Match[str]) -> str:
    lines = "\n".join(line.strip() for line in found[2].splitlines())
    return f"<p>{found[1]}</p>\n<pre><code>{lines}</code></pre>"
