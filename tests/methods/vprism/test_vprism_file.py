"""The map of a scene in its file: what is left out never counts, and damage is told."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from brrp_cli.errors import BrrpError
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.methods.vprism.kernel_features import KernelBasis, kernel_features
from brrp_cli.methods.vprism.map_file import counting_pairs
from brrp_cli.methods.vprism.method import VPrismPosterior
from brrp_cli.methods.vprism.softmax_map import SoftmaxMap
from brrp_cli.results.posterior_file import save_posteriors

RNG = np.random.default_rng(0)
BOUNDS = np.array([[0.0, 0, 0], [0.8, 0.1, 0.1]])


@pytest.fixture(scope="module")
def posteriors() -> dict[int, VPrismPosterior]:
    """Two objects in a map of 60 hinges over 80 cm, further than two kernels reach."""
    basis = KernelBasis(RNG.uniform(*BOUNDS, (60, 3)), 1000.0, 1e-7)
    roots = RNG.normal(size=(3, basis.size, basis.size))
    covariance = roots @ roots.transpose(0, 2, 1)
    covariance = (covariance + covariance.transpose(0, 2, 1)) / 2
    scene = SoftmaxMap(basis, RNG.normal(size=(3, basis.size)), covariance)
    return {-4: VPrismPosterior(scene, 1, BOUNDS), 9: VPrismPosterior(scene, 2, BOUNDS)}


@pytest.fixture
def path(posteriors, tmp_path) -> Path:
    save_posteriors(posteriors, tmp_path / "posterior.h5")
    return tmp_path / "posterior.h5"


def test_no_two_features_meet_outside_of_the_pairs(posteriors):
    basis = posteriors[9].scene.basis
    rows, columns = counting_pairs(basis)
    assert len(rows) < 0.7 * basis.size * (basis.size + 1) / 2
    listed = np.zeros((basis.size, basis.size), dtype=bool)
    listed[rows, columns] = True
    values = np.zeros((4000, basis.size))
    for block in kernel_features(RNG.uniform(*BOUNDS, (4000, 3)), basis, 0.05).blocks:
        values[np.ix_(block.rows, block.columns)] = block.values
    meet = (values > 0).astype(float)
    assert not (np.triu(meet.T @ meet > 0) & ~listed).any()


def test_every_answer_survives_the_file(posteriors, path, tmp_path):
    found = open_posterior(path)
    points = RNG.uniform(BOUNDS[0] - 0.05, BOUNDS[1] + 0.05, (3000, 3))
    assert set(found) == set(posteriors)
    for object_id, posterior in posteriors.items():
        np.testing.assert_array_equal(found[object_id].bounds, posterior.bounds)
        for ask in ("probability", "uncertainty"):
            expected = getattr(posterior, ask)(points)
            np.testing.assert_array_equal(getattr(found[object_id], ask)(points), expected)
    save_posteriors(found, tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


def flip_a_covariance(path: Path) -> None:
    with h5py.File(path) as file:
        offset = file["shared/map/covariance"].id.get_chunk_info(0).byte_offset
    with path.open("r+b") as stream:
        stream.seek(offset + 100)
        byte = stream.read(1)[0]
        stream.seek(offset + 100)
        stream.write(bytes([byte ^ 0xFF]))


def drop_a_hinge(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        hinges = file["shared/map/hinges"][1:]
        del file["shared/map/hinges"]
        file["shared/map/hinges"] = hinges


def name_a_class_that_is_not_there(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file["objects/9"].attrs["label"] = 3


def lose_the_means(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["shared/map/mean"]


def cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-2000])


@pytest.mark.parametrize(
    "damage",
    [
        flip_a_covariance,
        drop_a_hinge,
        name_a_class_that_is_not_there,
        lose_the_means,
        cut_off,
    ],
)
def test_damage_is_told_and_not_used(path, damage):
    damage(path)
    with pytest.raises(BrrpError, match="cannot be read") as error:
        open_posterior(path)
    assert error.value.where == path
