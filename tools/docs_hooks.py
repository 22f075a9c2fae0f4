"""MkDocs hook: the examples in the commands' help texts become code blocks.

mkdocs-click takes a help text as Markdown, in which the lines of an example would run together.
"""

from __future__ import annotations

import re
from typing import Any

_EXAMPLE = re.compile(r"<p>(Examples?:)\n(.*?)</p>", re.DOTALL)


def on_page_content(html: str, **_: Any) -> str:
    """Called by MkDocs with the HTML of each page."""
    return _EXAMPLE.sub(r"<p>\1</p>\n<pre><code>\2</code></pre>", html)
