"""This module checks that a folder is private, so that code found in it may be executed.

Anybody who can put a file in the cache can run code as this user. A folder is used only if this user or
the superuser owns it and every folder above it, and nobody else may write to them.
"""

from __future__ import annotations

import os
import stat
from collections import deque
from contextlib import suppress
from pathlib import Path

HAS_OWNERS = hasattr(os, "geteuid")  # on Windows a user's own folder is private by its access list
_LINKS = 40  # most links in one path, as in Linux


def why_not(path: Path) -> str | None:
    """Return the reason why another user may have written code at a path, or None if that is impossible.

    Missing parts of the path are accepted, since this user creates them.
    """
    if not HAS_OWNERS:
        return None
    here, left, links = "/", deque(Path(os.path.abspath(path)).parts[1:]), 0
    while True:
        try:
            found = os.lstat(here)
        except FileNotFoundError:
            return None
        except OSError as fault:
            return f"cannot access {here}: {fault.strerror}"
        if not _has_trusted_owner(found):
            return f"{here} belongs to another user ({_name(found.st_uid)})"
        if stat.S_ISLNK(found.st_mode):
            links += 1
            if links > _LINKS:
                return f"{path} contains a loop of symbolic links"
            target = os.readlink(here)
            left.extendleft(reversed([part for part in target.split("/") if part not in ("", ".")]))
            here = "/" if target.startswith("/") else os.path.dirname(here)
            continue
        if not stat.S_ISDIR(found.st_mode):
            return f"{here} is not a folder"
        is_sticky = bool(found.st_mode & stat.S_ISVTX)  # other users may add files but not change ours
        if _others_may_write(found) and not (is_sticky and left):
            return f"other users may write to {here} (mode {stat.S_IMODE(found.st_mode):o})"
        if not left:
            return None
        part = left.popleft()
        here = os.path.dirname(here) if part == ".." else os.path.join(here, part)


def is_trusted_file(path: str | Path) -> bool:
    """Return whether only this user or the superuser can have written a regular file at a path."""
    try:
        found = os.lstat(path)
    except OSError:
        return False
    if not stat.S_ISREG(found.st_mode):
        return False
    return not HAS_OWNERS or (_has_trusted_owner(found) and not _others_may_write(found))


def make_private(path: Path) -> None:
    """Create a folder and its missing parents with mode 700."""
    for folder in (*reversed(path.parents), path):
        with suppress(FileExistsError):
            if not folder.is_dir():
                os.mkdir(folder, 0o700)


def _has_trusted_owner(found: os.stat_result) -> bool:
    if found.st_uid in (0, os.geteuid()):
        return True
    # in a container the host's superuser is not mapped; all unmapped users have this one number
    return found.st_uid == _unmapped() and not found.st_mode & 0o022


def _unmapped() -> int | None:
    """Return the user number for users that are unknown in this container, or None if all users are known."""
    try:
        with open("/proc/self/uid_map") as mapped, open("/proc/sys/kernel/overflowuid") as number:
            knows_all = mapped.read().split() == ["0", "0", "4294967295"]
            return None if knows_all else int(number.read())
    except (OSError, ValueError):
        return None


def _others_may_write(found: os.stat_result) -> bool:
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_group_of_one(found.st_gid)


def _is_group_of_one(group: int) -> bool:
    """Return whether a group has the user's name and no other member."""
    if group != os.getegid():
        return False
    import grp
    import pwd

    try:
        entry = grp.getgrgid(group)
        name = pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return False
    return entry.gr_name == name and set(entry.gr_mem) <= {name}


def _name(user: int) -> str:
    import pwd

    try:
        return f"{pwd.getpwuid(user).pw_name}, {user}"
    except KeyError:
        return str(user)
