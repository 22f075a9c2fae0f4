"""PointSDF's decoder in a file, which so answers without the weights that it came from.

network    JSON of its NetworkConfig
NAME       the decoder's tensors, float32
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.hdf5 import members

if TYPE_CHECKING:
    import h5py

    from brrp_cli.methods.pointsdf.network import Decoder


def write_decoder(group: h5py.Group, decoder: Decoder) -> None:
    """Write the decoder; the same one gives the same bytes."""
    group.attrs["network"] = json.dumps(asdict(decoder.config))
    for name, tensor in decoder.state_dict().items():
        if not name.endswith("num_batches_tracked"):
            data = tensor.cpu().numpy()
            group.create_dataset(name, data=data, chunks=data.shape, fletcher32=True)


def read_decoder(group: h5py.Group) -> Decoder:
    """The decoder that `write_decoder` wrote, on the CPU.

    Errors: KeyError or ValueError where something is missing or does not fit the rest.
    """
    import torch

    from brrp_cli.methods.pointsdf.network import Decoder, read_config

    try:
        decoder = Decoder(read_config(json.loads(group.attrs["network"])))
        tensors = {name: torch.from_numpy(np.asarray(data)) for name, data in members(group)}
        for name, tensor in decoder.state_dict().items():
            if name.endswith("num_batches_tracked"):
                tensors[name] = tensor
        decoder.load_state_dict(tensors)
    except (RuntimeError, TypeError) as error:
        raise ValueError(error) from error
    return decoder.eval().requires_grad_(False)
