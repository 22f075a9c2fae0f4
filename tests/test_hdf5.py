import threading

import pytest

from brrp_cli.hdf5 import hdf5_bytes, members


def filled(file):
    for name in ("b", "a"):
        file.create_group(name).attrs["told"] = name.upper()


def test_members_are_those_of_the_group():
    def fill(file):
        filled(file)
        assert [(name, group.attrs["told"]) for name, group in members(file)] == [
            ("a", "A"),
            ("b", "B"),
        ]

    hdf5_bytes(fill)


def test_a_loop_that_ended_with_an_error_keeps_no_other_thread_waiting():
    def fill(file):
        filled(file)
        return {name: group.attrs["of nothing"] for name, group in members(file)}

    with pytest.raises(KeyError) as caught:
        hdf5_bytes(fill)
    made = []
    other = threading.Thread(target=lambda: made.append(hdf5_bytes(filled)), daemon=True)
    other.start()
    other.join(30)
    # The error and with it the loop are still there.
    assert caught.value is not None and len(made) == 1
