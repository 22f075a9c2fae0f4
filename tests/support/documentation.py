"""What README and documentation show: code blocks, inline code, command lines, links."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_FENCE = re.compile(r"^[ \t]*```(\w*)[^\n]*\n(.*?)^[ \t]*```[ \t]*$", re.DOTALL | re.MULTILINE)
_INLINE = re.compile(r"(?<!`)(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.DOTALL)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_KEYWORDS = {"do", "then", "else", "sudo", "time", "nice"}
_ASSIGNMENT = re.compile(r"^[A-Za-z_]\w*=")


@dataclass(frozen=True)
class Shown:
    """A piece of a page. `complete` : from a code block, so that it should run as it stands."""

    page: Path
    line: int
    text: str
    complete: bool = True

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}: {self.text}"


def _text(page: Path) -> str:
    """A page without HTML comments; lines keep their numbers."""
    return _COMMENT.sub(lambda found: "\n" * found[0].count("\n"), page.read_text())


def blocks(*languages: str) -> Iterator[Shown]:
    """Every fenced code block in one of these languages."""
    for page in PAGES:
        text = _text(page)
        for found in _FENCE.finditer(text):
            if found[1] in languages:
                yield Shown(page, text.count("\n", 0, found.start(2)) + 1, found[2])


def inline_code() -> Iterator[Shown]:
    """Every `inline code`, outside of code blocks, on one line."""
    for page in PAGES:
        text = _FENCE.sub(lambda found: "\n" * found[0].count("\n"), _text(page))
        for found in _INLINE.finditer(text):
            code = " ".join(found[2].replace("\\|", "|").split())
            yield Shown(page, text.count("\n", 0, found.start()) + 1, code, complete=False)


def links() -> Iterator[Shown]:
    """The target of every link and picture."""
    for page in PAGES:
        text = _INLINE.sub("", _FENCE.sub("", _text(page)))
        for found in _LINK.finditer(text):
            yield Shown(page, text.count("\n", 0, found.start()) + 1, found[1], complete=False)


def shell_lines() -> Iterator[Shown]:
    """Each line that a reader would type; a line that ends in a backslash goes on."""
    for block in blocks("sh", "bash", "console"):
        lines = block.text.replace("\\\n", " \0").split("\n")
        number = block.line
        for line in lines:
            typed = line.strip()
            if "$ " in block.text and typed.startswith("$ "):
                yield Shown(block.page, number, typed[2:].replace("\0", ""))
            elif not block.text.lstrip().startswith("$ "):
                yield Shown(block.page, number, typed.replace("\0", ""))
            number += 1 + line.count("\0")


def words(line: str) -> list[list[str]]:
    """The simple commands of a shell line, as words, without comments and assignments."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    commands: list[list[str]] = [[]]
    for word in lexer:
        if set(word) <= set("();<>|&"):
            commands.append([])
        elif commands[-1] or not (word in _KEYWORDS or _ASSIGNMENT.match(word)):
            commands[-1].append(word)
    return [command for command in commands if command]


def commands(program: str) -> Iterator[tuple[Shown, list[str]]]:
    """The arguments of every command line of `program`, in code blocks and in inline code.

    program : "brrp", or a folder such as "tools", whose scripts python and bash run; the script is
    then the first of the arguments
    """
    for shown in [*shell_lines(), *inline_code()]:
        if not shown.complete and not _starts(shown.text, program):
            continue
        for found in words(shown.text):
            if _is(found[0], program):
                yield shown, found[1:] if program == "brrp" else found
            elif Path(found[0]).name in ("python", "bash") and _is("".join(found[1:2]), program):
                yield shown, found[1:]


def _is(word: str, program: str) -> bool:
    if program == "brrp":
        return Path(word).name == "brrp"
    return word.startswith(f"{program}/") and bool(Path(word).suffix)


def _starts(code: str, program: str) -> bool:
    return code.startswith((f"{program} ", f"{program}/", f"python {program}/", f"bash {program}/"))


@cache
def options_of_script(script: Path) -> frozenset[str]:
    """The options that a script of click or argparse defines, read and not run."""
    found = {"--help"}
    for node in ast.walk(ast.parse(script.read_text())):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if name in ("option", "add_argument"):
                texts = [a.value for a in node.args if isinstance(a, ast.Constant)]
                found |= {
                    part for t in texts if str(t).startswith("-") for part in str(t).split("/")
                }
    return frozenset(found)
