"""The file of the network that parts objects: ONNX with weights in half precision."""

from __future__ import annotations

import json
import warnings
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from google.protobuf.message import DecodeError
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from brrp_cli.errors import WeightsError
from brrp_cli.files import write_bytes
from brrp_cli.segmentation.image_channels import CHANNELS
from brrp_cli.segmentation.learned_affinities import (
    CHANNELS_IN,
    FORMAT,
    PROBABILITIES_OUT,
    WHAT,
)
from training.affinity_network import AffinityNetwork

# Of operators; every onnxruntime that the package takes knows it.
OPSET = 17
HALF = "_half"


class _Probabilities(nn.Module):
    def __init__(self, network: AffinityNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, channels: Tensor) -> Tensor:
        return torch.sigmoid(self.network(channels))


def save_affinity_network(network: AffinityNetwork, training: dict[str, Any], path: Path) -> None:
    """Write the file, whole or not at all. training : on what, how much, how well. Errors:
    OutputError."""
    buffer = BytesIO()
    sizes = {2: "rows", 3: "columns"}
    with warnings.catch_warnings():
        # The exporter that torch would rather have takes ten times as long, and renames weights.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            _Probabilities(network.eval()),
            (torch.zeros(1, CHANNELS, 64, 96),),
            buffer,
            dynamo=False,
            opset_version=OPSET,
            # Weights keep their names, so that a training can begin with them.
            do_constant_folding=False,
            input_names=[CHANNELS_IN],
            output_names=[PROBABILITIES_OUT],
            dynamic_axes={CHANNELS_IN: sizes, PROBABILITIES_OUT: sizes},
        )
    model = onnx.load_model_from_string(buffer.getvalue())
    _halve(model.graph)
    about = {
        "format": FORMAT,
        "network": json.dumps(asdict(network.config)),
        "training": json.dumps(training),
    }
    helper.set_model_props(model, about)
    write_bytes(path, model.SerializeToString())


def load_weights(path: Path) -> dict[str, Tensor]:
    """The weights of a file by name, float32. Errors: WeightsError if it is missing, damaged or of
    another kind."""
    try:
        model = onnx.load(path)
        found = {each.key: each.value for each in model.metadata_props}.get("format")
        if found != FORMAT:
            raise ValueError(found)
    except (OSError, ValueError, DecodeError) as error:
        raise WeightsError(
            f"{WHAT[0].upper()}{WHAT[1:]} cannot be read",
            where=path,
            expected=FORMAT,
            found=error,
            fix="give a file that tools/train_masks.py wrote",
        ) from error
    return {
        each.name.removeprefix("network.").removesuffix(HALF): torch.from_numpy(
            numpy_helper.to_array(each).astype(np.float32)
        )
        for each in model.graph.initializer
        if each.name.endswith(HALF)
    }


def _halve(graph: Any) -> None:
    """Weights become half precision, and are cast when the model is opened."""
    casts = []
    for each in graph.initializer:
        if each.data_type != TensorProto.FLOAT:
            continue
        name, values = each.name, numpy_helper.to_array(each)
        each.CopyFrom(numpy_helper.from_array(values.astype(np.float16), name + HALF))
        casts.append(helper.make_node("Cast", [name + HALF], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
