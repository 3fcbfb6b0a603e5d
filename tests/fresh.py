"""Runs code in fresh processes, forked from one that has loaded the libraries: loading them takes most of a short run.

The package itself is loaded by each process anew. Code that starts processes of its own, or is to be seen by how it
ends, needs an interpreter of its own.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

_PATIENCE = 600
_SERVER = """
import json, os, signal, sys, traceback, types, warnings
import llvmlite.binding, matplotlib, mpmath, numba, numpy, scipy.integrate, scipy.optimize, sksundae, sympy

found = list(sys.path[1:])

def child(code, arguments, folder, environment, stem, is_strict):
    for number, end in ((1, "out"), (2, "err")):
        os.dup2(os.open(stem + end, os.O_WRONLY | os.O_CREAT), number)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    numba.config.reload_config()
    sys.path[:] = ["", *filter(None, environment.get("PYTHONPATH", "").split(os.pathsep)), *found]
    sys.argv = ["-c", *arguments]
    warnings.resetwarnings()
    warnings.simplefilter("error" if is_strict else "default")
    main = sys.modules["__main__"] = types.ModuleType("__main__")
    exec(compile(code, "<string>", "exec"), main.__dict__)

for line in sys.stdin:
    given = json.loads(line)
    process = os.fork()
    if not process:
        status = 0
        try:
            child(**given)
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:
            traceback.print_exc()
            status = 1
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    signal.signal(signal.SIGALRM, lambda *_: os.kill(process, signal.SIGKILL))
    signal.alarm(PATIENCE)
    status = os.waitpid(process, 0)[1]
    signal.alarm(0)
    print(os.waitstatus_to_exitcode(status), flush=True)
"""


@cache
def _server() -> subprocess.Popen[str]:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    started = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", _SERVER.replace("PATIENCE", str(_PATIENCE))],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=tempfile.gettempdir(),
    )
    atexit.register(started.communicate)
    return started


def run(
    code: str,
    *arguments: str,
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
    is_strict: bool = False,
) -> subprocess.CompletedProcess[str]:
    """What the code prints, and its exit code.

    folder : the current folder of the process.
    environment : all of its environment; by default that of this process.
    is_strict : whether warnings are errors.
    """
    environment = dict(os.environ if environment is None else environment)
    where = str(folder or Path.cwd())
    if not hasattr(os, "fork"):
        words = [sys.executable, *(["-W", "error"] if is_strict else []), "-c", code, *arguments]
        return subprocess.run(words, cwd=where, env=environment, capture_output=True, text=True, check=False)
    server = _server()
    assert server.stdin is not None and server.stdout is not None
    with tempfile.TemporaryDirectory() as place:
        stem = f"{place}/"
        given = {"code": code, "arguments": arguments, "folder": where, "environment": environment}
        server.stdin.write(json.dumps({**given, "stem": stem, "is_strict": is_strict}) + "\n")
        server.stdin.flush()
        status = int(server.stdout.readline())
        out, err = (Path(stem + end).read_text(encoding="utf-8") for end in ("out", "err"))
    return subprocess.CompletedProcess(["-c", *arguments], status, out, err)
