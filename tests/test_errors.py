import pickle

import pytest

from brrp_cli.errors import (
    BrrpError,
    DependencyError,
    FetchError,
    FrameError,
    MeshError,
    OutputError,
    PriorError,
    RetrievalError,
)

KINDS = [
    BrrpError,
    FrameError,
    MeshError,
    PriorError,
    RetrievalError,
    FetchError,
    OutputError,
    DependencyError,
]


def test_message_layout() -> None:
    error = FrameError(
        "The frame has no depth", where="a.npz", expected="depth or xyz", found="rgb", fix="add it"
    )
    assert str(error).splitlines() == [
        "The frame has no depth",
        "  where:    a.npz",
        "  expected: depth or xyz",
        "  found:    rgb",
        "  fix:      add it",
    ]


def test_what_is_not_known_is_left_out_and_what_is_zero_is_not() -> None:
    assert str(BrrpError("No objects", found=0)) == "No objects\n  found:    0"
    assert str(BrrpError("No objects")) == "No objects"


@pytest.mark.parametrize("kind", KINDS)
def test_errors_cross_process_borders_whole(kind: type[BrrpError]) -> None:
    error = kind("what", where="w", expected=(1, 2), found=3.5, fix="f")
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is kind
    assert (back.what, back.where, back.expected, back.found, back.fix) == (
        "what",
        "w",
        (1, 2),
        3.5,
        "f",
    )
    assert str(back) == str(error)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_caught_as_brrp_error_and_fails_the_command(kind: type[BrrpError]) -> None:
    with pytest.raises(BrrpError) as caught:
        raise kind("what")
    assert caught.value.exit_code == 1
