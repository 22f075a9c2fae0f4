"""What can go wrong, told to people.

Every failure that a user can cause or mend is a `BrrpError`. It says what went wrong, where, what
was expected, what was found and how to mend it. Commands print it as one message without a
traceback; any other exception is a bug, of which --verbose shows the traceback.
"""

from __future__ import annotations

import traceback


class BrrpError(Exception):
    """A failure with a message for people.

    Parameters
    ----------
    what : one sentence, without a full stop
    where : file, and key, row or id in it
    expected, found : what the code needs and what it met
    fix : what the user can do about it
    """

    exit_code = 1

    def __init__(
        self,
        what: str,
        *,
        where: object = None,
        expected: object = None,
        found: object = None,
        fix: str | None = None,
    ) -> None:
        self.what = what
        self.where = where
        self.expected = expected
        self.found = found
        self.fix = fix
        super().__init__(str(self))

    def __str__(self) -> str:
        lines = [self.what]
        for label in ("where", "expected", "found", "fix"):
            value = getattr(self, label)
            if value is not None:
                lines.append(f"  {label + ':':<10}{value}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[object, ...]:
        # Exceptions cross process borders (workers); keyword-only arguments need help to do so.
        return (_rebuild, (type(self), self.what, self.where, self.expected, self.found, self.fix))


def _rebuild(
    kind: type[BrrpError],
    what: str,
    where: object,
    expected: object,
    found: object,
    fix: str | None,
) -> BrrpError:
    return kind(what, where=where, expected=expected, found=found, fix=fix)


def unexpected(error: BaseException) -> BrrpError:
    """What people are told of an exception that is a bug of ours, or of a library."""
    last = traceback.extract_tb(error.__traceback__)[-1:]
    return BrrpError(
        "An error that brrp does not know",
        where=next((f"{frame.filename}:{frame.lineno}, {frame.name}" for frame in last), None),
        found=repr(error),
        fix="run again with --verbose, which shows the traceback, and send it to us",
    )


class ConfigError(BrrpError):
    """A configuration file has a key or a value that means nothing."""


class FrameError(BrrpError):
    """A frame, or what is to become one, cannot be used."""


class SceneError(BrrpError):
    """A scene to evaluate on, or its ground truth, cannot be used."""


class MeshError(BrrpError):
    """A mesh cannot become an object of the prior."""


class PriorError(BrrpError):
    """A prior is missing, damaged, or does not fit what is asked of it."""


class RetrievalError(BrrpError):
    """Retrieval cannot run: a model is missing or not the right one."""


class MaskError(BrrpError):
    """Masks cannot be made: a model is missing or not the right one."""


class WeightsError(BrrpError):
    """A learned method's weights are missing, damaged, or of something else."""


class ClusterError(BrrpError):
    """Workers on other machines cannot be reached, or cannot do the work."""


class FetchError(BrrpError):
    """A file cannot be fetched, or what came is not the file that was meant."""


class GripperError(BrrpError):
    """A gripper is not known, or its file cannot be used."""


class ResultError(BrrpError):
    """A folder of results cannot be used."""


class OutputError(BrrpError):
    """Results cannot be written."""


class DependencyError(BrrpError):
    """A library is missing or does not load."""
