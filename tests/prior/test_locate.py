from pathlib import Path

import pytest

from brrp_cli.prior import locate


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.delenv("BRRP_PRIOR", raising=False)
    return tmp_path


def test_where_builds_go(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert locate.output_prior(None)[0] == home / "data" / "brrp" / "prior"
    monkeypatch.setenv("BRRP_PRIOR", str(home / "named"))
    assert locate.output_prior(None)[0] == home / "named"
    assert locate.output_prior(Path("mine"))[0] == Path("mine")
