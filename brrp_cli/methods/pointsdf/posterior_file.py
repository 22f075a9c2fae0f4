"""PointSDF in posterior.h5: the decoder once, and what is each object's own.

    /decoder            network: JSON of its NetworkConfig
    /decoder/NAME       the decoder's tensors, float32
    /objects/ID         center (3), scale, half_width
    /objects/ID/code    (C,) float32

So the file answers without the weights that it came from.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.methods.pointsdf.method import PointSDFPosterior

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
        tensors = {name: torch.from_numpy(np.asarray(data)) for name, data in group.items()}
        for name, tensor in decoder.state_dict().items():
            if name.endswith("num_batches_tracked"):
                tensors[name] = tensor
        decoder.load_state_dict(tensors)
    except (RuntimeError, TypeError) as error:
        raise ValueError(error) from error
    return decoder.eval().requires_grad_(False)


def write_object(group: h5py.Group, posterior: PointSDFPosterior) -> None:
    """Write what is one object's own."""
    group.attrs["center"] = posterior.center
    group.attrs["scale"] = posterior.scale
    group.attrs["half_width"] = posterior.half_width
    group.create_dataset("code", data=posterior.code, chunks=posterior.code.shape, fletcher32=True)


def read_object(group: h5py.Group, decoder: Decoder) -> PointSDFPosterior:
    """The object's posterior. Errors: KeyError, ValueError."""
    code = np.asarray(group["code"], dtype=np.float32)
    if code.shape != (decoder.config.code,):
        raise ValueError(f"a code of shape {code.shape}, not ({decoder.config.code},)")
    return PointSDFPosterior(
        decoder,
        code,
        np.asarray(group.attrs["center"], dtype=np.float64),
        float(group.attrs["scale"]),
        float(group.attrs["half_width"]),
    )
