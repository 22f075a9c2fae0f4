from hypothesis import given
from hypothesis import strategies as st

from brrp_cli.prior.build.shard_plan import MAX_OBJECTS, plan_shards, shard_file
from brrp_cli.prior.names import SHARD_NAME

NAMES = st.lists(
    st.text("abcdef012_", min_size=1, max_size=6), min_size=2, max_size=60, unique=True
)


@given(NAMES)
def test_every_name_is_in_one_shard(names: list[str]) -> None:
    groups = plan_shards(names)
    assert [name for group in groups for name in group] == sorted(names)
    assert all(0 < len(group) <= MAX_OBJECTS for group in groups)


def test_one_more_mesh_changes_the_shard_it_falls_into_and_no_other() -> None:
    names = [f"{i:03d}_object" for i in range(400)]
    before = {tuple(group) for group in plan_shards(names)}
    for extra in ("000_a", "123_zzz", "399_zzz"):
        after = {tuple(group) for group in plan_shards([*names, extra])}
        # A cut that the limit of 16 forced may move along until the next cut by content.
        assert len(before - after) <= 3
        assert len(before & after) > 0.9 * len(before)


def test_the_file_is_named_after_all_that_decides_its_content() -> None:
    members = [("a", "11"), ("b", "22")]
    file = shard_file({"seed": 0}, members)
    assert SHARD_NAME.fullmatch(file)
    assert file == shard_file({"seed": 0}, list(members))
    assert file != shard_file({"seed": 1}, members)
    assert file != shard_file({"seed": 0}, [("a", "11"), ("b", "23")])
    assert file != shard_file({"seed": 0}, members[:1])
