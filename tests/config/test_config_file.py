"""Every number can be said in a file, and what is said wrong is told with file and key."""

from __future__ import annotations

import tomllib
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from brrp_cli.cli import main
from brrp_cli.config import PRESETS
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.config.tables import changed
from brrp_cli.errors import ConfigError
from brrp_cli.evaluation.variants import expand, short_labels
from brrp_cli.methods.config_file import as_toml, load_config, read_config
from brrp_cli.methods.registry import METHODS

EVERY = [(method, preset) for method in METHODS for preset in METHODS[method].presets]
# One of the methods that have the same one.
ONCE = [
    *{METHODS[method].presets[name]: (method, name) for method, name in reversed(EVERY)}.values()
]


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def leaves(config: object, inside: str = "") -> dict[str, object]:
    """All values by their place: "a.b"."""
    found: dict[str, object] = {}
    for each in fields(config):  # type: ignore[arg-type]
        value = getattr(config, each.name)
        deeper = leaves(value, f"{inside}{each.name}.") if is_dataclass(value) else None
        found |= deeper or {inside + each.name: value}
    return found


@pytest.mark.parametrize(("method", "preset"), EVERY)
def test_what_is_shown_is_what_is_read(tmp_path, method, preset):
    done = CliRunner().invoke(main, ["config", "show", "--method", method, "--preset", preset])
    assert done.exit_code == 0, done.output
    path = written(tmp_path, done.output)
    assert load_config(path, method=method) == METHODS[method].presets[preset]
    assert read_config(path).segmentation() == SegmentConfig()


@pytest.mark.parametrize(("method", "preset"), ONCE)
def test_every_number_can_be_changed_by_itself(tmp_path, method, preset):
    config = METHODS[method].presets[preset]
    for place, value in leaves(config).items():
        if value is None or isinstance(value, str):
            continue
        other = not value if isinstance(value, bool) else _other(value)
        *tables, key = place.split(".")
        text = f"preset = '{preset}'\n" + (f"[{'.'.join(tables)}]\n" if tables else "")
        found = load_config(written(tmp_path, f"{text}{key} = {_toml(other)}\n"), method=method)
        assert leaves(found) == {**leaves(config), place: other}, place


def _other(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(_other(each) for each in value)
    return value + 1 if isinstance(value, int) else value * 0.5 if value else 0.25  # type: ignore[operator]


def _toml(value: object) -> str:
    return str(list(value) if isinstance(value, tuple) else value).lower()


def test_a_table_that_a_preset_lacks_starts_from_its_defaults(tmp_path):
    text = 'preset = "paper"\n[hypotheses.search]\nkept = 4\n'
    found = load_config(written(tmp_path, text))
    assert found.hypotheses.search == replace(PRESETS["default"].hypotheses.search, kept=4)
    assert found.surface == PRESETS["paper"].surface


WRONG = {
    "top level": ("surfaces = 1", "surfaces", "surface"),
    "nested": ("[surface]\nspacign = 0.004", "surface.spacign", "surface.spacing"),
    "deep": ("[hypotheses.search]\nturn = 12", "hypotheses.search.turn", "hypotheses.search.turns"),
    "masks": ("[segmentation.table]\nhigh = 1.0", "segmentation.table.high", "height"),
    "another method's": ("gamma = 3.0", "gamma", ""),
    "text for a number": ("[surface]\nspacing = '5 mm'", "surface.spacing", "a number"),
    "fraction for a count": ("k = 2.5", "k", "a whole number"),
    "truth for a count": ("k = true", "k", "a whole number"),
    "no count": ("k = 0", "k", "above 0"),
    "negative length": ("[surface]\nspacing = -0.005", "surface.spacing", "above 0"),
    "not finite": ("[surface]\nspacing = inf", "surface.spacing", "a number"),
    "no probability": ("[surface]\nlevel = 1.5", "surface.level", "at most 1"),
    "number for a table": ("surface = 0.4", "surface", "a table [surface]"),
    "number for a list": ("[features]\nscales = 1.0", "features.scales", "a list"),
    "preset": ("preset = 'papre'", "preset", "default, paper"),
    "method": ("method = 'vprism'", "method", "brrp"),
    "unknown method": ("method = 3", "method", "brrp"),
    "no TOML": ("k = = 3", "mine.toml", "a TOML file"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_told_with_file_and_key(tmp_path, wrong):
    text, key, told = WRONG[wrong]
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as error:
        load_config(path)
    assert str(path) in str(error.value.where) and str(error.value.where).endswith(key)
    assert told in f"{error.value.expected} {error.value.fix}"
    assert error.value.fix


FIXES = {
    "range": ("[surface]\nspacing = -1", "give surface.spacing such a value, or leave it out: "),
    "kept": ("[surface]\nspacing = -1", "it is 0.005 then"),
    "table": ("surface = 0.4", "write its keys below a line [surface]"),
    "another method's": ("gamma = 3.0", "it is a key of another method: method=vprism"),
    "no method's": ("zzz = 3.0", "brrp config show prints every key"),
    "method": ("method = 'vprism'", "choose its method with method=vprism"),
    "unknown method": ("method = 'vprsm'", "did you mean vprism?"),
    "preset": ("preset = 'papre'", "did you mean paper?"),
    "far preset": ("preset = 3", "write one of these names"),
    "no TOML": ("k = = 3", "mend that place"),
}


@pytest.mark.parametrize("wrong", FIXES)
def test_how_to_mend_it_is_told(tmp_path, wrong):
    text, fix = FIXES[wrong]
    with pytest.raises(ConfigError) as error:
        load_config(written(tmp_path, text))
    assert fix in str(error.value.fix)
    with pytest.raises(ConfigError, match="check the path"):
        read_config(tmp_path / "none.toml")


def test_the_way_out_is_told_as_it_is_typed(tmp_path):
    path = written(tmp_path, "gamma = 3.0\n")
    done = CliRunner().invoke(main, ["config", "show", "--config", str(path)])
    assert done.exit_code == 1 and "it is a key of another method: --method vprism" in done.output


def test_the_one_that_was_meant_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"did you mean surface\.spacing\?"):
        load_config(written(tmp_path, "[surface]\nspacign = 0.004"))


def test_commands_tell_it_before_the_work(tmp_path):
    path = written(tmp_path, "[surface]\nspacing = 0\n")
    (tmp_path / "none.npz").touch()
    for command in (
        ["config", "show", "--config", str(path)],
        ["reconstruct", str(tmp_path / "none.npz"), "--config", str(path)],
    ):
        done = CliRunner().invoke(main, command)
        assert done.exit_code == 1 and "surface.spacing" in done.stderr, done.output


def test_shown_changes_are_in_their_place(tmp_path):
    path = written(tmp_path, 'preset = "paper"\nk = 7\n[segmentation]\nmargin = 0.05\n')
    done = CliRunner().invoke(main, ["config", "show", "--config", str(path)])
    table = tomllib.loads(done.output)
    assert (table["preset"], table["k"], table["segmentation"]["margin"]) == ("paper", 7, 0.05)
    assert table["surface"]["level"] == 0.5 and "hypotheses" not in table


def test_files_are_variants_of_an_evaluation(tmp_path):
    fine = written(tmp_path, "[surface]\nspacing = 0.003\n")
    few = tmp_path / "few.toml"
    few.write_text('preset = "paper"\nk = 1\n')
    files = [read_config(fine), read_config(few)]
    found = expand(["brrp", "vprism"], [], [], ["truth"], [0], files=files)
    assert list(short_labels(found).values()) == ["brrp default+mine k=3", "brrp paper+few k=1"] + [
        "vprism"
    ]
    assert [v.config.surface.spacing for v in found] == [0.003, 0.005, 0.005]
    assert found[1].config.hypotheses is None and found[1].config.k == 1
    both = expand(["brrp"], ["paper", "default"], [5], ["truth"], [0], files=files[:1])
    assert [(v.preset, v.config.k) for v in both] == [("paper+mine", 5), ("default+mine", 5)]
    assert len({repr(v.configuration) for v in [*found, *both]}) == 5


def test_toml_of_a_changed_configuration_survives(tmp_path):
    config = changed(PRESETS["default"], {"features": {"scales": [1, 2.5]}}, "here")
    masks = SegmentConfig(rim=0.5)
    path = written(tmp_path, as_toml(METHODS["brrp"], config, masks))
    assert load_config(path) == config and config.features.scales == (1.0, 2.5)
    assert read_config(path).segmentation() == masks
