"""What runs in a helper (helpers.py): one task after the other, until nobody asks any more."""

from __future__ import annotations

import pickle
import sys
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from brrp_cli.errors import BrrpError, unexpected
from brrp_cli.memory import one_heap
from brrp_cli.threads import one_thread_for_good

# Ctrl-C goes to all processes of a terminal, and the one that asked ends the others. That comes
# first: what is imported next takes a second.
BEGIN = (
    "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN);"
    "from brrp_cli.executors.helper_process import serve; serve()"
)


def serve() -> None:
    """Tasks that come through the pipe whose number is the first argument; the others name modules
    to be imported before. Ends where the other end of the pipe is closed, be it by the death of the
    process that held it."""
    one_heap()
    pipe = Connection(int(sys.argv[1]))
    for module in sys.argv[2:]:
        import_module(module)
    one_thread_for_good()
    try:
        pipe.send(None)
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))
    except (EOFError, OSError):
        return


def _answer(task: bytes) -> bytes:
    """Whether it went well, and the result or the error."""
    answer: tuple[bool, Any]
    try:
        function, args = pickle.loads(task)
        answer = True, function(*args)
    except BrrpError as error:
        answer = False, error
    except Exception as error:
        answer = False, _sendable(error)
    return pickle.dumps(answer, protocol=pickle.HIGHEST_PROTOCOL)


def _sendable(error: Exception) -> Exception:
    """The error, or what people are told of it where it cannot be sent."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return unexpected(error)
    return error
