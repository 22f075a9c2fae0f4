import csv
import io
import math
import multiprocessing

from brrp_cli.evaluation.rows import COLUMNS, RowLog, finished, table, variant_columns
from brrp_cli.evaluation.variants import Variant

PAPER, VPRISM = Variant("brrp", "paper", 3, "truth"), Variant("vprism")


def row(scene, object_id, objects, variant=VPRISM, **values):
    return {
        "scene": scene,
        "view": 0,
        "object_id": object_id,
        "objects_in_view": objects,
        **variant_columns(variant),
        **values,
    }


def test_rows_come_back_as_they_went(tmp_path):
    log = RowLog(tmp_path / "rows.jsonl")
    assert log.read() == []
    log.append([row("a", 1, 2, iou=0.25, chamfer=math.nan, best=None)])
    log.append([row("a", 2, 2, iou=1 / 3, chamfer=0.1)])
    first, second = log.read()
    assert first["iou"] == 0.25 and math.isnan(first["chamfer"]) and first["best"] is None
    assert second["iou"] == 1 / 3


def test_a_line_without_its_end_is_not_a_row(tmp_path):
    log = RowLog(tmp_path / "rows.jsonl")
    log.append([row("a", 1, 1), row("b", 1, 1)])
    whole = log.path.read_bytes()
    second = whole.index(b"\n") + 1
    for cut in range(second, len(whole)):
        log.path.write_bytes(whole[:cut])
        assert [r["scene"] for r in log.read()] == ["a"]


def test_views_that_are_half_done_are_not_kept():
    rows = [row("a", 1, 2), row("a", 2, 2), row("a", 1, 2, PAPER), row("b", 1, 2)]
    kept, complete = finished(rows)
    assert kept == rows[:2]
    assert complete == {("a", VPRISM)}


def _append(path, scene):
    log = RowLog(path)
    for i in range(40):
        log.append([row(scene, i, 40, message="x" * 3000), row(scene, i, 40, PAPER)])


def test_workers_do_not_write_into_one_anothers_lines(tmp_path):
    path = tmp_path / "rows.jsonl"
    context = multiprocessing.get_context("fork")
    crew = [context.Process(target=_append, args=(path, name)) for name in "ab"]
    for process in crew:
        process.start()
    for process in crew:
        process.join()
    rows = RowLog(path).read()
    assert len(rows) == 160
    assert finished(rows)[1] == {(scene, v) for scene in "ab" for v in (VPRISM, PAPER)}


def test_the_table_leaves_cells_without_a_value_empty():
    text = table([row("a", 1, 1, chamfer=math.nan, iou=0.0, name="with, comma")])
    (found,) = csv.DictReader(io.StringIO(text))
    assert list(found) == list(COLUMNS)
    assert (found["chamfer"], found["preset"], found["message"]) == ("", "", "")
    assert (found["iou"], found["name"]) == ("0.0", "with, comma")
