"""Every file of tests is found by pytest."""

from fnmatch import fnmatch
from pathlib import Path

TESTS = Path(__file__).parent


def test_no_folder_has_a_name_that_pytest_leaves_out(pytestconfig):
    left_out = pytestconfig.getini("norecursedirs")
    folders = {
        part for file in TESTS.rglob("test_*.py") for part in file.relative_to(TESTS).parts[:-1]
    }
    assert "build" in folders
    assert not [name for name in folders if any(fnmatch(name, pattern) for pattern in left_out)]
