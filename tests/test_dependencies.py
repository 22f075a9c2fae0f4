from pathlib import Path

import pytest

from brrp_cli.dependencies import import_library, import_open3d
from brrp_cli.errors import DependencyError


def test_a_library_is_imported() -> None:
    assert import_library("json").loads("[1]") == [1]


def test_a_missing_package_says_how_to_install_it() -> None:
    with pytest.raises(DependencyError) as caught:
        import_library("brrp_no_such_package.part")
    assert str(caught.value).splitlines()[0] == "brrp_no_such_package.part does not load"
    assert "pip install brrp_no_such_package" in str(caught.value.fix)


@pytest.mark.parametrize(
    ("library", "package"),
    [
        ("libusb-1.0.so.0", "libusb-1.0-0"),
        ("libGL.so.1", "libgl1"),
        ("libOpenGL.so.0", "libopengl0"),
        ("libgomp.so.1", "libgomp1"),
        ("libX11.so.6", "libx11-6"),
    ],
)
@pytest.mark.parametrize("kind", ["ImportError", "OSError"])
def test_a_missing_system_library_names_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str, package: str, kind: str
) -> None:
    """The loader's words, in either exception that packages raise them as."""
    module = f"needs_{library.split('.')[0].replace('-', '_')}_{kind}".lower()
    text = f"{library}: cannot open shared object file: No such file or directory"
    (tmp_path / f"{module}.py").write_text(f"raise {kind}({text!r})\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(DependencyError) as caught:
        import_library(module)
    assert "apt-get install" in str(caught.value.fix)
    assert package in str(caught.value.fix)
    assert library in str(caught.value.found)


def test_what_open3d_is_imported_without_is_there_for_who_asks() -> None:
    o3d = import_open3d()
    assert callable(o3d.visualization.draw_geometries)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = o3d.nothing
