"""A volume that is convolved as images is the volume convolved."""

import pytest
import torch
from torch import nn

from brrp_cli.completion.shape_network import convolved


@pytest.mark.parametrize("size", [(1, 1, 1), (2, 5, 3), (8, 8, 8)])
def test_layers_as_images(size):
    torch.manual_seed(0)
    convolution = nn.Conv3d(3, 4, 3, padding=1)
    volume = torch.randn(1, 3, *size)
    with torch.no_grad():
        torch.testing.assert_close(convolved(volume, convolution), convolution(volume))


def test_each_of_a_batch_is_as_alone():
    torch.manual_seed(0)
    convolution = nn.Conv3d(3, 4, 3, padding=1)
    volumes = torch.randn(2, 3, 4, 4, 4)
    with torch.no_grad():
        alone = torch.cat([convolved(each[None], convolution) for each in volumes])
        torch.testing.assert_close(alone, convolved(volumes, convolution))
