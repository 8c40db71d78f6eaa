# SPDX-License-Identifier: GPL-3.0-or-later
"""For scripts that publish a few files: all of them or none, and one line where it fails. Standard
library only."""
import contextlib
import os
import pathlib
import sys
import tempfile


@contextlib.contextmanager
def whole_folder(folder):
    """A folder to write to; its files get into `folder` when nothing has failed."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".", dir=folder) as name:
        yield pathlib.Path(name)
        for path in sorted(pathlib.Path(name).iterdir()):
            os.replace(path, folder / path.name)


def run_main(main):
    """Calls main; what a user can mend is one line and exit code 2."""
    name = pathlib.Path(sys.argv[0]).stem
    try:
        main()
    except ImportError as error:
        text = f"{error}; Debian: python3-matplotlib, or --no-figure"
    except OSError as error:
        text = error
    except (ValueError, LookupError, TypeError) as error:
        text = f"the results are not what the command prints: {type(error).__name__}: {error}"
    else:
        return
    print(f"{name}: {text}", file=sys.stderr)
    sys.exit(2)
