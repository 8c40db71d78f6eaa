# SPDX-License-Identifier: GPL-3.0-or-later
"""For scripts that read what the program printed and publish a few files: all of them or none, and
one line where it fails. Standard library only."""
import contextlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile

from children import terminate_as_interrupt


class InputError(Exception):
    """What is wrong with which file, in one line."""


def no_matplotlib(error):
    return (f"matplotlib cannot be loaded ({error}); run this with /usr/bin/python3 (Debian: "
            "python3-matplotlib)")


def of_system(error):
    """What an OSError says, beginning with the file where there is one."""
    return f"{error.filename}: {error.strerror}" if error.filename else str(error)


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


def printed(program, words, members, file=None, codes=(0,)):
    """What `PROGRAM WORDS` prints, with these {name: type}; not run where a file has it."""
    if file:
        result = read_object(file)
    else:
        done = subprocess.run([program, *words], stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode not in codes:
            sys.exit(done.returncode if done.returncode > 0 else 1)
        result = object_of(done.stdout, f"{program} {words[0]}")
    for name, kind in members.items():
        if not isinstance(result.get(name), kind):
            raise InputError(f"{file or program}: not what 'probelab {' '.join(words)}' prints: "
                             f"it lacks '{name}'")
    return result


@contextlib.contextmanager
def whole_folder(folder):
    """A folder to write to; its files get into `folder` when nothing has failed."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".", dir=folder) as name:
        yield pathlib.Path(name)
        for path in sorted(pathlib.Path(name).iterdir()):
            os.replace(path, folder / path.name)


def run_main(main):
    """Calls main; what a user can mend is one line and exit code 2. SIGTERM or Ctrl-C ends it and
    the command that it runs: 130."""
    terminate_as_interrupt()
    name = pathlib.Path(sys.argv[0]).stem
    try:
        main()
    except KeyboardInterrupt:
        print(f"{name}: interrupted; nothing was written", file=sys.stderr)
        sys.exit(130)
    except InputError as error:
        text = error
    except ImportError as error:
        text = no_matplotlib(error) + "; or --no-figure"
    except OSError as error:
        text = of_system(error)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        text = f"the results are not what the command prints: {type(error).__name__}: {error}"
    else:
        return
    print(f"{name}: {text}", file=sys.stderr)
    sys.exit(2)
