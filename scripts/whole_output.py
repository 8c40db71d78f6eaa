# SPDX-License-Identifier: GPL-3.0-or-later
"""For scripts that read what the program printed and publish a few files: all of them or none, and
one line where it fails. Standard library only."""
import contextlib
import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

from children import terminate_as_interrupt


# Options of the program that leave nothing out, with how many values each takes.
HARMLESS = {"--quiet": 0, "--validation": 0, "--threads": 1, "--cache": 1, "--device": 1,
            "--seed": 1, "--require": 1}


class InputError(Exception):
    """What is wrong with which file, in one line."""


def no_matplotlib(error):
    return (f"matplotlib cannot be loaded ({error}); run this with /usr/bin/python3 (Debian: "
            "python3-matplotlib)")


def of_system(error):
    """What an OSError says, beginning with the file where there is one."""
    return f"{error.filename}: {error.strerror}" if error.filename else str(error)


@contextlib.contextmanager
def naming(file):
    """What the system says of a write, on a full disk for one, names no file: then it is this."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.strerror:
            error.filename = str(file)
        raise


def first_paragraph(text):
    """Of a script's own description, for --help."""
    return text.split("\n\n")[0]


def object_of(text, source):
    """The JSON object that a file or a program gave."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: no JSON: {error}") from error
    if not isinstance(found, dict):
        raise InputError(f"{source}: no JSON object")
    return found


def read_object(path):
    """The JSON object in a file."""
    try:
        return object_of(path.read_text(), path)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: no text: {error}") from error


def refuse_part(result, words, source):
    """A run that was interrupted, or of another command than `probelab WORDS`, is no whole one."""
    if result["interrupted"]:
        raise InputError(f"{source}: interrupted: these are not all results")
    command = result["provenance"].get("command")
    left, own = iter(shlex.split(str(command))[1:]), []
    for word in left:
        name, has_value, _ = word.partition("=")
        if name not in HARMLESS:
            own.append(word)
        elif HARMLESS[name] and not has_value:
            next(left, None)
    if sorted(own) != sorted(words):
        raise InputError(f"{source}: of '{command}', not of 'probelab {' '.join(words)}'")


def printed(program, words, members, file=None, codes=(0,)):
    """What `PROGRAM WORDS` prints, whole, with these {name: type}; not run where a file has it."""
    if file:
        result = read_object(file)
    else:
        done = subprocess.run([program, *words], stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode not in codes:
            sys.exit(done.returncode if done.returncode > 0 else 1)
        result = object_of(done.stdout, f"{program} {words[0]}")
    for name, kind in {**members, "provenance": dict, "interrupted": bool}.items():
        if not isinstance(result.get(name), kind) or result[name] == []:
            raise InputError(f"{file or program}: not what 'probelab {' '.join(words)}' prints: "
                             f"it lacks '{name}'")
    refuse_part(result, words, file or program)
    return result


@contextlib.contextmanager
def whole_folder(folder):
    """A folder to write to; its files get into `folder` when nothing has failed."""
    folder.mkdir(parents=True, exist_ok=True)
    with naming(folder), tempfile.TemporaryDirectory(prefix=".", dir=folder) as name:
        yield pathlib.Path(name)
        for path in sorted(pathlib.Path(name).iterdir()):
            os.replace(path, folder / path.name)


def flush():
    """What is still to be printed."""
    try:
        with naming("stdout"):
            if sys.stdout:  # None where the caller closed it
                sys.stdout.flush()
    except OSError:
        # Python flushes once more when it ends, and would say that this fails too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise


def run_main(main, interrupted="nothing was written"):
    """Calls main, which may return an exit code; what a user can mend is one line and exit code 2.
    SIGTERM or Ctrl-C ends it and the command that it runs: 130."""
    terminate_as_interrupt()
    name = pathlib.Path(sys.argv[0]).stem
    try:
        try:
            sys.exit(main())
        finally:
            flush()
    except KeyboardInterrupt:
        print(f"{name}: interrupted; {interrupted}", file=sys.stderr)
        sys.exit(130)
    except InputError as error:
        text = error
    except ImportError as error:
        text = no_matplotlib(error) + "; or --no-figure"
    except OSError as error:
        text = of_system(error)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        text = f"the results are not what the command prints: {type(error).__name__}: {error}"
    print(f"{name}: {text}", file=sys.stderr)
    sys.exit(2)
