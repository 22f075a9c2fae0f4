"""A record of results with any value in any place: refused, or whole enough for its readers."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from for_people import assert_for_people

from brrp_cli.api import open_result
from brrp_cli.cli import main
from brrp_cli.config import PRESETS, PointSDFConfig, VPrismConfig
from brrp_cli.errors import ResultError

RECORD = {
    "schema": 1,
    "brrp": "0.1.0",
    "frame": "camera",
    "T_frame_cam": np.eye(4).tolist(),
    "method": "brrp",
    "retriever": None,
    "seed": 0,
    "plane_cam": {"normal": [0.0, -1.0, 0.0], "offset": 0.5},
    "config": {"surface": {"level": 0.4}},
    "objects": [
        {
            "id": 7,
            "status": "ok",
            "message": "",
            "points": 900,
            "mesh": "object_7.ply",
            "uncertainty_unit": "metre",
        },
        {"id": -3, "status": "no_surface", "message": "none", "points": 0, "mesh": None},
    ],
}
VALUES = [None, True, 8, -1.5, 1e999, "a", "../../object_7.ply", [], [0], {}, {"a": []}, [[[]]]]


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    inner = [(*path, key) for key, _ in pairs]
    deeper = [
        place
        for key, item in (value.items() if isinstance(value, dict) else enumerate(value))
        if isinstance(item, dict | list)
        for place in places(item, (*path, key))
    ]
    return inner + deeper


def written(folder: Path, text: str) -> Path:
    (folder / "frame.npz").touch()
    (folder / "result.json").write_text(text)
    return folder


def changed(place: tuple[Any, ...], value: Any) -> dict[str, Any]:
    record = json.loads(json.dumps(RECORD))
    inner: Any = record
    for key in place[:-1]:
        inner = inner[key]
    if value is KeyError:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return record


@pytest.mark.parametrize("place", places(RECORD), ids=lambda place: "/".join(map(str, place)))
def test_any_value_in_any_place_is_refused_or_harmless(place, tmp_path: Path) -> None:
    open_result(written(tmp_path, json.dumps(RECORD)))
    for value in [*VALUES, KeyError]:
        try:
            stored = open_result(written(tmp_path, json.dumps(changed(place, value))))
        except ResultError as error:
            assert str(tmp_path) in str(error) and "brrp reconstruct" in str(error)
            assert_for_people(error)
            continue
        assert np.isfinite(stored.T_frame_cam).all()
        assert stored.plane is None or np.isfinite(stored.plane.normal).all()
        assert stored.surface_config.spacing > 0
        assert len(set(stored.object_ids)) == len(stored.object_ids)
        for item in stored.record["objects"]:
            assert item["mesh"] in (None, f"object_{item['id']}.ply")
            assert np.isfinite(float(item["points"]))


@pytest.mark.parametrize(
    "config",
    [*PRESETS.values(), VPrismConfig(), PointSDFConfig()],
    ids=[*PRESETS, "vprism", "pointsdf"],
)
def test_the_surface_of_every_configuration_is_read_as_it_was_written(config, tmp_path) -> None:
    record = changed(("config",), {"surface": asdict(config.surface)})
    assert open_result(written(tmp_path, json.dumps(record))).surface_config == config.surface


@pytest.mark.parametrize("text", ["", "null", "[" * 100_000, '{"schema": 1}', "{" + "9" * 500])
@pytest.mark.parametrize("command", ["view", "export"])
def test_commands_refuse_a_damaged_record(command: str, text: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(main, [command, str(written(tmp_path, text))])
    assert result.exit_code == 1 and result.stderr.startswith("Error:")
