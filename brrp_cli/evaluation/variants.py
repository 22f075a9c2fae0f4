"""What is compared in one evaluation: methods, presets, k, retrievers, weights, shifted masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import product
from typing import Any

from brrp_cli.config import Config, preset
from brrp_cli.errors import BrrpError
from brrp_cli.methods.registry import METHODS

# Parts of a configuration that come after retrieval, or name it.
_AFTER_RETRIEVAL = ("preset", "k", "inference", "surface")


@dataclass(frozen=True, order=True)
class Variant:
    """One way to run. `preset`, `k` and `retriever` are None where a method has no prior, `weights`
    where it was not trained.

    weights : name of what was trained; shift : pixels by which the masks are moved to the right
    """

    method: str
    preset: str | None = None
    k: int | None = None
    retriever: str | None = None
    weights: str | None = None
    shift: int = 0

    @property
    def label(self) -> str:
        """All of it in words."""
        parts = [self.method]
        if self.preset is not None:
            parts += [self.preset, f"k={self.k}", str(self.retriever)]
        if self.weights is not None:
            parts.append(self.weights)
        if self.shift:
            parts.append(f"shifted {self.shift} px")
        return " ".join(parts)

    @property
    def config(self) -> Config:
        """The effective configuration; the default preset's where there is none."""
        config = preset(self.preset or "default")
        return config if self.k is None else replace(config, k=self.k)

    @property
    def configuration(self) -> dict[str, Any]:
        """What decides the results of this variant, without the preset's name."""
        method = METHODS[self.method]
        decides = method.configuration(self.config)
        decides.pop("preset", None)
        return {
            "method": self.method,
            "retriever": self.retriever,
            "shift": self.shift,
            "config": decides,
            **({} if self.weights is None else {"weights": self.weights}),
        }

    @property
    def retrieval_key(self) -> str:
        """Equal for variants whose retrieval gives the same probabilities."""
        config = {k: v for k, v in self.config.as_dict().items() if k not in _AFTER_RETRIEVAL}
        return f"{self.retriever} {config}"


def expand(
    methods: Sequence[str],
    presets: Sequence[str],
    ks: Sequence[int],
    retrievers: Sequence[str],
    shifts: Sequence[int],
    weights: Sequence[str] = (),
) -> list[Variant]:
    """All combinations that mean something, in the order given, each once.

    No k at all is the presets' own. Errors: BrrpError for an unknown method or preset, or for a
    method that was trained without the name of any weights.
    """
    for name in methods:
        if name not in METHODS:
            raise BrrpError("No such method", found=name, expected=", ".join(METHODS))
    found: list[Variant] = []
    for method, shift in product(methods, shifts):
        if METHODS[method].uses_weights:
            if not weights:
                raise BrrpError(f"{method} needs trained weights", fix="pass --weights FILE")
            found += [Variant(method, shift=shift, weights=name) for name in weights]
            continue
        if not METHODS[method].uses_prior:
            found.append(Variant(method, shift=shift))
            continue
        found += [
            Variant(method, name, k, retriever, shift=shift)
            for name, retriever in product(presets, retrievers)
            for k in (ks or [preset(name).k])
        ]
    return list(dict.fromkeys(found))


def same_results(variants: Sequence[Variant]) -> dict[Variant, Variant]:
    """Each variant -> the first one with the same configuration, which is the one that is run."""
    first: dict[str, Variant] = {}
    return {v: first.setdefault(repr(v.configuration), v) for v in variants}


def short_labels(variants: Sequence[Variant]) -> dict[Variant, str]:
    """Labels without what all variants that have it share; unique, since `label` is."""
    varying = {
        field.name
        for field in fields(Variant)
        if len({value for v in variants if (value := getattr(v, field.name)) is not None}) > 1
    }

    def label(variant: Variant) -> str:
        parts = [variant.method]
        for name, value in asdict(variant).items():
            if name in varying - {"method"} and value is not None:
                parts.append({"k": f"k={value}", "shift": f"shift {value}"}.get(name, str(value)))
        return " ".join(parts)

    return {variant: label(variant) for variant in variants}
