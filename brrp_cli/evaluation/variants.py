"""What is compared in one evaluation: methods, presets, k, retrievers, weights, shifted masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any

from brrp_cli.errors import BrrpError
from brrp_cli.methods.base import Method
from brrp_cli.methods.config_file import ConfigFile
from brrp_cli.methods.configuration import as_record
from brrp_cli.methods.registry import METHODS

# Parts of a configuration that come after retrieval, or name it.
_AFTER_RETRIEVAL = ("preset", "k", "inference", "surface")


@dataclass(frozen=True, order=True)
class Variant:
    """One way to run. `preset` is None where the method has but one, `k` and `retriever` where it
    has no such thing, `weights` where it was not trained.

    preset : with the name of a configuration file after a + where one changes it
    changed : the configuration, where a file changes it
    weights : name of what was trained; shift : pixels by which the masks are moved to the right
    """

    method: str
    preset: str | None = None
    k: int | None = None
    retriever: str | None = None
    weights: str | None = None
    shift: int = 0
    changed: Any = field(default=None, compare=False, repr=False)

    @property
    def label(self) -> str:
        """All of it in words."""
        parts = [self.method]
        if self.preset is not None:
            parts.append(self.preset)
        if self.k is not None:
            parts.append(f"k={self.k}")
        parts += [each for each in (self.retriever, self.weights) if each is not None]
        if self.shift:
            parts.append(f"shifted {self.shift} px")
        return " ".join(parts)

    @property
    def config(self) -> Any:
        """The effective configuration of the method."""
        config = self.changed
        if config is None:
            config = METHODS[self.method].preset(self.preset)
        return config if self.k is None else replace(config, k=self.k)

    @property
    def configuration(self) -> dict[str, Any]:
        """What decides the results of this variant, without the preset's name."""
        decides = as_record(self.config)
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
        config = {k: v for k, v in as_record(self.config).items() if k not in _AFTER_RETRIEVAL}
        return f"{self.retriever} {config}"


def expand(
    methods: Sequence[str],
    presets: Sequence[str],
    ks: Sequence[int],
    retrievers: Sequence[str],
    shifts: Sequence[int],
    weights: Sequence[str] = (),
    files: Sequence[ConfigFile] = (),
) -> list[Variant]:
    """All combinations that mean something, in the order given, each once.

    No preset is each method's first; of those given a method runs the ones that it has, and one
    that has but one preset runs it in any case. No k is the presets' own. Errors: BrrpError for an
    unknown method and for one that has none of several presets. `weights` names those of a method
    that was trained; none, and it runs once, with its own.
    """
    for name in methods:
        if name not in METHODS:
            raise BrrpError("No such method", found=name, expected=", ".join(METHODS))
    found: list[Variant] = []
    named: list[str | None] = [*weights] or [None]
    for name, shift in product(methods, shifts):
        method = METHODS[name]
        found += [
            Variant(name, preset, k, retriever, trained, shift, config)
            for preset, config in _configurations(method, presets, files)
            for retriever in (retrievers if method.uses_retriever else [None])
            for trained in (named if method.uses_weights else [None])
            for k in _ks(method.preset(preset) if config is None else config, ks)
        ]
    return list(dict.fromkeys(found))


def _presets(method: Method, asked: Sequence[str]) -> list[str | None]:
    """The presets to run; None where the method has but one."""
    if len(method.presets) == 1:
        return [None]
    if not asked:
        return [next(iter(method.presets))]
    known = [name for name in asked if name in method.presets]
    if not known:
        method.preset(asked[0])
    return list(known)


def _configurations(
    method: Method, presets: Sequence[str], files: Sequence[ConfigFile]
) -> list[tuple[str | None, Any]]:
    """Names of presets, or of presets with the files that change them and what comes of it.

    Errors: BrrpError, ConfigError.
    """
    own = [file for file in files if file.method == method.name]
    if not own:
        return [(name, None) for name in _presets(method, presets)]
    names: list[str | None] = [None]
    if presets and len(method.presets) > 1:
        names = _presets(method, presets)
    return [
        (f"{name or file.preset(method)}+{file.path.stem}", file.config(method, name))
        for name in names
        for file in own
    ]


def _ks(config: Any, asked: Sequence[int]) -> list[int | None]:
    """How many objects are retrieved; None where the method's configuration has no `k`."""
    own = getattr(config, "k", None)
    return [None] if own is None else list(asked) or [own]


def same_results(variants: Sequence[Variant]) -> dict[Variant, Variant]:
    """Each variant -> the first one with the same configuration, which is the one that is run."""
    first: dict[str, Variant] = {}
    return {v: first.setdefault(repr(v.configuration), v) for v in variants}


def short_labels(variants: Sequence[Variant]) -> dict[Variant, str]:
    """Labels without what all variants that have it share; unique, since `label` is."""
    varying = {
        each.name
        for each in fields(Variant)
        if each.compare
        and len({value for v in variants if (value := getattr(v, each.name)) is not None}) > 1
    }

    def label(variant: Variant) -> str:
        parts = [variant.method]
        for name in (each.name for each in fields(Variant) if each.compare):
            value = getattr(variant, name)
            if name in varying - {"method"} and value is not None:
                parts.append({"k": f"k={value}", "shift": f"shift {value}"}.get(name, str(value)))
        return " ".join(parts)

    return {variant: label(variant) for variant in variants}
