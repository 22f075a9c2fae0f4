import pytest

from brrp_cli.config import preset
from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.variants import Variant, expand, same_results, short_labels


def test_methods_without_a_prior_are_not_multiplied():
    found = expand(["brrp", "vprism"], ["paper"], [1, 5], ["truth", "uniform"], [0, 2])
    assert [v for v in found if v.method == "vprism"] == [
        Variant("vprism"),
        Variant("vprism", shift=2),
    ]
    brrp = [(v.k, v.retriever, v.shift) for v in found if v.method == "brrp"]
    assert sorted(brrp) == sorted(
        (k, r, s) for k in (1, 5) for r in ("truth", "uniform") for s in (0, 2)
    )


def test_without_k_each_preset_has_its_own():
    (variant,) = expand(["brrp"], ["paper"], [], ["truth"], [0])
    assert variant.k == preset("paper").k
    assert variant.config == preset("paper")


def test_unknown_methods_are_refused():
    with pytest.raises(BrrpError, match="No such method"):
        expand(["magic"], ["paper"], [], ["truth"], [0])


def test_equal_configurations_are_run_once(monkeypatch):
    from dataclasses import replace

    from brrp_cli import config

    paper = config.PRESETS["paper"]
    monkeypatch.setitem(config.PRESETS, "default", replace(paper, preset="default"))
    one, two = expand(["brrp"], ["paper", "default"], [], ["truth"], [0])
    assert same_results([one, two]) == {one: one, two: one}
    monkeypatch.setitem(
        config.PRESETS,
        "default",
        replace(paper, preset="default", inference=replace(paper.inference, particles=9)),
    )
    assert same_results([one, two]) == {one: one, two: two}
    # Retrieval comes before inference: one answer serves both.
    assert one.retrieval_key == two.retrieval_key


def test_labels_say_what_differs_and_no_more():
    found = expand(["brrp", "vprism"], ["paper", "default"], [], ["truth"], [0])
    assert list(short_labels(found).values()) == ["brrp paper", "brrp default", "vprism"]
    found = expand(["brrp"], ["paper"], [1, 3], ["truth"], [0, 2])
    assert list(short_labels(found).values()) == [
        "brrp k=1 shift 0",
        "brrp k=3 shift 0",
        "brrp k=1 shift 2",
        "brrp k=3 shift 2",
    ]
