import pytest

from brrp_cli.executors import processes


@pytest.fixture(autouse=True)
def workers_start_as_users_start_them(monkeypatch):
    monkeypatch.setattr(processes, "START", "spawn")
