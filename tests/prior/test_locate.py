from pathlib import Path

import pytest

from brrp_cli.errors import PriorError
from brrp_cli.prior import locate


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.delenv("BRRP_PRIOR", raising=False)
    return tmp_path


def put(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text("{}")


def test_the_order_of_places(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(PriorError, match="no prior yet") as caught:
        locate.locate_prior(None)
    assert "brrp demo" in str(caught.value)
    put(locate.starter_prior_path())
    assert locate.locate_prior(None) == (locate.starter_prior_path(), "the starter prior")
    put(locate.default_prior_path())
    assert locate.locate_prior(None)[0] == home / "data" / "brrp" / "prior"
    monkeypatch.setenv("BRRP_PRIOR", str(home / "named"))
    assert locate.locate_prior(None) == (home / "named", "BRRP_PRIOR")
    assert locate.locate_prior(Path("mine")) == (Path("mine"), "as given")


def test_where_builds_go(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert locate.output_prior(None)[0] == home / "data" / "brrp" / "prior"
    monkeypatch.setenv("BRRP_PRIOR", str(home / "named"))
    assert locate.output_prior(None)[0] == home / "named"
    assert locate.output_prior(Path("mine"))[0] == Path("mine")
