"""The page: what it holds, and what a browser makes of it."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from browser import browse, chromium
from click.testing import CliRunner
from made_result import BOX, ELL, SPECK, write_made_result
from PIL import Image

from brrp_cli.cli import main

needs_browser = pytest.mark.skipif(
    chromium() is None, reason="no Chromium: BRRP_CHROMIUM names one"
)


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["view", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    folder = write_made_result(tmp_path_factory.mktemp("made") / "out")
    code = CliRunner().invoke(main, ["export", str(folder), "--collision", "hull"]).exit_code
    assert code == 0
    assert CliRunner().invoke(main, ["grasp", str(folder), "--per-object", "2"]).exit_code == 0
    return folder


@pytest.fixture(scope="module")
def page(results) -> Path:
    code, output = run(results, "--no-open")
    assert code == 0 and "view.html" in output
    return results / "view.html"


def embedded(page: Path, name: str) -> str:
    return re.search(rf'<script[^>]* id="{name}">(.*?)</script>', page.read_text(), re.S)[1]


def test_it_names_no_address_and_forbids_all(page):
    text = page.read_text()
    library = re.search(r"<script>(/\*! three.*?)</script>", text, re.S)[1]
    ours = text.replace(library, "")
    assert "http" not in re.sub(r"http-equiv", "", ours)
    assert "default-src 'none'" in text and "{{" not in ours


def test_names_of_objects_end_no_script(page):
    told = json.loads(embedded(page, "told"))
    names = {r["name"] for item in told["objects"] for r in item["retrieved"]}
    assert "a <b>box</b> & more" in names
    assert "<b>" not in page.read_text()


def test_the_glb_holds_meshes_points_spread_collision_shapes_and_grasps(page, results):
    blob = base64.b64decode(embedded(page, "glb"))
    scene = trimesh.load_scene(trimesh.util.wrap_as_stream(blob), file_type="glb")
    expected = {f"{kind}_{i}" for i in (BOX, ELL) for kind in ("object", "points")}
    assert expected | {"points_0"} <= set(scene.geometry)
    assert {name for name in scene.geometry if name.startswith("plan_")} == {
        f"plan_object_{i}_part_0" for i in (BOX, ELL)
    }
    assert {name for name in scene.geometry if name.startswith("grasps_")} == {
        f"grasps_{i}" for i in (BOX, ELL)
    }
    mesh = trimesh.load_mesh(results / f"object_{BOX}.ply", process=False)
    stored = mesh.metadata["_ply_raw"]["vertex"]["data"]["uncertainty"].reshape(-1)
    shown = scene.geometry[f"object_{BOX}"].vertex_attributes["_spread"].reshape(-1)
    np.testing.assert_allclose(shown, stored, rtol=1e-6)


def test_refuses_what_is_no_result(tmp_path):
    code, output = run(tmp_path, "--no-open")
    assert code == 1 and "There are no results" in output and "Traceback" not in output
    folder = write_made_result(tmp_path / "out")
    (folder / "frame.npz").unlink()
    code, output = run(folder, "--no-open")
    assert code == 1 and "lack the frame" in output
    (folder / "result.json").write_text("[]")
    code, output = run(folder, "--no-open")
    assert code == 1 and "another schema" in output


def test_a_mesh_that_is_cut_is_told(tmp_path):
    folder = write_made_result(tmp_path / "out")
    path = folder / f"object_{BOX}.ply"
    path.write_bytes(path.read_bytes()[:200])
    code, output = run(folder, "--no-open")
    assert code == 1 and path.name in output and "Traceback" not in output


def colourful(picture: np.ndarray) -> np.ndarray:
    """Pixels of the drawing (right of the list, above the scale) that are not grey."""
    drawing = picture[60:640, 410:].astype(int)
    return np.ptp(drawing, axis=2) > 40


@needs_browser
def test_a_browser_draws_it_turns_objects_off_and_asks_for_nothing(page):
    with browse() as tab:
        tab.open(page)
        assert tab.run("document.body.dataset.ready") == "yes"
        by_object = tab.screenshot()
        tab.click("[value=uncertainty]")
        first = tab.screenshot()
        both = colourful(first)
        assert both.mean() > 0.05, "uncertainty is drawn in colour"

        tab.click(f"input[data-object='{BOX}']")
        without_box = colourful(tab.screenshot())
        assert without_box.sum() < 0.8 * both.sum()
        tab.click(f"input[data-object='{ELL}']")
        assert colourful(tab.screenshot()).mean() < 0.002
        tab.click("#all")
        np.testing.assert_array_equal(colourful(tab.screenshot()), both)

        tab.click("[value=seen]")
        assert colourful(tab.screenshot()).mean() < 0.01, "the made image is grey"
        tab.click("[value=object]")
        np.testing.assert_array_equal(tab.screenshot()[60:640, 410:], by_object[60:640, 410:])
        assert colourful(by_object).mean() > 0.05
        assert (by_object != first).any()

        tab.click("[data-view=behind]")
        behind = tab.screenshot()
        assert (behind != by_object).any(axis=2).mean() > 0.05
        tab.click("#show-plan")
        assert (tab.screenshot() != behind).any(axis=2).mean() > 0.01
        shapes = tab.screenshot()
        tab.click("#show-grasps")
        green = tab.screenshot().astype(int)
        assert (green != shapes).any(axis=2).mean() > 0.002
        tab.click("#show-table")
        tab.click("#none")
        empty = tab.screenshot()[60:640, 410:]
        assert (empty == empty[0, 0]).all(), "nothing is left"

        assert tab.errors == []
        assert all(u.startswith(("file://", "data:", "blob:")) for u in tab.requests)
        assert [u for u in tab.requests if u.startswith("file://")] == [page.resolve().as_uri()]


@needs_browser
def test_the_list_and_the_scale_tell_the_numbers_of_the_record(page, results):
    record = json.loads((results / "result.json").read_text())
    with browse() as tab:
        tab.open(page)
        cards = {i: tab.run(f"document.querySelector('.card[data-object=\"{i}\"]').innerText")
                 for i in (BOX, ELL, SPECK)}  # fmt: skip
        for told in (
            "a <b>box</b> & more",
            "0.75",
            "0.90",
            "0.97",
            "none of them",
            "0.20",
            "0.8 s",
        ):
            assert told in cards[BOX]
        assert "too few points" in cards[SPECK] and "4 valid depth points" in cards[SPECK]
        box = next(item for item in record["objects"] if item["id"] == BOX)
        assert f"{box['extents'][0] * 100:.1f} ×" in cards[BOX]
        tab.click("[value=uncertainty]")
        ticks = tab.run("document.querySelector('#ticks').innerText")
        assert ticks.startswith("0") and ticks.count("mm") == 4

        # A click in the middle of the box reads the surface there.
        x, y = tab.run("(() => { const r = document.querySelector('#canvas')"
                       ".getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2];"
                       " })()")  # fmt: skip
        said = tab.run("document.querySelector('#probe').innerText")
        for shift in range(-240, 241, 40):
            tab.click_at(x + shift, y)
        read = tab.run("document.querySelector('#probe').innerText")
        assert read != said and re.match(
            r"object -?\d+: spread .* mm; \(.*\) m, camera frame", read
        )


def overlap(tab, one: str, other: str) -> bool:
    """Whether two elements that are shown cover a common pixel."""
    return tab.run(
        f"(() => {{ const [a, b] = ['{one}', '{other}'].map(s =>"
        " document.querySelector(s).getBoundingClientRect());"
        " return a.width * b.width > 0 && a.left < b.right && b.left < a.right"
        " && a.top < b.bottom && b.top < a.bottom; })()"
    )


def share_of(picture: np.ndarray, colour: list[int]) -> float:
    """Share of the pixels whose colour is `colour` in some light."""
    lit = picture.astype(float)
    length = np.linalg.norm(lit, axis=2) * np.linalg.norm(colour)
    cosine = (lit @ np.array(colour, float)) / np.maximum(length, 1)
    return float(((cosine > 0.995) & (np.ptp(lit, axis=2) > 40)).mean())


@needs_browser
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)], ids=["desk", "phone"])
def test_a_photograph_at_two_widths_tells_objects_apart_and_hides_nothing(
    width, height, page, tmp_path
):
    told = json.loads(embedded(page, "told"))
    colours = {item["id"]: item["colour"] for item in told["objects"]}
    with browse() as tab:
        tab.resize(width, height, phone=width < 500)
        tab.open(page)
        for colour in ("object", "uncertainty"):
            if colour == "uncertainty":
                tab.click(f"[value={colour}]")
                tab.run("window.scrollTo(0, 0)")
            photograph = tab.screenshot()
            Image.fromarray(photograph).save(tmp_path / f"{colour}.png")
            assert photograph.shape == (height, width, 3)
            assert tab.run("document.documentElement.scrollWidth") <= width
            for parts in (("#scale", "#probe"), ("nav", "#probe"), ("nav", "#scale")):
                assert not overlap(tab, *parts), parts
            left, top, right, bottom = tab.run(
                "(() => { const r = document.querySelector('#canvas').getBoundingClientRect();"
                " return [r.left, r.top, r.right, r.bottom]; })()"
            )
            drawing = photograph[int(top) + 50 : int(bottom) - 60, int(left) : int(right)]
            if colour == "object":
                assert all(share_of(drawing, colours[i]) > 0.01 for i in (BOX, ELL))
        # The longest readout there is stays clear of the scale, too.
        tab.run("document.querySelector('#probe').textContent = 'object 123: spread 12.3 mm; '"
                " + '(-10.123, -10.123, -10.123) m, camera frame'")  # fmt: skip
        assert not overlap(tab, "#scale", "#probe")


def test_rerun_writes_a_recording_of_everything(results, tmp_path):
    pytest.importorskip("rerun")
    path = tmp_path / "scene.rrd"
    code, _ = run(results, "--rerun", "-o", path)
    assert code == 0
    data = path.read_bytes()
    assert data.startswith(b"RRF2")
    for entity in ("camera/image/masks", f"objects/{BOX}", f"points/{ELL}", "collision/object_7"):
        assert f"/scene/{entity}".encode() in data


def test_without_rerun_it_says_what_to_install(results, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rerun", None)
    code, output = run(results, "--rerun")
    assert code == 1 and "rerun-sdk" in output and "Traceback" not in output


@pytest.mark.parametrize(
    ("name", "options", "suffix"),
    [("v.pdf", (), ".html"), ("v.rrd", (), ".html"), ("v.html", ("--rerun",), ".rrd")],
)
def test_a_page_is_no_other_kind_of_file(name, options, suffix, results, tmp_path):
    code, output = run(results, "--no-open", *options, "-o", tmp_path / name)
    assert code == 2 and f"must end in {suffix}, not '{name}'" in output
    assert not (tmp_path / name).exists()


def test_a_file_of_the_users_is_replaced_only_when_asked(results, tmp_path):
    page = tmp_path / "thesis.html"
    page.write_text("not yours")
    code, output = run(results, "--no-open", "-o", page)
    assert code == 1 and "--overwrite" in output and page.read_text() == "not yours"
    code, output = run(results, "--no-open", "-o", page, "--overwrite")
    assert code == 0 and "<html" in page.read_text()
    # The page of the results' own folder is brrp's to make anew.
    assert [run(results, "--no-open")[0] for _ in range(2)] == [0, 0]
