"""How numbers and options are named in messages."""

from __future__ import annotations

from brrp_cli.spoken import agreed, command_line, counted, option


def test_a_noun_agrees_with_its_number():
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
    assert [counted(n, "mesh", "meshes") for n in (1, 5)] == ["1 mesh", "5 meshes"]


def test_a_verb_agrees_with_its_number():
    assert [agreed(n, "was", "were") for n in (0, 1, 2)] == ["were", "was", "were"]


def test_an_option_is_named_as_it_was_given():
    assert option("min_score", 0.9) == "min_score=0.9" and option("min_score") == "min_score"
    with command_line():
        assert option("min_score", 0.9) == "--min-score 0.9"
        assert option("min_score") == "--min-score"
