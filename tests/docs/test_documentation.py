"""README and documentation against the program: commands, options, scripts, snippets, links."""

import ast
import importlib
import inspect
import re
import tomllib
from pathlib import Path
from typing import Any

import click
import markdown
import pytest
from docs_hooks import on_page_content
from documentation import (
    PAGES,
    ROOT,
    Shown,
    blocks,
    commands,
    inline_code,
    links,
    options_of_script,
    words,
)
from markdown.extensions.toc import slugify

from brrp_cli.cli import main
from brrp_cli.commands.method_options import OneOf

REFERENCE = ROOT / "docs" / "commands.md"
PLACEHOLDER = re.compile(r"^(COMMAND|NAME|[A-Z]+|\.\.\.)$")
CHECKED_TYPES = (click.Choice, click.IntRange, click.FloatRange, OneOf)


def all_commands(
    command: click.Command = main, path: tuple[str, ...] = ()
) -> dict[tuple[str, ...], click.Command]:
    """Every command of `brrp` by the words that call it, groups among them."""
    found = {path: command}
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            child = command.get_command(context, name)
            assert child is not None
            found |= all_commands(child, (*path, name))
    return found


def options(command: click.Command) -> set[str]:
    """The options of a command as they are typed."""
    shown = [p for p in command.get_params(click.Context(command)) if isinstance(p, click.Option)]
    return {name for p in shown if not p.hidden for name in (*p.opts, *p.secondary_opts)}


def check_call(arguments: list[str], *, complete: bool) -> None:
    """Parse what follows `brrp` as click does, without running or opening anything.

    complete : required options and arguments have to be there. Errors: click.UsageError.
    """
    command: click.Command = main
    context = click.Context(main, info_name="brrp")
    while True:
        parser = command.make_parser(context)
        values, rest, order = parser.parse_args(list(arguments))
        for param in order:
            value: Any = values.get(str(param.name))
            checked = isinstance(param.type, CHECKED_TYPES) and isinstance(value, str)
            if checked and not PLACEHOLDER.match(value):
                param.type.convert(value, param, context)
        if values.get("help"):
            return
        if not isinstance(command, click.Group):
            break
        if not rest:
            if complete:
                raise click.UsageError("no command")
            return
        if rest[0] == "COMMAND":
            unknown = {word for word in rest if word.startswith("-")} - {"--help"}
            if unknown:
                raise click.UsageError(f"no command has {unknown}")
            return
        child = command.get_command(context, rest[0])
        if child is None:
            raise click.UsageError(f"no such command: {rest[0]}")
        context = click.Context(child, info_name=rest[0], parent=context)
        command, arguments = child, rest[1:]
    if rest:
        raise click.UsageError(f"too many arguments: {rest}")
    if complete:
        for param in command.params:
            if param.required and values.get(str(param.name)) is None:
                raise click.UsageError(f"{param.name} is missing")


def shown_calls() -> list[tuple[Shown, list[str]]]:
    return list(commands("brrp"))


@pytest.mark.parametrize(("shown", "arguments"), shown_calls(), ids=lambda value: str(value)[:80])
def test_every_brrp_command_that_is_shown_exists(shown: Shown, arguments: list[str]) -> None:
    try:
        check_call(arguments, complete=shown.complete)
    except click.UsageError as error:
        pytest.fail(f"{shown}: {error.format_message()}")


@pytest.mark.parametrize(
    "arguments",
    [
        "frob frame.npz",
        "reconstruct frame.npz --no-such-option",
        "reconstruct frame.npz --method neural",
        "reconstruct frame.npz --k 0",
        "reconstruct one.npz two.npz",
        "build-prior meshes/ --units",
        "prior merge one/ two/",
        "",
    ],
)
def test_a_call_that_brrp_would_refuse_is_found(arguments: str) -> None:
    with pytest.raises(click.UsageError):
        check_call(arguments.split(), complete=True)


def test_shell_lines_are_split_into_commands() -> None:
    line = "A=1 bash tools/install.sh && .venv/bin/brrp demo -o 'my demo'  # then look; at it"
    assert words(line) == [
        ["bash", "tools/install.sh"],
        [".venv/bin/brrp", "demo", "-o", "my demo"],
    ]


def test_each_command_is_shown_in_a_guide() -> None:
    calls = {
        tuple(arguments[: len(path)])
        for shown, arguments in shown_calls()
        if shown.page != REFERENCE
        for path in all_commands()
    }
    assert set(all_commands()) - {()} - calls == set()


def test_options_in_running_text_exist() -> None:
    known = {name for command in all_commands().values() for name in options(command)} | {"--help"}
    for script in (ROOT / "tools").glob("*.py"):
        known |= options_of_script(script)
    unknown = [
        str(shown)
        for shown in inline_code()
        if shown.text.startswith("-")
        for word in shown.text.split()
        if word.startswith("--") and word.split("=")[0] not in known
    ]
    assert unknown == []


def test_scripts_that_are_shown_exist_with_their_options() -> None:
    wrong = []
    for shown, (script, *arguments) in commands("tools"):
        path = ROOT / script
        if not path.is_file():
            wrong.append(f"{shown}: no such file")
        elif path.suffix == ".py":
            # `--roll -180 180` has one option, and a negative number.
            given = {word.split("=")[0] for word in arguments if re.match("-[^0-9]", word)}
            unknown = given - options_of_script(path)
            wrong += [f"{shown}: no option {name}" for name in sorted(unknown)]
    assert wrong == []


def test_extras_that_are_shown_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    shown = {
        extra
        for page in PAGES
        for found in re.findall(r"'\.\[([\w,]+)\]'", page.read_text())
        for extra in found.split(",")
    }
    assert shown
    assert shown <= set(project["optional-dependencies"])


def test_the_architecture_names_every_folder_of_the_package_and_no_other() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^\| (`.*?) \|", page, re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)/`", row)}
    package = {path.parent.name for path in (ROOT / "brrp_cli").glob("*/__init__.py")}
    assert named == package


def test_files_of_the_repository_that_are_named_exist() -> None:
    tests = {path.name for path in (ROOT / "tests").rglob("*.py")}
    path = re.compile(r"(?<![\w/.-])(?:brrp_cli|data_manifests|docs|tests|tools)/[\w./-]*\w")
    missing = []
    for shown in inline_code():
        missing += [str(shown) for name in path.findall(shown.text) if not (ROOT / name).exists()]
        if re.fullmatch(r"test_\w+\.py", shown.text) and shown.text not in tests:
            missing.append(str(shown))
    assert missing == []


@pytest.mark.parametrize(
    "shown", blocks("python"), ids=lambda shown: f"{shown.page.name}:{shown.line}"
)
def test_python_snippets_use_what_there_is(shown: Shown) -> None:
    tree = ast.parse(shown.text)
    compile(tree, str(shown.page), "exec")
    ours = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("brrp_cli"):
            module = importlib.import_module(str(node.module))
            for name in node.names:
                ours[name.asname or name.name] = getattr(module, name.name)
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ours:
            keywords = {keyword.arg: None for keyword in node.keywords if keyword.arg}
            inspect.signature(ours[node.func.id]).bind_partial(*node.args, **keywords)


def anchors(page: Path) -> set[str]:
    """The ids of a page's headings, as MkDocs makes them."""
    titles = re.findall(r"^#+ (.+?)\s*$", page.read_text(), re.MULTILINE)
    return {slugify(re.sub(r"[`*]", "", title), "-") for title in titles}


def test_relative_links_lead_somewhere() -> None:
    wrong = []
    for shown in links():
        if re.match(r"\w+:", shown.text):
            continue
        name, _, anchor = shown.text.partition("#")
        target = (shown.page.parent / name).resolve() if name else shown.page
        if not target.is_file() or (anchor and anchor not in anchors(target)):
            wrong.append(str(shown))
    assert wrong == []


def test_every_picture_of_the_documentation_is_used() -> None:
    used = {Path(shown.text).name for shown in links()}
    assert {path.name for path in (ROOT / "docs" / "images").iterdir()} - used == set()


def test_the_readme_is_read_in_five_minutes() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 200


def test_the_reference_holds_every_command_and_option() -> None:
    extensions = ["attr_list", "mkdocs-click", "tables"]
    html = on_page_content(markdown.markdown(REFERENCE.read_text(), extensions=extensions))
    parts = re.split(r'<h\d [^>]*id="(brrp[\w-]*)"', html)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    for path, command in all_commands().items():
        section = sections[slugify(" ".join(("brrp", *path)), "-")]
        assert options(command) <= set(re.findall(r"(?<![\w-])-{1,2}[\w-]+", section)), path
        if not isinstance(command, click.Group):
            assert f"<pre><code>{' '.join(('brrp', *path))}" in section, "no example"
