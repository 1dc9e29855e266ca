"""Makes this Python like that of Windows or macOS for our own code, in all processes: what they lack raises an error.

Python imports it at its start, if its folder is in ``PYTHONPATH`` and the variable IMITATED names the system. Only what
Python code does is seen; compiled libraries remain those of this machine.
"""

from __future__ import annotations

import builtins
import ctypes
import errno
import os
import re
import signal
import sys
import types
import warnings
from typing import Any

SYSTEM = os.environ.get("IMITATED", "")
OURS = {"mitsuba_taxel", "taxel_cli"}
SCRIPTS = {"worker.py", "system.py", "ftetwild.py"}
"""Files of ours that run under other names."""
UNIX_MODULES = {"resource", "fcntl", "pwd", "grp", "termios", "tty", "pty", "posix", "syslog", "readline"}
UNIX_NAMES = {
    "os": "fork forkpty getuid geteuid getgid getegid getgroups getpgid getpgrp setsid setpgid killpg wait wait3 wait4 "
    "waitid nice sysconf getloadavg uname mkfifo mknod chown fchown lchown chroot statvfs fstatvfs sync lockf "
    "sched_getaffinity sched_setaffinity posix_spawn pread pwrite sendfile register_at_fork fchdir fchmod confstr "
    "getpriority openpty pathconf O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_CLOEXEC O_SYNC WIFEXITED WIFSIGNALED",
    "signal": "SIGHUP SIGKILL SIGALRM SIGCHLD SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 SIGSTOP SIGCONT SIGTSTP alarm pause "
    "setitimer getitimer pthread_sigmask pthread_kill sigwait sigpending siginterrupt SIG_BLOCK SIG_SETMASK",
}
LINUX_NAMES = {
    "os": "sched_getaffinity sched_setaffinity posix_fadvise O_DIRECT memfd_create eventfd pidfd_open getrandom",
    "signal": "SIGRTMIN SIGRTMAX SIGPOLL SIGPWR SIGSTKFLT sigtimedwait",
    "resource": "prlimit RLIMIT_NICE RLIMIT_RTPRIO RLIMIT_SIGPENDING",
}
ABSENT = {"Windows": ("/proc/", "/sys/", "/dev/"), "macOS": ("/proc/", "/sys/")}
RESERVED = re.compile(r'[<>:"|?*\x00-\x1f]|[ .]$|^(con|prn|aux|nul|com\d|lpt\d)(\.|$)', re.IGNORECASE)
"""What a file name on Windows must not be."""


class Imitation(types.ModuleType):
    """A module as another system has it."""

    def __init__(self, module: types.ModuleType, missing: str, **replaced: Any) -> None:
        super().__init__(module.__name__)
        self.__dict__.update(_module=module, _missing=set(missing.split()), **replaced)

    def __getattr__(self, name: str) -> Any:
        if name in self._missing:
            raise AttributeError(f"{SYSTEM} has no {self.__name__}.{name}")
        return getattr(self._module, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._module, name, value)


def is_ours(module: dict[str, Any]) -> bool:
    name, file = str(module.get("__name__")), str(module.get("__file__"))
    return name.partition(".")[0] in OURS or os.path.basename(file) in SCRIPTS


def imitated_modules() -> dict[str, types.ModuleType]:
    if SYSTEM == "Windows":
        found = {name: Imitation(sys.modules[name], missing) for name, missing in UNIX_NAMES.items()}
        found["os"].__dict__.update(name="nt")
        found["signal"].__dict__.update(SIGBREAK=signal.Signals(21))
        windows = types.ModuleType("_winapi")
        windows.__dict__.update(
            SYNCHRONIZE=0, WAIT_TIMEOUT=258, OpenProcess=open_process, CloseHandle=int,
            WaitForSingleObject=lambda handle, milliseconds: 258,
        )  # fmt: skip
        return found | {"_winapi": windows, "sys": Imitation(sys, "", platform="win32"), "ctypes": Libraries()}
    import resource

    found = {name: Imitation(__import__(name), missing) for name, missing in LINUX_NAMES.items()}
    found["resource"].__dict__.update(setrlimit=refuse_address_limit(resource))
    return found | {"sys": Imitation(sys, "", platform="darwin"), "ctypes": Libraries()}


def open_process(access: int, inherit: bool, process: int) -> int:
    """Windows' own function, which finds no process that has ended."""
    try:
        os.kill(process, 0)
    except ProcessLookupError as error:
        failed = OSError(errno.EINVAL, "The parameter is incorrect")
        failed.winerror = 87
        raise failed from error
    return process


def refuse_address_limit(resource: types.ModuleType) -> Any:
    def setrlimit(kind: int, limits: tuple[int, int]) -> None:
        if kind == resource.RLIMIT_AS:
            raise ValueError("current limit exceeds maximum limit")
        resource.setrlimit(kind, limits)

    return setrlimit


class Libraries(Imitation):
    """``ctypes`` without the C library of Linux."""

    def __init__(self) -> None:
        super().__init__(ctypes, "", CDLL=self.load)

    def load(self, name: str | None, *args: Any, **kwargs: Any) -> Any:
        if name is None and SYSTEM == "Windows":
            raise TypeError("LoadLibrary() argument 1 must be str, not None")
        if name is None:
            return types.SimpleNamespace()
        if os.path.basename(name) == name:
            raise OSError(f"{name}: not found")
        return ctypes.CDLL(name, *args, **kwargs)


def imported(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> Any:
    if level == 0 and globals and is_ours(globals):
        if SYSTEM == "Windows" and name in UNIX_MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in MODULES:
            return MODULES[name]
    return real_import(name, globals, locals, fromlist, level)


def watch(event: str, args: tuple[Any, ...]) -> None:
    """Refuse what another system's files cannot be or do."""
    if event == "open" and isinstance(args[0], str):
        if args[0].startswith(ABSENT[SYSTEM]) and is_ours(caller()):
            raise FileNotFoundError(errno.ENOENT, f"{SYSTEM} has no such file", args[0])
        if SYSTEM == "Windows" and os.path.isdir(args[0]) and is_ours(sys._getframe(1).f_globals):
            raise PermissionError(errno.EACCES, "a folder cannot be opened", args[0])
        if args[2] & os.O_CREAT:
            check_name(args[0])
    elif event == "os.mkdir":
        check_name(os.fspath(args[0]))
    elif event == "os.rename":
        check_name(os.fspath(args[1]))
        check_closed(*args[:2])
    elif event in ("os.remove", "os.rmdir"):
        check_closed(args[0])
    elif event == "os.symlink" and SYSTEM == "Windows":
        raise OSError(errno.EPERM, "A required privilege is not held by the client", args[1])
    elif event == "os.fork" or (event == "os.kill" and SYSTEM == "Windows" and is_ours(sys._getframe(1).f_globals)):
        raise OSError(errno.ENOSYS, f"{SYSTEM} has no {event}")


def caller() -> dict[str, Any]:
    """Globals of the module that opens a file, by whatever function of the standard library."""
    frame = sys._getframe(2)
    while frame.f_back and str(frame.f_globals.get("__name__")).partition(".")[0] in ("pathlib", "io", "codecs"):
        frame = frame.f_back
    return frame.f_globals


def check_name(path: str | bytes) -> None:
    """Refuse names that Windows does not allow, and names of which another file differs by capital letters only."""
    path = os.path.abspath(os.fsdecode(path))
    if SYSTEM == "Windows" and any(RESERVED.search(part) for part in path.split(os.sep)[1:] if part):
        raise OSError(errno.EINVAL, "The filename, directory name, or volume label syntax is incorrect", path)
    if names.setdefault(path.lower(), path) != path:
        raise FileExistsError(errno.EEXIST, f"{names[path.lower()]} is the same file", path)


def check_closed(*paths: str | bytes) -> None:
    """Refuse to remove or rename an open file, or the working directory."""
    if SYSTEM != "Windows" or sys._getframe(2).f_globals.get("__name__") == "tempfile":
        return
    busy = {os.getcwd()}
    for number in os.listdir("/proc/self/fd"):
        try:
            busy.add(os.readlink(f"/proc/self/fd/{number}"))
        except OSError:
            pass
    for path in paths:
        if os.path.abspath(os.fsdecode(path)) in busy:
            raise PermissionError(errno.EACCES, "it is being used by another process", path)


if SYSTEM:
    names: dict[str, str] = {}
    MODULES = imitated_modules()
    real_import = builtins.__import__
    builtins.__import__ = imported
    sys.addaudithook(watch)
    warnings.filterwarnings("ignore", category=EncodingWarning)
    warnings.filterwarnings("error", category=EncodingWarning, module="mitsuba_taxel|taxel_cli")
