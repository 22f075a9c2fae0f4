import numpy as np
import pytest

from brrp_cli.retrieval.base import knows_depth, top_k
from brrp_cli.retrieval.cached import RememberingRetriever
from brrp_cli.retrieval.checked import CheckedRetriever
from brrp_cli.retrieval.combined import BothRetriever
from brrp_cli.retrieval.given import UniformRetriever


def test_top_k_orders_by_probability_then_name() -> None:
    names = ["cup", "box", "can", "ant"]
    found = top_k(np.array([0.2, 0.2, 0.5, 0.1]), names, 3)
    assert found == [("can", 0.5), ("box", 0.2), ("cup", 0.2)]


def test_top_k_beyond_the_prior_gives_all_of_it() -> None:
    assert [name for name, _ in top_k(np.array([0.4, 0.6]), ["a", "b"], 10)] == ["b", "a"]


def test_top_k_refuses_probabilities_of_another_prior() -> None:
    with pytest.raises(ValueError):
        top_k(np.array([1.0]), ["a", "b"], 1)


def test_top_k_is_the_head_of_a_sorted_list() -> None:
    rng = np.random.default_rng(0)
    for count in (1, 2, 30):
        names = [f"{number:02d}" for number in rng.permutation(count)]
        # Few values, so that many are equal, at the last place too.
        values = rng.integers(4, size=count) / 10
        ranked = sorted(zip(names, values, strict=True), key=lambda t: (-t[1], t[0]))
        for k in (0, 1, 3, count, count + 1):
            assert top_k(values, names, k) == ranked[:k]


def test_whoever_asks_an_aligning_retriever_knows_the_depth() -> None:
    plain = UniformRetriever(["a", "b"])
    aligning = UniformRetriever(["a", "b"])
    aligning.aligns = True  # type: ignore[attr-defined]
    for asked, told in ((plain, False), (aligning, True)):
        around = (
            asked,
            CheckedRetriever(asked, 2),
            RememberingRetriever(asked),
            BothRetriever(asked, plain),
            BothRetriever(plain, asked),
        )
        assert [knows_depth(each) for each in around] == [told] * 5
