import logging
from pathlib import Path

import pytest

from brrp_cli.errors import PriorError
from brrp_cli.prior.build.descriptions import (
    YCB_MANIFEST,
    describe,
    phrase_from_name,
    phrases_of,
    read_descriptions,
)


@pytest.mark.parametrize(
    ("name", "phrase"),
    [
        ("big_red_cup", "a big red cup"),
        ("OrangeMug-2", "an orange mug 2"),
        ("035_power_drill", "a power drill"),
        ("000123", "an object"),
    ],
)
def test_phrase_from_name(name: str, phrase: str) -> None:
    assert phrase_from_name(name) == phrase


def test_given_phrase_wins_over_ycb_and_ycb_over_the_name() -> None:
    names = ["003_cracker_box", "025_mug", "tall_jar"]
    phrases = describe(names, {"025_mug": "my mug"})
    assert phrases == {
        "003_cracker_box": "a red cracker box",
        "025_mug": "my mug",
        "tall_jar": "a tall jar",
    }


def test_ycb_manifest_has_one_distinct_phrase_for_each_of_57_objects() -> None:
    table = read_descriptions(YCB_MANIFEST)
    assert len(table) == 57
    assert len(set(table.values())) == 57


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("d.toml", 'cup = "a red cup"\n'),
        ("d.toml", '[descriptions]\ncup = "a red cup"\n'),
        ("d.json", '{"cup": "a red cup"}'),
        ("d.csv", "cup,a red cup\n\n"),
    ],
)
def test_formats(tmp_path: Path, file: str, text: str) -> None:
    (tmp_path / file).write_text(text)
    assert read_descriptions(tmp_path / file) == {"cup": "a red cup"}


@pytest.mark.parametrize(
    ("file", "text", "told"),
    [
        ("d.csv", "cup\n", "row 1"),
        ("d.json", "[1, 2]", "no table"),
        ("d.json", "{", "Cannot read"),
        ("d.toml", "cup = 3\n", "cup"),
        ("d.toml", 'cup = " "\n', "cup"),
        ("d.yaml", "cup: red", "unknown format"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, file: str, text: str, told: str) -> None:
    (tmp_path / file).write_text(text)
    with pytest.raises(PriorError, match=told):
        read_descriptions(tmp_path / file)


def test_a_file_that_is_missing_or_no_text_is_told_in_words(tmp_path: Path) -> None:
    with pytest.raises(PriorError, match="Cannot read") as caught:
        read_descriptions(tmp_path / "none.toml")
    assert caught.value.found == "No such file or directory" and caught.value.fix
    (tmp_path / "d.csv").write_text("cup,a red cup", encoding="utf-16")
    with pytest.raises(PriorError, match="no UTF-8 text"):
        read_descriptions(tmp_path / "d.csv")
    (tmp_path / "d.csv").write_text("cup,a red cup", encoding="utf-8-sig")
    assert read_descriptions(tmp_path / "d.csv") == {"cup": "a red cup"}


def test_descriptions_of_no_mesh_are_noted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    (tmp_path / "d.csv").write_text("red_cupp,a red cup\nbowl,a bowl\n")
    assert phrases_of(["red_cup", "bowl"], tmp_path / "d.csv") == {
        "red_cup": "a red cup",
        "bowl": "a bowl",
    }
    assert "none of the meshes: red_cupp (is red_cupp red_cup?)" in caplog.text
    caplog.clear()
    phrases_of(["red_cupp", "bowl", "can"], tmp_path / "d.csv")
    phrases_of(["can"], None)
    assert not caplog.text
