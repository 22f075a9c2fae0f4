"""Where a prior may be built."""

import pytest
from click.testing import CliRunner

from brrp_cli.cli import main
from brrp_cli.errors import OutputError
from brrp_cli.prior.build.output_folder import refuse_foreign
from brrp_cli.shapes import solids


@pytest.mark.parametrize("name", ["thesis.tex", ".git", "photos/a.png", "shards/mine.h5/x"])
def test_a_folder_of_other_files_is_refused(name, tmp_path):
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("mine")
    if name.startswith("shards"):
        (tmp_path / "notes.txt").touch()
    with pytest.raises(OutputError, match="holds other files"):
        refuse_foreign(tmp_path)


@pytest.mark.parametrize(
    "files",
    [
        [],
        [".lock"],
        [".lock", "shards/shard-1.h5"],
        ["manifest.json", "notes.txt"],
        ["shards/shard-1.h5", "notes.txt"],
    ],
)
def test_a_prior_and_what_a_build_left_are_not(files, tmp_path):
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    refuse_foreign(tmp_path)
    refuse_foreign(tmp_path / "not_there")


def test_the_command_leaves_the_folder_as_it_was(tmp_path):
    solids.box(0.1, 0.1, 0.1).export(tmp_path / "box.ply")
    result = CliRunner().invoke(main, ["build-prior", str(tmp_path), "-o", str(tmp_path)])
    assert result.exit_code == 1
    assert "found:    box.ply" in result.output and "Traceback" not in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["box.ply"]
