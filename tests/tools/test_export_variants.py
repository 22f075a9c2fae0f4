"""Variants of a prior's objects, and whether a prior can be made of them."""

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from export_variants import main, repainted

from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.store import open_prior


@pytest.fixture(scope="module")
def two_objects(tmp_path_factory):
    """A prior of a red box and a grey can."""
    folder = tmp_path_factory.mktemp("meshes")
    box, can = trimesh.creation.box((0.05, 0.08, 0.11)), trimesh.creation.cylinder(0.04, 0.1)
    box.visual.vertex_colors = [200, 40, 30, 255]
    can.visual.vertex_colors = [120, 120, 120, 255]
    box.export(folder / "box.ply")
    can.export(folder / "can.ply")
    build_prior(folder, folder / "prior", workers=1)
    return folder / "prior"


def exported(prior, output, *options):
    arguments = ["--prior", str(prior), "-o", str(output), *options]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    return {path.name: path.read_bytes() for path in sorted(output.iterdir())}


def test_every_variant_has_proportions_and_colours_of_its_own(two_objects, tmp_path):
    names = open_prior(two_objects).names
    files = exported(two_objects, tmp_path / "variants", "--count", str(2 * len(names)))
    assert list(files) == sorted(f"{name}-{turn:05d}.ply" for name in names for turn in (0, 1))
    shapes, paints = [], []
    for name in files:
        mesh = trimesh.load(tmp_path / "variants" / name, process=False)
        assert mesh.is_volume
        shapes.append(mesh.extents / mesh.extents.max())
        paints.append(mesh.visual.vertex_colors[:, :3].mean(axis=0))
    assert len(np.unique(np.round(shapes, 5), axis=0)) == len(files)
    assert len(np.unique(np.round(paints), axis=0)) == len(files)


def test_a_prior_is_built_of_them_under_their_names(two_objects, tmp_path):
    files = exported(two_objects, tmp_path / "variants", "--count", "2")
    build_prior(tmp_path / "variants", tmp_path / "prior", workers=1)
    assert [f"{name}.ply" for name in open_prior(tmp_path / "prior").names] == list(files)


def test_a_variant_does_not_depend_on_the_count(two_objects, tmp_path):
    few = exported(two_objects, tmp_path / "few", "--count", "3", "--seed", "4")
    more = exported(two_objects, tmp_path / "more", "--count", "5", "--seed", "4")
    assert few == {name: more[name] for name in few}
    others = exported(two_objects, tmp_path / "others", "--count", "3", "--seed", "5")
    assert all(few[name] != others[name] for name in few)


def test_repainting_keeps_what_is_alike_alike():
    colours = np.array([[200, 10, 10], [200, 10, 10], [10, 10, 10]], np.uint8)
    painted = repainted(colours, np.random.default_rng(0))
    np.testing.assert_array_equal(painted[0], painted[1])
    assert (painted[0] != painted[2]).sum() == 1
