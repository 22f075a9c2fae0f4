"""What a method is: a name, what it needs, its presets, and one function that runs it.

A new method is a file or a folder of its own in brrp_cli/methods/, and one line in registry.py.
Python, the commands, sessions and evaluations find it there; nothing else has to know its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.registration import TrialConfig
from brrp_cli.config.tracking import SharpenConfig
from brrp_cli.errors import BrrpError, PriorError, WeightsError
from brrp_cli.methods.configuration import MethodConfig

if TYPE_CHECKING:
    from brrp_cli.executors.helpers import Helpers
    from brrp_cli.frames.frame import Frame
    from brrp_cli.prior.store import Prior
    from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction, StoredPosterior
    from brrp_cli.retrieval.base import Retriever


class Memory(Protocol):
    """What a method remembers of one object of a frame; the rest is its own.

    alone : whether earlier views were of no use to it: the object has moved since
    """

    @property
    def alone(self) -> bool:
        """See above."""


@dataclass(frozen=True)
class EarlierView:
    """One object as an earlier frame of a stream showed it, at rest since.

    T_now_then : (4, 4) rigid, from that frame's camera to the present one's
    memory : `ObjectReconstruction.memory`
    """

    T_now_then: NDArray[np.float64]
    memory: Memory


@dataclass(frozen=True)
class Stream:
    """earlier : object id -> its earlier views, oldest first; config : what is made of them"""

    earlier: Mapping[int, tuple[EarlierView, ...]]
    config: SharpenConfig


@dataclass(frozen=True)
class Trial:
    """Which stored objects lie in masks (H, W) that take the place of the frame's own, one at a
    time?"""

    masks: Sequence[NDArray[np.bool_]]
    config: TrialConfig


@dataclass(frozen=True)
class Setup:
    """What a method may need besides the frame.

    config : one of its presets, or a changed one; device : "auto", "cpu" or "cuda"
    prior, retriever : only where the method uses them
    weights : others than the method's own, of a method that was trained
    workers : objects at a time; None = as many as there are cores. Results do not depend on it
    helpers : processes that do some of the objects, for a method that `takes_helpers`
    only : the ids that are asked for, None = all; a method may do others in vain
    given : ids of the masks that somebody gave, None = all; brrp made the others
    image : `Reconstruction.image` of the same frame with other masks
    stream : of which the frame is one, for a method that remembers; None = the frame stands alone
    """

    config: Any
    seed: int = 0
    device: str = "auto"
    prior: Prior | None = None
    retriever: Retriever | None = None
    weights: Path | None = None
    workers: int | None = None
    helpers: Helpers | None = None
    only: frozenset[int] | None = None
    given: frozenset[int] | None = None
    image: Any = None
    stream: Stream | None = None


def _no_posteriors() -> tuple[type[StoredPosterior], ...]:
    return ()


@dataclass(frozen=True)
class Method:
    """One method.

    summary : a few words for `--help`
    presets : its named configurations; the first is used where none is named
    run : all objects of a frame, by id; what goes wrong with one object is no matter of the others
        (see `each_object`). Errors: BrrpError where nothing can be done for any object
    posteriors : the classes of its posteriors, for reading them back from a file
    uses_prior, uses_retriever : whether `run` needs them
    check_prior : PriorError unless it can work with that prior, before any work is done
    describe_weights : reads what a file of weights says of its training; None for a method that
        is not trained. Errors: WeightsError
    own_weights : what it was trained to as it is installed, and uses where no others are given;
        None for a method that is not trained, or brings none
    try_masks : which stored objects lie in each of other masks, without their shapes; None for a
        method that weighs no placements
    takes_helpers : whether it lets other processes do some of the objects
    gives_shapes : whether it reconstructs, or is there to be measured alone
    """

    name: str
    summary: str
    presets: Mapping[str, MethodConfig]
    run: Callable[[Frame, Setup], Reconstruction]
    posteriors: Callable[[], tuple[type[StoredPosterior], ...]] = _no_posteriors
    uses_prior: bool = False
    uses_retriever: bool = False
    check_prior: Callable[[Prior, Any], None] | None = None
    describe_weights: Callable[[Path], dict[str, Any]] | None = None
    own_weights: Path | None = None
    uses_cuda: bool = False
    try_masks: Callable[[Frame, Setup, Trial], list[ObjectReconstruction]] | None = None
    takes_helpers: bool = False
    gives_shapes: bool = True

    @property
    def uses_weights(self) -> bool:
        """Whether it was trained."""
        return self.describe_weights is not None

    @property
    def needs(self) -> str:
        """What it needs besides the frame, in words."""
        return "a prior" if self.uses_prior else "nothing but a frame"

    def preset(self, name: str | None = None) -> Any:
        """The configuration of that name; the first one without a name. Errors: BrrpError."""
        if name is None:
            return next(iter(self.presets.values()))
        if name not in self.presets:
            raise BrrpError(
                f"{self.name} has no such preset", found=name, expected=", ".join(self.presets)
            )
        return self.presets[name]

    def takes_no_retriever(self) -> BrrpError:
        """What is told where one was given in vain."""
        return BrrpError(f"{self.name} uses no retriever", found="a retriever", fix="leave it out")

    def check(self, setup: Setup) -> None:
        """What is lacking, or given in vain, is told before any work is done.

        Errors: BrrpError; PriorError for a prior that is missing or does not suit, WeightsError.
        """
        kind = type(self.preset())
        if not isinstance(setup.config, kind):
            raise BrrpError(
                f"This is no configuration of {self.name}",
                expected=kind.__name__,
                found=type(setup.config).__name__,
                fix="start from one of the method's presets",
            )
        if self.uses_prior and setup.prior is None:
            raise PriorError(
                f"{self.name} needs a prior", fix="pass open_prior(PATH), or choose another method"
            )
        if not self.uses_prior and setup.prior is not None:
            raise BrrpError(f"{self.name} uses no prior", found="a prior", fix="leave it out")
        if not self.uses_retriever and setup.retriever is not None:
            raise self.takes_no_retriever()
        if self.uses_weights and not (setup.weights or self.own_weights):
            raise WeightsError(
                f"{self.name} needs trained weights",
                fix="pass the file of them: --weights FILE, or weights=FILE in Python",
            )
        if not self.uses_weights and setup.weights is not None:
            raise BrrpError(f"{self.name} was not trained", found="weights", fix="leave them out")
        if self.check_prior is not None and setup.prior is not None:
            self.check_prior(setup.prior, setup.config)
