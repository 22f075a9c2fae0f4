from pathlib import Path

import pytest

from brrp_cli.prior import locate
from brrp_cli.prior.default import locate_prior


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.delenv("BRRP_PRIOR", raising=False)
    return tmp_path


def put(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text("{}")


def test_the_order_of_places(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put(locate.default_prior_path())
    assert locate_prior(None)[0] == home / "data" / "brrp" / "prior"
    monkeypatch.setenv("BRRP_PRIOR", str(home / "named"))
    assert locate_prior(None) == (home / "named", "BRRP_PRIOR")
    assert locate_prior(Path("mine")) == (Path("mine"), "as given")
