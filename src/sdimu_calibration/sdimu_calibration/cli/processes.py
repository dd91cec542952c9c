"""Nodes as child processes in a ROS domain of their own: started, watched, and never left behind."""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO, Any

import yaml

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.config import config_folder

# 0 is where everyone else is; above 101 the ports of DDS reach into the system's ephemeral ones.
DOMAINS = range(1, 102)
STATED = range(233)
DOMAIN_VARIABLE = "ROS_DOMAIN_ID"
_LOCK = "sdimu-domain-"
"""Begin of the name of the file that holds a domain, in the folder of temporary files."""
POLITE_S = 5.0
_PATIENT_S = 60.0
"""Longest wait for a node that is stopped by itself (s): on a busy machine closing its files takes long."""
_FULL = 65_536
"""Free space of a disk (bytes) below which it is full: a part of a recording, and a log, no longer fit."""
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux


@contextmanager
def own_domain(log: Path, domain: int | None = None, about: RunningTest | None = None) -> Iterator[int]:
    """Put this process, and the children it starts, into a ROS domain that no other run on this machine uses.

    Traffic stays on the loopback interface. The domain is held by a lock file until the end.

    Parameters
    ----------
    log : Path
        Folder of the nodes' logs.
    domain : int, optional
        The domain; left out, it is that of ``ROS_DOMAIN_ID``, and without it one that is free.
    about : RunningTest, optional
        What is run there, for those that watch it.

    Yields
    ------
    int
        The domain.
    """
    stated = domain if domain is not None else stated_domain()
    domain, lock = _free_domain() if stated is None else _stated_domain(stated)
    if about is not None:
        lock.truncate(0)
        lock.write(json.dumps(asdict(about) | {"domain": domain}))
        lock.flush()
    before = dict(os.environ)
    os.environ["ROS_LOG_DIR"] = str(log.resolve())
    enter_domain(domain)
    try:
        yield domain
    finally:
        if about is not None:
            lock.truncate(0)
        for name in os.environ.keys() - before.keys():
            del os.environ[name]
        os.environ |= before
        lock.close()


def enter_domain(domain: int) -> None:
    """Let ROS, loaded after this, speak in a domain on this machine alone, as a run of `sdimu` does."""
    os.environ |= {DOMAIN_VARIABLE: str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(config_folder() / "ros" / "fastdds.xml"))


@dataclass(frozen=True)
class RunningTest:
    """A test that a run of `sdimu` on this machine makes, as it tells those that watch it."""

    folder: str
    """Of its results."""
    duration_s: float = 0.0
    """0 where nobody knows."""
    stops: int = 0
    """0 where nobody knows."""
    model: str = "baseline"
    imu: str = "dtg"
    start_ns: int = 0
    """Stamp of its begin."""
    domain: int = 0
    course: str = ""
    """What the table drives, such as ``plan kim18``."""
    site: str = ""
    diagnosed: bool = True
    """At the end of each stop."""

    @property
    def words(self) -> str:
        """Which test it is, in one line."""
        from sdimu_calibration.core.origin import Origin
        from sdimu_calibration.report.beside_title import beside_title

        return beside_title(Origin(imu=self.imu, site=self.site), of=self.folder, course=self.course)


def running_tests() -> tuple[RunningTest, ...]:
    """Return the tests that runs of `sdimu` make on this machine now, by domain."""
    found = []
    for path in Path(tempfile.gettempdir()).glob(f"{_LOCK}*.lock"):
        number = path.stem.removeprefix(_LOCK)
        if number.isdigit() and is_held(int(number)) and (test := _told(path, int(number))) is not None:
            found.append(test)
    return tuple(sorted(found, key=lambda test: test.domain))


def is_held(domain: int) -> bool:
    """Tell whether a run of `sdimu` holds a domain."""
    path = _lock_file(domain)
    if not path.is_file():
        return False
    lock = _locked(domain)
    if lock is None:
        return True
    lock.close()
    return False


def _told(path: Path, domain: int) -> RunningTest | None:
    """Read what a run tells of its test; None where it tells nothing, such as a test of the nodes alone."""
    from pydantic import TypeAdapter

    try:
        return replace(TypeAdapter(RunningTest).validate_json(path.read_bytes()), domain=domain)
    except (OSError, ValueError):
        return None


@contextmanager
def own_folder(out: Path) -> Iterator[None]:
    """Hold a folder of results, so that no other run writes into it; it is made where it is missing."""
    (out / "log").mkdir(parents=True, exist_ok=True)
    lock = _lock(out / "log" / "run.lock")
    if lock is None:
        raise DataError(f"{out}: another sdimu run writes into this folder; wait for it, or name another with --out")
    with lock:
        yield


def stated_domain() -> int | None:
    """Return the domain of ``ROS_DOMAIN_ID``; None without it, DataError when it is none."""
    text = os.environ.get(DOMAIN_VARIABLE, "").strip()
    if not text:
        return None
    if not text.isdigit() or int(text) not in STATED:
        raise DataError(f"environment variable {DOMAIN_VARIABLE}: '{text}' is no ROS domain (expected 0 to 232)")
    return int(text)


def _stated_domain(number: int) -> tuple[int, IO[str]]:
    """Take a domain that the user wants; two runs in one would take each other's samples."""
    if number not in STATED:
        raise DataError(f"--domain {number}: expected 0 to 232")
    lock = _locked(number)
    if lock is None:
        raise DataError(f"ROS domain {number} holds another run of sdimu: end it, or state another with --domain")
    return number, lock


def _locked(number: int) -> IO[str] | None:
    """Lock a domain; None when it is taken."""
    try:
        return _lock(_lock_file(number))
    except OSError:
        return None  # another user's


def _lock_file(number: int) -> Path:
    return Path(tempfile.gettempdir()) / f"{_LOCK}{number}.lock"


def _lock(path: Path) -> IO[str] | None:
    """Lock a file until it is closed or this process ends; None when another holds it."""
    lock = path.open("a", encoding="utf-8")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        return None
    return lock


def _free_domain() -> tuple[int, IO[str]]:
    # Starting at different places keeps two runs that begin together from racing for each lock.
    start = os.getpid() % len(DOMAINS)
    for number in [*DOMAINS[start:], *DOMAINS[:start]]:
        lock = _locked(number)
        if lock is not None:
            return number, lock
    raise DataError("all 101 ROS domains of this machine are in use; end other runs first")


@dataclass
class _Child:
    process: subprocess.Popen[bytes]
    log: Path


class Children:
    """A set of nodes, each a process; leaving the context ends them all.

    Parameters
    ----------
    log : Path
        Folder of their output, ``<name>.log``, and parameters, ``<name>.yaml``.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._children: dict[str, _Child] = {}
        log.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, name: str, module: str, parameters: Mapping[str, Any]) -> None:
        """Start a node.

        `module`: Python module to run. `parameters`: ROS parameters; empty lists are left out, ROS cannot type them.
        """
        given = {key: value for key, value in parameters.items() if value != []}
        # A file, not -p NAME:=VALUE: there "1,2" or "on" would be read as something else than text.
        file = self._log / f"{name}.yaml"
        file.write_text(_dumped({name: {"ros__parameters": given}}), encoding="utf-8")
        self.run(name, module, ["--ros-args", "--params-file", str(file)])

    def run(self, name: str, module: str, arguments: Sequence[str]) -> None:
        """Start a process: a Python module with its arguments, called `name` here."""
        path = self._log / f"{name}.log"
        with path.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                env=dict(os.environ),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                preexec_fn=_die_with_parent,  # noqa: PLW1509 (no threads have been started yet)
            )
        self._children[name] = _Child(process, path)

    def running(self) -> list[str]:
        """Names of those still running."""
        for name, child in self._children.items():
            code = child.process.poll()
            if code:
                raise DataError(f"{name}: {_last_words(child.log, code)}")
        return [name for name, child in self._children.items() if child.process.poll() is None]

    def kill(self, name: str) -> None:
        """End a node without a warning, as a crash would; it no longer counts as failed."""
        child = self._children.pop(name)
        child.process.kill()
        child.process.wait()

    def stop(self, name: str, how: signal.Signals = signal.SIGINT) -> int:
        """Stop a node with a signal; its exit status."""
        child = self._children.pop(name)
        child.process.send_signal(how)
        return child.process.wait(_PATIENT_S)

    def end(self) -> None:
        """End those still running: SIGINT first, so that files are closed, SIGKILL after five seconds."""
        alive = [child.process for child in self._children.values() if child.process.poll() is None]
        for process in alive:
            process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + POLITE_S
        for process in alive:
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:  # noqa: PERF203 (three processes)
                process.kill()
                process.wait()


class _Quoted(yaml.SafeDumper):
    """Writes every text in quotes: ROS takes a bare ``y`` for true, where YAML's own rules keep it a text."""


def _quoted(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')


_Quoted.add_representer(str, _quoted)


def _dumped(parameters: Mapping[str, Any]) -> str:
    """Write a file of ROS parameters."""
    return str(yaml.dump(parameters, Dumper=_Quoted, width=10**6))


def _die_with_parent() -> None:
    """Ask the kernel to stop this child when its parent is killed."""
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGTERM)


def _last_words(log: Path, code: int) -> str:
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}; see {log}"
    lines = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    if lines:
        return lines[-1]
    if shutil.disk_usage(log.parent).free < _FULL:
        return f"ended with status {code}: no space is left on the disk of {log.parent}"
    return f"ended with status {code}; see {log}"
